//! Shapes of seats.

use crate::assets::{
    material::MaterialKind,
    shapes::{
        colour::{DARK, FABRICS, STEEL, WOODS, shade},
        sketch::{Along, Sketch, between, ends, inside, piece},
    },
};

/// Return the recorded height of the seat, or `otherwise`.
fn seat_height(s: &Sketch<'_>, otherwise: f64) -> f64 {
    let h = s.size()[1];
    let seat = s.levels().into_iter().find(|&y| y > 0.2 * h && y < 0.75 * h);
    seat.unwrap_or(otherwise)
}

/// Draw chairs and office chairs.
pub fn chair(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, _, z] = s.spans();
    let id = s.asset().id.to_ascii_lowercase();
    let seat = seat_height(s, (0.5 * h).min(0.5).max(0.25 * h));
    let wood = s.tint(0, s.choose(&WOODS, WOODS[2]));
    let is_office = id.contains("office") || id.contains("chair_313");
    let seat_kind = if is_office { MaterialKind::Fabric } else { MaterialKind::Wood };
    let cushion = s.tint(1, wood.of(seat_kind));
    let back = [z[0], z[0] + 0.09 * d];
    if is_office {
        let hub = 0.06 * w;
        s.cuboid(x, [0.02, 0.06], between(z, 0.46, 0.54), DARK);
        s.cuboid(between(x, 0.46, 0.54), [0.02, 0.06], z, DARK);
        s.column(between(x, 0.3, 0.7), [0.0, 0.03], between(z, 0.3, 0.7), 1.0, 8, DARK);
        s.pole([0.0, 0.0], hub, [0.06, seat - 0.06], 8, STEEL);
        s.cuboid(inside(x, 0.08 * w), [seat - 0.06, seat], between(z, 0.08, 0.95), cushion);
        s.cuboid(inside(x, 0.12 * w), [seat + 0.1, h], [z[0] + 0.02 * d, z[0] + 0.12 * d], cushion);
        s.cuboid(between(x, 0.46, 0.54), [seat - 0.05, seat + 0.2], back, DARK);
        s.trim(|s| {
            let padded = [z[0] + 0.02 * d, z[0] + 0.12 * d + 0.025];
            s.pad(inside(x, 0.12 * w), [seat + 0.1, h], padded, 0.02, cushion);
            let plump = [seat - 0.06, seat + 0.025];
            s.pad(inside(x, 0.07 * w), plump, between(z, 0.07, 0.96), 0.025, cushion);
        });
        s.detail("swivel base", 1);
        return;
    }
    let leg = (0.08 * w.min(d)).clamp(0.02, 0.045);
    s.legs([0.0, seat - 0.03], leg, 0.01, wood);
    s.cuboid(x, [seat - 0.04, seat], z, cushion);
    s.trim(|s| {
        s.pad(inside(x, 0.01), [seat - 0.01, seat + 0.025], inside(z, 0.01), 0.015, cushion)
    });
    let [left, right] = ends(x, leg, 0.0);
    s.cuboid(left, [seat, h], back, wood);
    s.cuboid(right, [seat, h], back, wood);
    let is_slatted = s.choose(&[true, false], true);
    let inner = inside(x, leg);
    if is_slatted {
        s.detail("slatted back", 1);
        let rise = h - seat;
        s.cuboid(inner, [h - 0.25 * rise, h], back, wood);
        s.cuboid(inner, [seat + 0.35 * rise, seat + 0.5 * rise], back, wood);
        s.trim(|s| {
            for i in 0..4 {
                let bar = between(piece(inner, i, 4), 0.4, 0.6);
                s.cuboid(bar, [seat, h], between(back, 0.3, 0.7), shade(wood, 0.9));
            }
        });
    } else {
        s.detail("solid back", 1);
        s.cuboid(inner, [seat + 0.15 * (h - seat), h], back, cushion);
        let tall = [seat + 0.18 * (h - seat), h - 0.02];
        s.trim(|s| s.pad(inner, tall, [back[1], back[1] + 0.02], 0.015, cushion));
    }
    s.trim(|s| {
        // Rungs between the legs, an apron under the seat and a top rail.
        for side in [left, right] {
            let rung = between(side, 0.25, 0.75);
            s.cuboid(rung, [0.38 * seat, 0.38 * seat + 0.02], inside(z, leg), shade(wood, 0.85));
        }
        let apron = [seat - 0.075, seat - 0.04];
        s.rim([inside(x, 0.012), apron, inside(z, 0.012)], [0, 2], 0.015, shade(wood, 0.8));
        s.pad(x, [h - 0.05, h], [back[0], back[1] + 0.01], 0.01, shade(wood, 1.1));
    });
    if w > 0.58 && h > 0.7 {
        s.detail("armrest", 2);
        let arm = seat + 0.45 * (h - seat);
        for side in [left, right] {
            s.cuboid(side, [arm - 0.03, arm], between(z, 0.05, 0.9), wood);
            s.cuboid(side, [seat, arm - 0.03], between(z, 0.8, 0.87), wood);
        }
    }
}

