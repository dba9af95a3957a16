//! Shapes of bins, boxes, bottles, cups and other vessels.

use std::f64::consts::FRAC_PI_2;

use crate::assets::{
    material::MaterialKind,
    shapes::{
        colour::{CERAMIC, DARK, STEEL, rgb, shade},
        sketch::{ALL, Along, Motion, Sketch, between, ends, inside},
    },
};

/// Draw an open bin: four sides (or a round wall where the box is square) and a dark inside.
pub fn bin(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, y, z] = s.spans();
    let plastic = s.tint(
        0,
        s.choose(&[rgb(110, 112, 115), rgb(70, 85, 80), rgb(60, 62, 66), rgb(180, 175, 165)], DARK),
    );
    let floor = s.levels().first().copied().unwrap_or(0.04 * h).min(0.6 * h);
    if (w - d).abs() < 0.02 {
        s.form("round");
        s.column_at(ALL, [0.0, 0.97], ALL, 1.12, 12, plastic);
        s.column_at([0.06, 0.94], [0.97, 1.0], [0.06, 0.94], 1.0, 12, shade(plastic, 0.5));
        return;
    }
    let wall = 0.06 * w.min(d);
    s.cuboid(inside(x, wall), [0.0, floor], inside(z, wall), shade(plastic, 0.6));
    s.rim([x, y, z], [0, 2], wall, plastic);
}

/// Draw a full bag with a knot.
pub fn bag(s: &mut Sketch<'_>) {
    let plastic = s.tint(0, rgb(40, 42, 46));
    s.ellipsoid_at(ALL, [0.0, 0.85], ALL, plastic);
    s.column_at([0.4, 0.6], [0.78, 1.0], [0.4, 0.6], 1.6, 6, shade(plastic, 1.4));
}

/// Draw an open cardboard box, with two flaps if its openness is known.
pub fn open_box(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, y, z] = s.spans();
    let card = s.tint(0, rgb(176, 132, 86).of(MaterialKind::Paper));
    let wall = (0.03 * w.min(d)).min(0.012);
    s.cuboid(inside(x, wall), [0.0, 0.04 * h], inside(z, wall), shade(card, 0.8));
    let flap = if s.condition().openness.is_some() { (0.5 * d).min(0.4 * h) } else { 0.0 };
    let y = [y[0], y[1] - flap];
    for x in ends(x, wall, 0.0) {
        s.cuboid(x, y, z, card);
    }
    for (z, side) in ends(z, wall, 0.0).into_iter().zip([-1.0, 1.0]) {
        s.cuboid(inside(x, wall), y, z, shade(card, 0.93));
        let pivot_m = [0.0, y[1], if side > 0.0 { z[1] } else { z[0] }];
        let motion = Motion::Hinge { pivot_m, axis: Along::X, angle_rad: -side * FRAC_PI_2 };
        s.closing(motion, |s| s.cuboid(x, [y[1], y[1] + flap], z, shade(card, 1.05)));
    }
}

/// Draw a bottle: body, shoulder, neck and cap.
pub fn bottle(s: &mut Sketch<'_>) {
    let glasses = [
        rgb(60, 100, 70),
        rgb(190, 205, 215),
        rgb(120, 70, 45),
        rgb(210, 160, 90),
        rgb(130, 160, 190),
    ];
    let glass = s.tint(0, s.choose(&glasses, glasses[0]).of(MaterialKind::Glass));
    let is_pump = matches!(s.asset().category.as_str(), "SoapBottle" | "SprayBottle");
    s.column_at(ALL, [0.0, 0.58], ALL, 1.0, 10, glass);
    s.column_at(ALL, [0.58, 0.74], ALL, 0.4, 10, glass);
    s.column_at([0.32, 0.68], [0.74, 0.9], [0.32, 0.68], 1.0, 8, glass);
    let cap = if is_pump { rgb(230, 230, 230) } else { shade(glass, 0.5) };
    s.column_at([0.28, 0.72], [0.9, 1.0], [0.28, 0.72], 1.0, 8, cap);
    if is_pump {
        s.detail("pump", 1);
        s.cuboid_at([0.42, 0.58], [0.94, 1.0], [0.5, 1.0], cap);
    }
}

