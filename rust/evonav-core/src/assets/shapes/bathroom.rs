//! Shapes of bathroom fixtures, laundry machines and hanging textiles.

use std::f64::consts::FRAC_PI_2;

use crate::assets::{
    material::MaterialKind,
    shapes::{
        colour::{CERAMIC, DARK, FABRICS, STEEL, WOODS, rgb, shade},
        sketch::{ALL, Along, Motion, Sketch, between, ends, inside, piece},
    },
};

/// Draw a toilet: tank at the back, bowl in front, seat and open lid.
pub fn toilet(s: &mut Sketch<'_>) {
    let h = s.size()[1];
    let [x, _, z] = s.spans();
    let white = s.tint(0, CERAMIC);
    let rim = 0.42 * h;
    s.cuboid(x, [rim, h - 0.03], between(z, 0.0, 0.26), white);
    s.cuboid_at(ALL, [1.0 - 0.03 / h, 1.0], [0.0, 0.28], shade(white, 0.95));
    s.column(between(x, 0.25, 0.75), [0.0, 0.55 * rim], between(z, 0.05, 0.75), 0.85, 12, white);
    s.column(between(x, 0.12, 0.88), [0.5 * rim, rim - 0.03], between(z, 0.2, 1.0), 1.5, 12, white);
    let (seat, water) = ([rim - 0.03, rim], [rim, rim + 0.004]);
    s.column(between(x, 0.1, 0.9), seat, between(z, 0.22, 1.0), 1.0, 12, shade(white, 0.92));
    s.column(
        between(x, 0.22, 0.78),
        water,
        between(z, 0.34, 0.92),
        1.0,
        12,
        rgb(120, 150, 165).of(MaterialKind::Glass),
    );
    s.trim(|s| {
        // The tank with its lid and button, the rim of the seat and the foot.
        s.pad(x, [rim, h - 0.03], between(z, 0.0, 0.265), 0.02, white);
        s.pad(x, [h - 0.035, h], between(z, 0.0, 0.285), 0.012, shade(white, 0.97));
        let foot = [between(x, 0.22, 0.78), between(z, 0.1, 0.8)];
        s.column(foot[0], [0.0, 0.05], foot[1], 0.9, 16, white);
        // The inside of the bowl with the water, the gap under the seat and the lever.
        let hole = [between(x, 0.21, 0.79), between(z, 0.33, 0.93)];
        s.column(hole[0], [rim, rim + 0.006], hole[1], 1.0, 16, shade(white, 0.72));
        let pool = [between(x, 0.34, 0.66), between(z, 0.42, 0.74)];
        let water = rgb(135, 150, 158).of(MaterialKind::Glass);
        s.column(pool[0], [rim, rim + 0.008], pool[1], 1.0, 12, water);
        let bowl = [between(x, 0.12, 0.88), between(z, 0.2, 1.0)];
        let neck = [rim - 0.034, rim - 0.028];
        s.column(bowl[0], neck, bowl[1], 1.0, 24, shade(white, 0.45));
        // Rounder than the solid parts, which they enclose.
        s.column(bowl[0], [0.5 * rim, rim - 0.034], bowl[1], 1.5, 24, white);
        let seat = [between(x, 0.1, 0.9), between(z, 0.22, 1.0)];
        s.column(seat[0], [rim - 0.028, rim + 0.002], seat[1], 1.0, 24, shade(white, 0.95));
        let lever = [between(x, 0.1, 0.26), [h - 0.1, h - 0.075], between(z, 0.26, 0.285)];
        s.cuboid(lever[0], lever[1], lever[2], STEEL);
    });
    let pivot_m = [0.0, rim + 0.004, between(z, 0.28, 0.32)[1]];
    s.closing(Motion::Hinge { pivot_m, axis: Along::X, angle_rad: FRAC_PI_2 }, |s| {
        let lid = between(z, 0.28, 0.32);
        s.cuboid(between(x, 0.12, 0.88), [rim, 0.8 * h], lid, shade(white, 0.97));
        s.trim(|s| {
            // The lid is a rounded plate with a bright edge.
            let plate = [between(x, 0.12, 0.88), [rim, 0.8 * h], [lid[0], lid[1] + 0.008]];
            s.pad(plate[0], plate[1], plate[2], 0.008, white);
            let oval = [inside(plate[0], 0.03), inside(plate[1], 0.04), [lid[1], lid[1] + 0.012]];
            s.round(Along::Z, 0.94, 16, oval, shade(white, 0.9));
        });
    });
}