/// Draw a seat on legs without a back.
pub fn stool(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, _, z] = s.spans();
    let wood = s.tint(0, s.choose(&WOODS, WOODS[1]));
    let leg = (0.1 * w.min(d)).clamp(0.02, 0.04);
    if (w - d).abs() < 0.03 {
        s.form("round");
        s.column(x, [h - 0.05, h], z, 1.0, 12, s.tint(1, wood));
    } else {
        s.cuboid(x, [h - 0.05, h], z, s.tint(1, wood));
    }
    s.legs([0.0, h - 0.05], leg, 0.15 * w.min(d), wood);
    s.detail("leg", 4);
    let rung = inside(x, 0.15 * w.min(d));
    for z in ends(z, 0.02, 0.15 * w.min(d)) {
        s.cuboid(rung, [0.3 * h, 0.3 * h + 0.02], z, wood);
    }
}

/// Draw sofas and armchairs: base, back, arms, cushions.
pub fn sofa(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, _, z] = s.spans();
    let fabric = s.tint(0, s.choose(&FABRICS, FABRICS[0]));
    let soft = shade(fabric, 1.1).of(MaterialKind::Cushion);
    let is_sofa = w > 1.45;
    let seat = seat_height(s, (0.46 * h).min(0.48));
    let arm = (if is_sofa { 0.09 * w } else { 0.15 * w }).clamp(0.06, 0.24);
    let arm_top = (seat + 0.35 * (h - seat)).min(seat + 0.22);
    let back_depth = (0.26 * d).min(0.3).max(0.24 * d);
    let back = [z[0], z[0] + back_depth];
    let [left, right] = ends(x, arm, 0.0);
    let inner = inside(x, arm);
    let foot = (0.15 * seat).min(0.08);
    let feet = s.tint(1, WOODS[4]);
    s.legs([0.0, foot], 0.05, 0.03, feet);
    let pad = (0.3 * seat).min(0.14);
    let is_rolled = s.choose(&[true, false, true], true);
    // Only the arms fill the box: a recorded robot stood in the box, close to the cushions.
    let front = z[1] - 0.03;
    s.cuboid(inner, [foot, seat - pad], [back[1], front - 0.02], fabric);
    s.cuboid(inner, [foot, h], back, fabric);
    s.cuboid(left, [foot, arm_top], z, fabric);
    s.cuboid(right, [foot, arm_top], z, fabric);
    let count = (if is_sofa { (w / 0.8).round() } else { 1.0 }).clamp(1.0, 4.0) as usize;
    s.detail("seat cushion", count);
    s.detail("armrest", 2);
    s.trim(|s| {
        // Padded arms, a roll along the back, and shadows under and between the cushions.
        let padding = shade(fabric, 1.05);
        for arm_x in [[left[0], left[1] + 0.02], [right[0] - 0.02, right[1]]] {
            if is_rolled {
                // The roll is widest at the height of the arm, whose edges it covers.
                let rise = (0.4 * arm).min(0.06).min(h - arm_top);
                let roll = [arm_x, [arm_top - rise, arm_top + rise], z];
                s.round(Along::Z, 1.0, 16, roll, padding);
                let face = roll.map(|span| inside(span, 0.012));
                s.round(Along::Z, 1.0, 16, [face[0], face[1], z], shade(fabric, 0.85));
            } else {
                s.pad(arm_x, [arm_top - 0.07, arm_top + 0.035], z, 0.035, padding);
            }
        }
        s.pad(inner, [h - 0.09, h], [back[0], back[1] + 0.015], 0.03, padding);
        let dark = shade(fabric, 0.4);
        s.cuboid(inner, [seat - pad - 0.014, seat - pad], [back[1], front - 0.01], dark);
        s.cuboid(inner, [foot, foot + 0.012], [back[1], front - 0.015], dark);
        for i in 1..count {
            let seam = piece(inner, i, count)[0];
            let tall = [seat - pad, seat + 0.012];
            s.cuboid([seam - 0.007, seam + 0.007], tall, [back[1], front + 0.015], dark);
        }
        if !is_sofa {
            let lean = [seat, seat + 0.94 * (h - seat)];
            s.pad(inside(inner, 0.01), lean, [back[1], back[1] + 0.06], 0.04, soft);
        }
    });
    for i in 0..count {
        let cushion = inside(piece(inner, i, count), 0.006);
        s.cuboid(cushion, [seat - pad, seat], [back[1], front], soft);
        s.trim(|s| s.pad(cushion, [seat - pad, seat + 0.02], [back[1], front + 0.02], 0.03, soft));
        if is_sofa {
            let lean = [back[1], back[1] + 0.12 * d];
            let tall = [seat, seat + 0.75 * (h - seat)];
            s.cuboid(inside(cushion, 0.01), tall, lean, soft);
            s.trim(|s| {
                // They hide most of the back, which is a beam.
                let high = [seat, (seat + 0.93 * (h - seat)).max(tall[1])];
                s.pad(cushion, high, [lean[0], lean[1] + 0.035], 0.05, soft);
            });
        }
    }
}

/// Draw a padded block on feet.
pub fn ottoman(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, _, z] = s.spans();
    let fabric = s.tint(0, s.choose(&FABRICS, FABRICS[2]));
    let foot = (0.2 * h).min(0.12);
    s.legs([0.0, foot], (0.12 * w.min(d)).min(0.06), 0.03 * w, s.tint(1, WOODS[3]));
    s.cuboid(inside(x, 0.01), [foot, 0.6 * h], inside(z, 0.01), fabric);
    s.cuboid(x, [0.6 * h, h], z, shade(fabric, 1.1).of(MaterialKind::Cushion));
}
