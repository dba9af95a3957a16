//! Shapes of beds and of objects on them.

use crate::assets::{
    material::MaterialKind,
    shapes::{
        colour::{FABRICS, Paint, WOODS, liveliest, rgb, shade},
        sketch::{ALL, Sketch, Span, between, ends, inside, piece},
    },
};

const LINEN: [Paint; 6] = [
    rgb(90, 120, 160),
    rgb(190, 185, 175),
    rgb(150, 90, 90),
    rgb(110, 135, 115),
    rgb(225, 220, 212),
    rgb(70, 80, 105),
];

/// Draw a bed: frame, mattress, blanket, pillows and headboard; above 1.5 m a bunk or canopy bed on
/// four posts.
pub fn bed(s: &mut Sketch<'_>) {
    let [w, h, _] = s.size();
    let [x, _, z] = s.spans();
    let wood = s.tint(0, s.choose(&WOODS, WOODS[2]));
    let linen = liveliest(s.asset(), s.choose(&LINEN, LINEN[0]));
    let levels = s.levels();
    let is_tall = h > 1.5;
    let lying = levels.iter().copied().find(|&y| y > 0.2 && y < 0.9);
    let mattress = lying.unwrap_or((0.62 * h).min(0.55)).min(h);
    let head = if is_tall { (mattress + 0.4).min(h) } else { h };
    let foot = mattress.min(mattress - 0.04 + 0.08 * h).min(h);
    let board = 0.05;
    let [head_z, foot_z] = ends(z, board, 0.0);
    if head - mattress > 0.15 {
        s.detail("headboard", 1);
    }
    s.detail("pillow", if x[1] - x[0] > 1.25 { 2 } else { 1 });
    s.cuboid(x, [0.0, head], head_z, wood);
    s.cuboid(x, [0.0, foot], foot_z, wood);
    s.trim(|s| {
        // A raised panel in the headboard.
        let panel = [head_z[1] - 0.01, head_z[1] + 0.012];
        let y = [mattress + 0.04, head - 0.05];
        if y[1] - y[0] > 0.1 {
            s.pad(inside(x, 0.07), y, panel, 0.01, shade(wood, 1.12));
        }
        s.pad(x, [head - 0.035, head], [head_z[0], head_z[1] + 0.012], 0.01, shade(wood, 0.85));
    });
    bunk(s, [wood, linen], mattress, x);
    if is_tall {
        s.detail("tall post", 4);
        s.legs([0.0, h], 0.06, 0.0, wood);
        let upper = levels.iter().copied().find(|&y| y > 1.0 && y < h);
        if let Some(y) = upper.filter(|_| w < 1.4) {
            bunk(s, [wood, linen], y, x);
        }
        for rail in ends(x, 0.05, 0.0) {
            s.cuboid(rail, [h - 0.06, h], z, wood);
        }
    }
}

/// Draw one level of a bunk: slats, mattress, blanket and pillows.
fn bunk(s: &mut Sketch<'_>, [wood, linen]: [Paint; 2], top: f64, x: Span) {
    let z = s.spans()[2];
    let length = inside(z, 0.05);
    let depth = (0.55 * top).min(0.26);
    s.cuboid(x, [(top - depth - 0.08).max(0.02), top - 0.7 * depth], length, wood);
    let blanket = between(length, 0.3, 1.0);
    s.cuboid(
        inside(x, 0.02),
        [top - 0.7 * depth, top - 0.012],
        length,
        rgb(235, 232, 225).of(MaterialKind::Pillow),
    );
    s.cuboid(inside(x, 0.008), [top - 0.6 * depth, top], blanket, linen.of(MaterialKind::Duvet));
    let width = x[1] - x[0];
    let pillows = if width > 1.25 { 2 } else { 1 };
    let linen_white = rgb(245, 243, 238).of(MaterialKind::Pillow);
    for i in 0..pillows {
        let side = inside(piece(x, i, pillows), 0.08 * width);
        let along = between(length, 0.03, 0.2);
        s.cuboid(side, [top - 0.012, top + 0.07], along, linen_white);
        s.trim(|s| {
            // A plump body with a round top.
            let plump = [inside(side, -0.015), [top - 0.01, top + 0.095], inside(along, -0.025)];
            s.pad(plump[0], plump[1], plump[2], 0.045, linen_white);
            let crown = [inside(side, 0.02), [top + 0.01, top + 0.14], inside(along, 0.01)];
            s.ellipsoid(crown[0], crown[1], crown[2], linen_white);
        });
    }
    s.trim(|s| {
        // The duvet, its turned edge and the shadow of that: each wider than the one below it, so
        // that their sides do not lie in one plane.
        let duvet = linen.of(MaterialKind::Duvet);
        let [over, fold] = [[top - 0.62 * depth, top + 0.035], [top - 0.52 * depth, top + 0.06]];
        s.pad(inside(x, 0.005), over, blanket, 0.03, duvet);
        let below = [over[0] + 0.01, top + 0.045];
        s.pad(inside(x, 0.003), below, between(length, 0.385, 0.41), 0.02, shade(linen, 0.75));
        let turned = rgb(240, 238, 232).of(MaterialKind::Pillow);
        s.pad(x, fold, between(length, 0.265, 0.39), 0.028, turned);
        // The shadow under the mattress.
        let shadow = [top - 0.7 * depth, top - 0.7 * depth + 0.006];
        s.cuboid(x, shadow, length, shade(wood, 0.4));
    });
}

/// Draw a dog bed: a cushion with a raised rim.
pub fn dog_bed(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, y, z] = s.spans();
    let fabric = s.tint(0, s.choose(&FABRICS, FABRICS[2]));
    let rim = 0.15 * w.min(d);
    if (w - d).abs() < 0.03 {
        s.form("round");
        // Dog beds are round: recorded agents stand in the corners of their boxes.
        s.column(x, [0.0, 0.7 * h], z, 1.0, 16, fabric);
        let [x, z] = [x, z].map(|span| inside(span, 0.5 * rim));
        s.column(x, [0.7 * h, h], z, 1.0, 16, shade(fabric, 1.2));
        return;
    }
    s.cuboid(inside(x, 0.5 * rim), [0.0, 0.5 * h], inside(z, 0.5 * rim), shade(fabric, 1.2));
    for x in ends(x, rim, 0.0) {
        s.cuboid(x, y, z, fabric);
    }
    s.cuboid(inside(x, rim), y, ends(z, rim, 0.0)[0], fabric);
    s.cuboid(inside(x, rim), [0.0, 0.7 * h], ends(z, rim, 0.0)[1], fabric);
    s.trim(|s| {
        let cushion = [inside(x, 0.9 * rim), [0.0, 0.62 * h], inside(z, 0.9 * rim)];
        s.pad(cushion[0], cushion[1], cushion[2], 0.1 * h, shade(fabric, 1.25));
    });
}

/// Draw a pillow that is thick in the middle.
pub fn pillow(s: &mut Sketch<'_>) {
    let fabric = s.tint(0, s.choose(&FABRICS, FABRICS[5])).of(MaterialKind::Cushion);
    s.cuboid_at(ALL, [0.2, 0.75], ALL, fabric);
    s.cuboid_at([0.05, 0.95], ALL, [0.05, 0.95], shade(fabric, 1.04));
    let [x, y, z] = s.spans();
    let [w, h, d] = s.size();
    s.trim(|s| {
        // One soft body in place of steps: its cut edges touch the edges of the upper one.
        s.pad(x, y, z, (0.05 * w.min(d)).min(0.25 * h), fabric);
    });
}