/// Draw a tub: bottom and four sides.
pub fn bathtub(s: &mut Sketch<'_>) {
    let h = s.size()[1];
    let [x, y, z] = s.spans();
    let white = s.tint(0, CERAMIC);
    let side = 0.07;
    s.cuboid(inside(x, side), [0.0, 0.25 * h], inside(z, side), shade(white, 0.93));
    s.rim([x, y, z], [0, 2], side, white);
}

/// Draw basins: set into counters (flat), or standing on a pedestal or a cabinet (tall).
pub fn sink(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, _, z] = s.spans();
    let white = s.tint(0, CERAMIC);
    // Recorded children lie on the rim; in tall sinks a tap or splashback may rise above it.
    let rim = s.levels().into_iter().find(|&y| y > 0.6 * h).unwrap_or(h);
    let basin = rim - (0.6 * rim).min(0.14);
    if h > 0.4 {
        if s.choose(&[true, false], true) {
            s.detail("pedestal", 1);
            s.column(between(x, 0.3, 0.7), [0.0, basin], between(z, 0.1, 0.6), 0.8, 12, white);
        } else {
            s.detail("cabinet door", 2);
            let wood = s.tint(1, s.choose(&WOODS, WOODS[1]));
            s.cuboid(inside(x, 0.03), [0.0, basin], [z[0], z[1] - 0.05], wood);
            for half in [between(x, 0.07, 0.49), between(x, 0.51, 0.93)] {
                s.cuboid(
                    half,
                    [0.08, basin - 0.05],
                    [z[1] - 0.05, z[1] - 0.03],
                    shade(wood, 1.15).of(MaterialKind::Panel),
                );
            }
        }
        s.cuboid(between(x, 0.46, 0.54), [rim, h], between(z, 0.02, 0.1), STEEL);
        s.cuboid(between(x, 0.47, 0.53), [h - 0.02, h], between(z, 0.02, 0.3), STEEL);
    }
    let side = 0.09 * w.min(d);
    let bottom = [basin, basin + 0.25 * (rim - basin)];
    s.cuboid(inside(x, side), bottom, inside(z, side), shade(white, 0.8));
    for x in ends(x, side, 0.0) {
        s.cuboid(x, [basin, rim], z, white);
    }
    let [back, front] = ends(z, side, 0.0);
    s.cuboid(inside(x, side), [basin, rim], [back[0], back[1] + 0.5 * side], white);
    s.cuboid(inside(x, side), [basin, rim], front, white);
    if rim >= h {
        s.cuboid(inside(x, side), [0.0, basin], inside(z, side), white);
    }
    let floor = bottom[1];
    s.trim(|s| {
        // The drain, and a soft lip around a basin that has room above it.
        let hole = (0.07 * w.min(d)).min(0.04);
        s.pole([0.0, 0.0], hole, [floor, floor + 0.004], 16, STEEL);
        s.pole([0.0, 0.0], 0.7 * hole, [floor, floor + 0.006], 16, DARK);
        if h <= 0.4 {
            return;
        }
        let lip = [rim - 0.02, rim + 0.012];
        for x in ends(x, side + 0.004, 0.0) {
            s.pad(x, lip, z, 0.012, white);
        }
        for z in [[back[0], back[1] + 0.5 * side], front] {
            s.pad(inside(x, side), lip, z, 0.012, white);
        }
    });
}

/// Draw a faucet: a base, a riser, a spout towards the front, and two handles if the box is wide.
pub fn faucet(s: &mut Sketch<'_>) {
    let w = s.size()[0];
    let [x, y, z] = s.spans();
    let metal = s.tint(0, STEEL);
    let thick = (0.5 * w).min(0.03) / w;
    let middle = between(x, 0.5 - 0.5 * thick, 0.5 + 0.5 * thick);
    s.cuboid_at(ALL, [0.0, 0.12], [0.0, 0.25], metal);
    s.cuboid(middle, between(y, 0.12, 1.0), between(z, 0.04, 0.18), metal);
    s.cuboid(middle, between(y, 0.85, 1.0), between(z, 0.18, 1.0), metal);
    s.cuboid(middle, between(y, 0.7, 0.85), between(z, 0.86, 1.0), metal);
    if w > 0.15 {
        s.detail("handle", 2);
        for end in ends(x, 0.04, 0.0) {
            s.cuboid(end, between(y, 0.12, 0.5), between(z, 0.02, 0.22), metal);
        }
    }
}

