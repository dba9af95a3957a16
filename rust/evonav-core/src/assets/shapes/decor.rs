//! Shapes of plants, pictures, doors and windows as assets, ornaments and sports goods.

use crate::assets::{
    material::MaterialKind,
    shapes::{
        colour::{DARK, Paint, STEEL, WOODS, rgb, shade},
        sketch::{ALL, Along, Sketch, Span, between, ends, inside},
    },
};

/// Draw a plant: pot, soil, stem and foliage.
pub fn plant(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, _, z] = s.spans();
    let pots = [rgb(180, 100, 70), rgb(225, 220, 212), rgb(80, 85, 90), rgb(150, 125, 100)];
    let pot = s.choose(&pots, pots[0]).of(MaterialKind::Ceramic);
    let leaf = s
        .choose(&[rgb(70, 120, 60), rgb(55, 100, 55), rgb(95, 135, 70)], rgb(70, 120, 60))
        .of(MaterialKind::Leaves);
    s.detail("pot", 1);
    let pot_top = (0.32 * h).min(0.5);
    let radius = (0.32 * w.min(d)).min(0.5 * pot_top + 0.05);
    let around = |span: [f64; 2]| inside(span, 0.5 * (span[1] - span[0] - 2.0 * radius));
    let [pot_x, pot_z] = [x, z].map(around);
    s.column(pot_x, [0.0, pot_top], pot_z, 1.3, 10, pot);
    let [soil_x, soil_z] = [pot_x, pot_z].map(|span| inside(span, 0.1 * radius));
    s.column(
        soil_x,
        [pot_top, pot_top + 0.005],
        soil_z,
        1.0,
        10,
        rgb(60, 45, 35).of(MaterialKind::Soil),
    );
    s.pole(
        [0.0, 0.0],
        0.05 * w.min(d),
        [pot_top, 0.6 * h],
        6,
        rgb(95, 80, 50).of(MaterialKind::Wood),
    );
    let crown = 0.75 * h;
    s.ellipsoid(between(x, 0.12, 0.88), [crown - 0.25 * h, h], between(z, 0.12, 0.88), leaf);
    s.blob(between(x, 0.0, 0.6), [pot_top, crown], between(z, 0.3, 1.0), shade(leaf, 0.85));
    let upper = [1.1 * pot_top, crown + 0.1 * h];
    s.blob(between(x, 0.4, 1.0), upper, between(z, 0.0, 0.6), shade(leaf, 1.15));
    s.trim(|s| foliage(s, crown, leaf));
}

/// Draw leaves that point out of a crown of foliage, in a spiral from its lower to its upper end.
fn foliage(s: &mut Sketch<'_>, crown: f64, leaf: Paint) {
    /// Angle between leaves that follow each other, as on most plants.
    const GOLDEN_DEG: f64 = 137.508;
    let [w, h, d] = s.size();
    let (count, length) = s.choose(&[(36, 0.28), (48, 0.2), (26, 0.36)], (36, 0.28));
    let size = [length, s.choose(&[0.45, 0.6, 0.3], 0.45) * length].map(|edge| edge * w.min(d));
    for i in 0..count {
        let height = (f64::from(i) + 0.5) / f64::from(count);
        let turn_deg = f64::from(i) * GOLDEN_DEG;
        let (sin, cos) = turn_deg.to_radians().sin_cos();
        // The crown is widest at its middle.
        let reach = 0.3 * (1.0 - (2.0 * height - 1.0).powi(2)).sqrt();
        let root = [reach * w * cos, crown + (0.5 * height - 0.28) * h, reach * d * sin];
        let tone = [0.85, 1.0, 1.2][i as usize % 3];
        s.leaf(root, turn_deg, 75.0 * height - 15.0, size, shade(leaf, tone));
    }
}

/// Draw a painting: frame and canvas with a horizon.
pub fn painting(s: &mut Sketch<'_>) {
    let [w, h, _] = s.size();
    let [x, y, z] = s.spans();
    let frame = s.tint(0, s.choose(&[WOODS[3], DARK, rgb(210, 205, 195), WOODS[1]], WOODS[3]));
    let skies = [
        rgb(150, 185, 210),
        rgb(225, 190, 140),
        rgb(200, 200, 205),
        rgb(120, 140, 165),
        rgb(235, 215, 200),
        rgb(95, 110, 140),
        rgb(175, 200, 180),
    ];
    let grounds = [
        rgb(95, 120, 80),
        rgb(150, 95, 70),
        rgb(70, 90, 110),
        rgb(180, 160, 120),
        rgb(110, 80, 110),
    ];
    let bar = 0.07 * w.min(h);
    s.cuboid(x, y, between(z, 0.0, 0.7), frame);
    let (inner, canvas) = (inside(x, bar), inside(y, bar));
    let sky = s.choose(&skies, skies[0]).of(MaterialKind::PaintingTop);
    s.cuboid(inner, between(canvas, 0.4, 1.0), between(z, 0.7, 0.85), sky);
    let ground = s.choose(&grounds, grounds[0]).of(MaterialKind::PaintingBottom);
    s.cuboid(inner, between(canvas, 0.0, 0.4), between(z, 0.7, 0.85), ground);
    s.rim([x, y, between(z, 0.7, 1.0)], [0, 1], bar, frame);
}