/// Draw a shaker: a body and a perforated cap.
pub fn shaker(s: &mut Sketch<'_>) {
    let is_salt = s.asset().category == "SaltShaker";
    let body = if is_salt { rgb(235, 235, 230) } else { rgb(70, 55, 50) };
    s.column_at(ALL, [0.0, 0.78], ALL, 0.85, 8, s.tint(0, body));
    s.column_at([0.1, 0.9], [0.78, 1.0], [0.1, 0.9], 0.7, 8, STEEL);
}

/// Draw a cup with dark content, and a handle if the box is longer in one direction.
pub fn mug(s: &mut Sketch<'_>) {
    let [w, _, d] = s.size();
    let [x, y, z] = s.spans();
    let colours =
        [CERAMIC, rgb(180, 70, 60), rgb(70, 100, 140), rgb(95, 125, 95), rgb(215, 180, 110)];
    let glaze = s.tint(0, s.choose(&colours, CERAMIC));
    let long = w.max(d);
    let body = (w.min(d) / long).max(0.6);
    let (x_body, z_body) =
        if w >= d { (between(x, 0.0, body), z) } else { (x, between(z, 0.0, body)) };
    s.column(x_body, between(y, 0.0, 0.97), z_body, 1.1, 10, glaze);
    let inner = |span: [f64; 2]| between(span, 0.1, 0.9);
    s.column(inner(x_body), between(y, 0.97, 1.0), inner(z_body), 1.0, 10, rgb(85, 60, 45));
    if body < 0.92 {
        s.detail("handle", 1);
        let (x, z) = if w >= d {
            ([x_body[1] - 0.005, x[1]], between(z, 0.42, 0.58))
        } else {
            (between(x, 0.42, 0.58), [z_body[1] - 0.005, z[1]])
        };
        s.cuboid(x, between(y, 0.25, 0.75), z, glaze);
    }
}

/// Draw a bowl: a wide cone standing on its narrow end.
pub fn bowl(s: &mut Sketch<'_>) {
    let glaze = s.tint(0, s.choose(&[CERAMIC, rgb(150, 180, 190), rgb(200, 150, 110)], CERAMIC));
    s.column_at(ALL, [0.0, 0.96], ALL, 2.0, 12, glaze);
    s.column_at([0.06, 0.94], [0.96, 1.0], [0.06, 0.94], 1.0, 12, shade(glaze, 0.75));
}

/// Draw a plate: a flat disc with a rim.
pub fn plate(s: &mut Sketch<'_>) {
    let glaze = s.tint(0, s.choose(&[CERAMIC, rgb(190, 205, 215), rgb(225, 205, 180)], CERAMIC));
    s.column_at(ALL, [0.0, 0.9], ALL, 1.5, 12, glaze);
    s.column_at([0.15, 0.85], [0.9, 1.0], [0.15, 0.85], 1.0, 12, shade(glaze, 0.88));
}

/// Draw a vase: foot, belly and neck.
pub fn vase(s: &mut Sketch<'_>) {
    let glazes = [
        rgb(110, 150, 165),
        rgb(190, 120, 90),
        rgb(220, 215, 205),
        rgb(90, 80, 110),
        rgb(70, 70, 72),
    ];
    let glaze = s.tint(0, s.choose(&glazes, glazes[0]).of(MaterialKind::Ceramic));
    s.column_at(ALL, [0.0, 0.45], ALL, 1.7, 10, glaze);
    s.column_at(ALL, [0.45, 0.82], ALL, 0.45, 10, glaze);
    s.column_at([0.22, 0.78], [0.82, 1.0], [0.22, 0.78], 1.3, 10, shade(glaze, 1.1));
}

/// Draw a box with a tissue standing out.
pub fn tissue_box(s: &mut Sketch<'_>) {
    s.cuboid_at(ALL, [0.0, 0.7], ALL, s.tint(0, rgb(140, 170, 190)));
    s.column_at(
        [0.35, 0.65],
        [0.7, 1.0],
        [0.35, 0.65],
        0.3,
        6,
        rgb(245, 245, 245).of(MaterialKind::Paper),
    );
}

/// Draw a roll along its longest side, with its core.
pub fn roll(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let spans = s.spans();
    let paper = s.tint(
        0,
        if s.asset().category == "AluminumFoil" {
            STEEL
        } else {
            rgb(242, 240, 235).of(MaterialKind::Paper)
        },
    );
    let along = if h >= w && h >= d {
        Along::Y
    } else if w >= d {
        Along::X
    } else {
        Along::Z
    };
    s.round(along, 1.0, 12, spans, paper);
}