/// Draw a shower head: a rail on the wall, an arm and a rose.
pub fn shower_head(s: &mut Sketch<'_>) {
    let metal = s.tint(0, STEEL);
    s.cuboid_at([0.4, 0.6], ALL, [0.0, 0.12], metal);
    s.cuboid_at([0.42, 0.58], [0.96, 0.98], [0.12, 0.8], metal);
    s.column_at(ALL, [0.93, 0.96], [0.45, 1.0], 0.7, 12, metal);
    s.cuboid_at([0.3, 0.7], [0.3, 0.36], [0.0, 0.35], shade(metal, 0.8));
}

/// Draw a curtain: a rail with folds hanging from it.
pub fn curtain(s: &mut Sketch<'_>) {
    let cloth = s.tint(0, rgb(225, 228, 230).of(MaterialKind::Fabric));
    s.cuboid_at(ALL, [0.97, 1.0], [0.4, 0.6], STEEL);
    for i in 0..6 {
        let is_back = i % 2 == 0;
        let depth = if is_back { [0.0, 0.6] } else { [0.4, 1.0] };
        let colour = if is_back { cloth } else { shade(cloth, 0.9) };
        s.cuboid_at(piece(ALL, i, 6), [0.0, 0.97], depth, colour);
    }
}

/// Draw a hanging or lying cloth.
pub fn towel(s: &mut Sketch<'_>) {
    let [_, h, d] = s.size();
    let [x, y, z] = s.spans();
    let cloth = s
        .tint(
            0,
            s.choose(&[rgb(225, 225, 220), rgb(120, 150, 170), rgb(170, 110, 100)], FABRICS[5]),
        )
        .of(MaterialKind::Fabric);
    if h > d {
        s.cuboid_at(ALL, ALL, [0.55, 1.0], cloth);
        s.cuboid(inside(x, 0.005), between(y, 0.3, 1.0), between(z, 0.0, 0.45), shade(cloth, 0.9));
        s.cuboid_at(ALL, [0.96, 1.0], ALL, cloth);
    } else {
        s.cuboid_at(ALL, [0.0, 0.6], ALL, cloth);
        s.cuboid_at([0.1, 0.95], [0.6, 1.0], [0.08, 0.9], shade(cloth, 0.93));
    }
}

/// Draw a holder: a plate on the wall (-z) and a bar.
pub fn holder(s: &mut Sketch<'_>) {
    let w = s.size()[0];
    let [x, y, z] = s.spans();
    let metal = s.tint(0, STEEL);
    for end in ends(x, 0.12 * w, 0.0) {
        s.cuboid(end, y, between(z, 0.0, 0.2), metal);
        s.cuboid(end, between(y, 0.3, 0.7), between(z, 0.2, 1.0), metal);
    }
    s.cuboid(inside(x, 0.12 * w), between(y, 0.35, 0.65), between(z, 0.75, 1.0), metal);
}

/// Draw a stick with a cup or a brush at its foot.
pub fn brush(s: &mut Sketch<'_>) {
    let rubber = s.tint(1, rgb(150, 60, 50));
    s.column_at(ALL, [0.0, 0.25], ALL, 0.5, 12, rubber);
    s.column_at([0.42, 0.58], [0.25, 1.0], [0.42, 0.58], 1.0, 8, s.tint(0, WOODS[0]));
}

/// Draw a washing machine: a white box with a round door and a panel.
pub fn washer(s: &mut Sketch<'_>) {
    let [x, y, z] = s.spans();
    let white = s.tint(0, rgb(232, 233, 235).of(MaterialKind::Ceramic));
    let front = z[1] - 0.04;
    s.cuboid(x, between(y, 0.0, 0.9), [z[0], front], white);
    s.cuboid_at(ALL, [0.9, 1.0], [0.0, 0.25], shade(white, 0.85));
    let panel = [front, front + 0.01];
    s.cuboid(between(x, 0.04, 0.96), between(y, 0.76, 0.88), panel, shade(white, 0.75));
    s.detail("round door", 1);
    let pivot_m = [between(x, 0.2, 0.8)[0], 0.0, front];
    s.opening(Motion::Hinge { pivot_m, axis: Along::Y, angle_rad: -FRAC_PI_2 }, |s| {
        let door = [between(x, 0.2, 0.8), between(y, 0.2, 0.72), [front, z[1] - 0.01]];
        s.round(Along::Z, 1.0, 16, door, STEEL);
        let glass = [between(x, 0.28, 0.72), between(y, 0.27, 0.65), [z[1] - 0.01, z[1]]];
        s.round(Along::Z, 1.0, 16, glass, DARK.of(MaterialKind::Glass));
    });
    if s.is_ajar() {
        let drum = [between(x, 0.24, 0.76), between(y, 0.24, 0.68), [front, front + 0.001]];
        s.round(Along::Z, 1.0, 16, drum, DARK);
    }
}