/// Draw a window as an asset of its own.
pub fn window(s: &mut Sketch<'_>) {
    let [w, h, _] = s.size();
    let [x, y, z] = s.spans();
    let frame = s.tint(0, rgb(235, 235, 230));
    let bar = 0.07 * w.min(h);
    s.cuboid(
        inside(x, bar),
        inside(y, bar),
        between(z, 0.4, 0.6),
        rgb(190, 215, 235).of(MaterialKind::Outdoors),
    );
    s.rim([x, y, z], [0, 1], bar, frame);
}

/// Draw a door as an asset of its own: frame, and a closed leaf unless it is a bare frame.
pub fn doorway(s: &mut Sketch<'_>) {
    let [w, h, _] = s.size();
    let [x, y, z] = s.spans();
    let frame = s.tint(1, rgb(225, 220, 210));
    let bar = 0.05 * w.min(h);
    for x in ends(x, bar, 0.0) {
        s.cuboid(x, y, z, frame);
    }
    s.cuboid(inside(x, bar), [h - bar, h], z, frame);
    if s.asset().category == "Doorway" {
        s.cuboid(inside(x, bar), [0.0, h - bar], between(z, 0.35, 0.65), s.tint(0, WOODS[2]));
    }
}

/// Draw a plinth and a figure.
pub fn statue(s: &mut Sketch<'_>) {
    let [w, h, _] = s.size();
    let [x, y, z] = s.spans();
    let stone = s.tint(
        0,
        s.choose(&[rgb(190, 180, 160), rgb(120, 110, 100), rgb(160, 120, 60)], rgb(190, 180, 160)),
    );
    if w > h {
        // An animal has a body, a head and legs.
        s.cuboid_at([0.1, 0.8], [0.35, 0.75], [0.15, 0.85], stone);
        s.blob_at([0.65, 1.0], [0.5, 1.0], [0.1, 0.9], stone);
        for end in ends(between(x, 0.0, 0.8), 0.15 * w, 0.0) {
            s.cuboid(end, between(y, 0.0, 0.4), z, shade(stone, 0.9));
        }
        return;
    }
    s.column_at(ALL, [0.0, 0.12], ALL, 0.9, 8, shade(stone, 0.7));
    s.column_at([0.15, 0.85], [0.12, 0.75], [0.15, 0.85], 0.55, 8, stone);
    s.blob_at([0.28, 0.72], [0.72, 1.0], [0.28, 0.72], stone);
}

/// Draw a teddy bear: body, head, ears, arms and legs.
pub fn teddy_bear(s: &mut Sketch<'_>) {
    let w = s.size()[0];
    let [x, y, z] = s.spans();
    let fur = s.tint(0, rgb(150, 105, 65).of(MaterialKind::Fabric));
    s.blob_at([0.22, 0.78], [0.05, 0.62], [0.05, 0.7], fur);
    s.ellipsoid_at([0.27, 0.73], [0.52, 0.95], [0.05, 0.65], shade(fur, 1.1));
    for ear in [[0.22, 0.38], [0.62, 0.78]] {
        s.cuboid_at(ear, [0.86, 1.0], [0.3, 0.4], fur);
    }
    for side in ends(x, 0.3 * w, 0.0) {
        s.cuboid(side, between(y, 0.38, 0.5), between(z, 0.25, 0.5), fur);
        s.cuboid(inside(side, 0.05 * w), between(y, 0.0, 0.16), between(z, 0.4, 1.0), fur);
    }
    s.cuboid_at([0.4, 0.6], [0.1, 0.3], [0.0, 0.1], fur);
}

/// Draw a ball.
pub fn ball(s: &mut Sketch<'_>) {
    let skin = s.tint(0, rgb(205, 105, 45));
    s.ellipsoid_at(ALL, ALL, ALL, skin);
    // Black seams around it: discs as wide as the ball.
    let [x, y, z] = s.spans();
    let thin = |span: Span| between(span, 0.49, 0.51);
    let seam = rgb(30, 26, 24);
    s.trim(|s| {
        s.round(Along::X, 1.0, 16, [thin(x), y, z], seam);
        s.round(Along::Y, 1.0, 16, [x, thin(y), z], seam);
        for side in [[0.22, 0.24], [0.76, 0.78]] {
            let [y, x] = [y, x].map(|span| between(span, 0.06, 0.94));
            s.round(Along::Z, 1.0, 16, [x, y, between(z, side[0], side[1])], seam);
        }
    });
}

/// Draw two boots.
pub fn boots(s: &mut Sketch<'_>) {
    let leather = s.tint(0, rgb(75, 55, 40).of(MaterialKind::Leather));
    for foot in [[0.0, 0.45], [0.55, 1.0]] {
        s.cuboid_at(foot, [0.0, 0.22], ALL, leather);
        s.cuboid_at(foot, [0.22, 1.0], [0.0, 0.5], leather);
    }
}

/// Draw a bat: a long cone.
pub fn bat(s: &mut Sketch<'_>) {
    s.column_at(ALL, ALL, ALL, 0.45, 8, s.tint(0, WOODS[0]));
}

/// Draw a racket: head and handle along the box's longest side.
pub fn racket(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, y, z] = s.spans();
    let frame = s.tint(0, rgb(60, 90, 150));
    let (head, grip) = ([0.42, 1.0], [0.0, 0.45]);
    if h >= w && h >= d {
        s.round(Along::Z, 1.0, 12, [x, between(y, head[0], head[1]), z], frame);
        s.cuboid_at([0.45, 0.55], grip, [0.1, 0.9], DARK);
    } else if d >= w {
        s.column_at(ALL, ALL, head, 1.0, 12, frame);
        s.cuboid_at([0.45, 0.55], [0.1, 0.9], grip, DARK);
    } else {
        s.column_at(head, ALL, ALL, 1.0, 12, frame);
        s.cuboid_at(grip, [0.1, 0.9], [0.45, 0.55], DARK);
    }
}

/// Draw a dumbbell: two weights and a bar.
pub fn dumbbell(s: &mut Sketch<'_>) {
    let [w, _, d] = s.size();
    let [x, y, z] = s.spans();
    let iron = s.tint(0, DARK);
    if d >= w {
        for end in ends(z, 0.3 * d, 0.0) {
            s.round(Along::Z, 1.0, 8, [x, y, end], iron);
        }
        s.cuboid_at([0.4, 0.6], [0.4, 0.6], ALL, STEEL);
    } else {
        for end in ends(x, 0.3 * w, 0.0) {
            s.round(Along::X, 1.0, 8, [end, y, z], iron);
        }
        s.cuboid_at(ALL, [0.4, 0.6], [0.4, 0.6], STEEL);
    }
}

/// Draw a candle: wax and wick.
pub fn candle(s: &mut Sketch<'_>) {
    s.column_at(ALL, [0.0, 0.9], ALL, 1.0, 8, s.tint(0, rgb(235, 225, 195)));
    s.column_at([0.44, 0.56], [0.9, 1.0], [0.44, 0.56], 1.0, 4, DARK);
}

/// Draw books and other flat things: a block with a lighter core that shows at the edges.
pub fn slab(s: &mut Sketch<'_>) {
    let covers =
        [rgb(150, 55, 50), rgb(50, 80, 130), rgb(60, 110, 80), rgb(190, 150, 70), rgb(95, 65, 110)];
    let category = s.asset().category.as_str();
    let plain = match category {
        "Newspaper" => rgb(225, 222, 210),
        "DishSponge" => rgb(225, 195, 70),
        "SoapBar" => rgb(235, 220, 200),
        "KeyChain" => STEEL,
        "TableTopDecor" => WOODS[1],
        _ => s.choose(&covers, covers[0]),
    };
    let cover = if category == "Book" { s.choose(&covers, plain) } else { s.tint(0, plain) };
    if category != "Book" {
        let kind = if category == "Newspaper" { MaterialKind::Print } else { MaterialKind::Smooth };
        return s.block(cover.of(kind));
    }
    let cover = cover.of(MaterialKind::Cover);
    s.cuboid_at(ALL, [0.0, 0.12], ALL, cover);
    s.cuboid_at(
        [0.02, 0.97],
        [0.12, 0.88],
        [0.03, 0.97],
        rgb(235, 230, 215).of(MaterialKind::Pages),
    );
    s.cuboid_at(ALL, [0.88, 1.0], ALL, cover);
    s.cuboid_at([0.0, 0.04], ALL, ALL, shade(cover, 0.9));
    let [x, y, z] = s.spans();
    s.trim(|s| {
        // Pages between the covers on three sides, and a round spine.
        let pages = rgb(240, 236, 222).of(MaterialKind::Pages);
        s.cuboid(between(x, 0.02, 0.995), between(y, 0.14, 0.86), inside(z, 0.002), pages);
        let spine = [x[0], x[0] + 0.06 * (x[1] - x[0])];
        s.pad(spine, y, z, 0.01, shade(cover, 0.75).of(MaterialKind::Smooth));
    });
}
