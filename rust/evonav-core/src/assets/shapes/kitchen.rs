//! Shapes of counters, the fridge, appliances and cookware.

use std::f64::consts::FRAC_PI_2;

use crate::assets::{
    material::MaterialKind,
    shapes::{
        colour::{DARK, Paint, STEEL, WOODS, rgb, shade},
        sketch::{ALL, Along, Motion, Sketch, Span, between, ends, inside, piece},
    },
};

/// Paint of the inside of open objects.
const INSIDE: Paint = rgb(48, 46, 44);

/// Depth of ProcTHOR's counters and of each wing of its corner counters.
const COUNTER_DEPTH_M: f64 = 0.61;

/// Draw counters. `Countertop_L_*` have a wing along the back (-z) and one along +x,
/// `Countertop_C_*` wings along the back and both sides; the rest is free floor. This was measured
/// on the objects that stand on them.
pub fn counter(s: &mut Sketch<'_>) {
    let [w, _, d] = s.size();
    let [x, _, z] = s.spans();
    let id = s.asset().id.as_str();
    let (is_l, is_c) = (id.starts_with("Countertop_L_"), id.starts_with("Countertop_C_"));
    let depth = COUNTER_DEPTH_M;
    let back = [z[0], (z[0] + depth).min(z[1])];
    let front = [back[1], z[1]];
    if is_l && w > depth && d > depth {
        s.form("L-shaped");
        cabinets(s, x, back, Face::Front([x[0], x[1] - depth]));
        cabinets(s, [x[1] - depth, x[1]], front, Face::Left);
    } else if is_c && w > 2.0 * depth && d > depth {
        s.form("U-shaped");
        cabinets(s, x, back, Face::Front(inside(x, depth)));
        cabinets(s, [x[0], x[0] + depth], front, Face::Right);
        cabinets(s, [x[1] - depth, x[1]], front, Face::Left);
    } else {
        cabinets(s, x, z, Face::Front(x));
    }
}

/// The side of a run of cabinets that has the doors.
#[derive(Clone, Copy)]
enum Face {
    /// The front (+z), along this part of x.
    Front(Span),
    /// The left (-x).
    Left,
    /// The right (+x).
    Right,
}

/// Draw a run of cabinets: plinth, carcass, doors and worktop.
fn cabinets(s: &mut Sketch<'_>, x: Span, z: Span, face: Face) {
    let h = s.size()[1];
    let wood = s
        .tint(0, s.choose(&[rgb(225, 220, 210), WOODS[1], rgb(120, 130, 135), WOODS[2]], WOODS[1]));
    let stone = s.tint(
        1,
        s.choose(&[rgb(95, 95, 98), rgb(200, 195, 188), rgb(70, 66, 64)], rgb(95, 95, 98)),
    );
    let stone = stone.of(MaterialKind::Granite);
    let (plinth, worktop) = (0.1 * h, h - 0.04);
    s.cuboid(inside(x, 0.03), [0.0, plinth], inside(z, 0.03), shade(wood, 0.4));
    s.cuboid(inside(x, 0.015), [plinth, worktop], inside(z, 0.015), wood);
    s.cuboid(x, [worktop, h], z, stone);
    let door: Paint = shade(wood, 1.1).of(MaterialKind::Panel);
    let y = [plinth + 0.01, worktop - 0.01];
    let run = match face {
        Face::Front(run) => run,
        Face::Left | Face::Right => z,
    };
    let count = ((run[1] - run[0]) / 0.6).round().clamp(1.0, 5.0) as usize;
    for i in 0..count {
        let span = inside(piece(run, i, count), 0.015);
        match face {
            Face::Front(_) => s.cuboid(span, y, [z[1] - 0.015, z[1] - 0.005], door),
            Face::Left => s.cuboid([x[0] + 0.005, x[0] + 0.015], y, span, door),
            Face::Right => s.cuboid([x[1] - 0.015, x[1] - 0.005], y, span, door),
        }
        s.trim(|s| drawer_over_door(s, [x, z], face, span, y, door));
    }
}

/// Draw a drawer's front over the upper part of a door, the gap below it, and a handle on each.
fn drawer_over_door(
    s: &mut Sketch<'_>,
    [x, z]: [Span; 2],
    face: Face,
    span: Span,
    y: Span,
    door: Paint,
) {
    // Draw a plate between two distances behind the front edge of the worktop.
    let plate =
        |s: &mut Sketch<'_>, along: Span, y: Span, [near, far]: Span, paint: Paint| match face {
            Face::Front(_) => s.cuboid(along, y, [z[1] - far, z[1] - near], paint),
            Face::Left => s.cuboid([x[0] + near, x[0] + far], y, along, paint),
            Face::Right => s.cuboid([x[1] - far, x[1] - near], y, along, paint),
        };
    let (split, grip) = (between(y, 0.0, 0.77)[1], STEEL);
    plate(s, span, [split, y[1]], [0.003, 0.015], door.of(MaterialKind::Drawer));
    plate(
        s,
        span,
        [split - 0.012, split],
        [0.0045, 0.015],
        shade(door, 0.3).of(MaterialKind::Smooth),
    );
    let middle = 0.5 * (split + y[1]);
    plate(s, between(span, 0.3, 0.7), [middle - 0.009, middle + 0.009], [0.0, 0.004], grip);
    let upright = [split - 0.2, split - 0.05];
    plate(s, between(span, 0.86, 0.9), upright, [0.0, 0.006], grip);
}

/// Draw a fridge: a shell with shelves, closed by two doors over each other.
pub fn fridge(s: &mut Sketch<'_>) {
    let [w, h, _] = s.size();
    let [x, _, z] = s.spans();
    let steel =
        s.tint(0, s.choose(&[rgb(215, 217, 220), rgb(235, 235, 232), rgb(160, 163, 167)], STEEL));
    let door = shade(steel, 1.06).of(MaterialKind::Appliance);
    let grip = shade(steel, 0.55).of(MaterialKind::Metal);
    let metal = s.tint(2, grip).of(MaterialKind::Metal);
    let (body, inner) = ([z[0], z[1] - 0.11], shade(steel, 0.9));
    let wall = 0.05;
    for side in ends(x, wall, 0.0) {
        s.cuboid(side, [0.0, h], body, inner);
    }
    let width = inside(x, wall);
    s.cuboid(width, [0.0, h], [z[0], z[0] + wall], inner);
    let levels = s.levels();
    let lowest = levels.first().copied().unwrap_or(0.1).min(0.3);
    s.cuboid(width, [0.0, lowest], body, inner);
    s.cuboid(width, [h - wall, h], body, inner);
    for level in levels.into_iter().filter(|&y| y > lowest + 0.05 && y < h - 0.15) {
        s.cuboid(width, [level - 0.01, level], body, rgb(215, 225, 230));
    }
    let split = 0.68 * h;
    s.detail("door", 2);
    s.trim(|s| {
        // The gap between the doors, and the grille under them.
        s.cuboid(
            x,
            [split - 0.014, split + 0.014],
            [z[1] - 0.112, z[1] - 0.058],
            shade(steel, 0.2),
        );
        s.cuboid(inside(x, 0.02), [0.0, 0.05], [z[1] - 0.11, z[1] - 0.08], shade(steel, 0.25));
        // The gasket around each door, and the covers of the hinges.
        s.cuboid(
            inside(x, 0.003),
            [0.04, h - 0.012],
            [z[1] - 0.111, z[1] - 0.098],
            shade(steel, 0.2),
        );
        let hinge = [z[1] - 0.17, z[1] - 0.05];
        s.pad(between(x, 0.88, 0.97), [h - 0.03, h], hinge, 0.008, shade(steel, 0.5));
    });
    for (is_upper, y) in [(false, [0.05, split - 0.005]), (true, [split + 0.005, h - 0.01])] {
        let pivot_m = [x[1], 0.0, z[1] - 0.06];
        s.opening(Motion::Hinge { pivot_m, axis: Along::Y, angle_rad: FRAC_PI_2 }, |s| {
            s.cuboid(x, y, [z[1] - 0.105, z[1] - 0.06], door);
            let reach = 0.35 * (y[1] - y[0]);
            let low = if is_upper { y[0] + 0.05 } else { y[1] - 0.05 - reach };
            let handle = [x[0] + 0.06 * w, x[0] + 0.06 * w + 0.03];
            s.cuboid(handle, [low, low + reach], [z[1] - 0.06, z[1]], grip);
            s.trim(|s| {
                // A door with round edges, that stand back to its front at the gasket.
                s.pad(x, inside(y, 0.006), [z[1] - 0.1, z[1] - 0.036], 0.024, door);
                // A round bar on two brackets.
                for end in ends([low, low + reach], 0.04, 0.0) {
                    let wide = inside(handle, -0.002);
                    s.cuboid(wide, end, [z[1] - 0.058, z[1]], shade(metal, 0.7));
                }
                let bar = [inside(handle, -0.004), [low, low + reach], [z[1] - 0.03, z[1]]];
                s.column(bar[0], bar[1], bar[2], 1.0, 12, shade(metal, 1.15));
                let core = [z[1] - 0.058, z[1] - 0.015];
                s.cuboid(inside(handle, -0.001), bar[1], core, metal);
                if is_upper {
                    // The maker's badge.
                    let badge = [between(x, 0.42, 0.58), between(y, 0.82, 0.87)];
                    s.cuboid(badge[0], badge[1], [z[1] - 0.037, z[1] - 0.033], STEEL);
                }
            });
        });
    }
}

/// Draw a microwave: body, dark window, panel.
pub fn microwave(s: &mut Sketch<'_>) {
    let [x, y, z] = s.spans();
    let body =
        s.tint(0, s.choose(&[rgb(200, 200, 202), rgb(60, 60, 64), rgb(230, 230, 228)], STEEL));
    s.cuboid(x, y, [z[0], z[1] - 0.03], body);
    let front = [z[1] - 0.03, z[1] - 0.015];
    let pivot_m = [x[0], 0.0, z[1] - 0.03];
    s.opening(Motion::Hinge { pivot_m, axis: Along::Y, angle_rad: -FRAC_PI_2 }, |s| {
        s.cuboid(
            between(x, 0.03, 0.74),
            between(y, 0.08, 0.92),
            front,
            DARK.of(MaterialKind::OvenDoor),
        );
    });
    s.cuboid(between(x, 0.77, 0.98), between(y, 0.08, 0.92), front, shade(body, 0.7));
    s.opening(Motion::Hinge { pivot_m, axis: Along::Y, angle_rad: -FRAC_PI_2 }, |s| {
        s.cuboid(between(x, 0.7, 0.73), between(y, 0.15, 0.85), [z[1] - 0.03, z[1]], STEEL);
    });
    if s.is_ajar() {
        let hollow = [between(x, 0.06, 0.72), between(y, 0.12, 0.88)];
        s.cuboid(hollow[0], hollow[1], [z[1] - 0.03, z[1] - 0.029], INSIDE);
    }
}

/// Draw a coffee machine: back column, head, drip tray and pot.
pub fn coffee_machine(s: &mut Sketch<'_>) {
    let body = s.tint(0, s.choose(&[DARK, rgb(150, 40, 40), rgb(180, 182, 185)], DARK));
    s.cuboid_at(ALL, ALL, [0.0, 0.45], body);
    s.cuboid_at([0.05, 0.95], [0.72, 1.0], [0.45, 1.0], body);
    s.cuboid_at(ALL, [0.0, 0.08], [0.45, 1.0], shade(body, 1.3));
    s.column_at(
        [0.28, 0.72],
        [0.08, 0.5],
        [0.5, 0.92],
        0.8,
        8,
        rgb(70, 50, 40).of(MaterialKind::Glass),
    );
}

/// Draw a toaster: body, two slots and a lever.
pub fn toaster(s: &mut Sketch<'_>) {
    let body = s.tint(0, s.choose(&[STEEL, rgb(190, 60, 55), rgb(235, 230, 220), DARK], STEEL));
    s.cuboid_at(ALL, [0.0, 0.96], [0.0, 0.94], body);
    for slot in [[0.2, 0.4], [0.6, 0.8]] {
        s.cuboid_at(slot, [0.95, 1.0], [0.12, 0.82], DARK);
    }
    s.cuboid_at([0.42, 0.58], [0.55, 0.65], [0.94, 1.0], DARK);
}

/// Draw a pan: a shallow dish with a long handle along the box's longer side.
pub fn pan(s: &mut Sketch<'_>) {
    let [w, _, d] = s.size();
    let [x, y, z] = s.spans();
    let metal = s.tint(0, DARK.of(MaterialKind::Metal));
    let handle = shade(metal, 0.7);
    let (rim, grip) = (between(y, 0.0, 0.7), between(y, 0.55, 1.0));
    s.detail("long handle", 1);
    if d >= w {
        let dish = [z[0], z[0] + w.min(d)];
        s.column(x, rim, dish, 1.15, 12, metal);
        s.cuboid(between(x, 0.44, 0.56), grip, [dish[1] - 0.02, z[1]], handle);
    } else {
        let dish = [x[0], x[0] + d];
        s.column(dish, rim, z, 1.15, 12, metal);
        s.cuboid([dish[1] - 0.02, x[1]], grip, between(z, 0.44, 0.56), handle);
    }
}

/// Draw a pot: a deep round vessel with two ears and a lid.
pub fn pot(s: &mut Sketch<'_>) {
    let [w, _, d] = s.size();
    let [x, y, z] = s.spans();
    let metal = s.tint(0, s.choose(&[STEEL, rgb(160, 60, 50), DARK], STEEL));
    let (long, body) = if d >= w { (z, w / d) } else { (x, d / w) };
    let middle = between(long, 0.5 - 0.5 * body.clamp(0.5, 1.0), 0.5 + 0.5 * body.clamp(0.5, 1.0));
    let ears = [0.55, 0.68];
    s.detail("handle", 2);
    if d >= w {
        s.column(x, between(y, 0.0, 0.9), middle, 1.0, 12, metal);
        s.cuboid_at([0.35, 0.65], ears, ALL, shade(metal, 0.5));
        s.column_at([0.4, 0.6], [0.9, 1.0], [0.45, 0.55], 1.0, 8, DARK);
    } else {
        s.column(middle, between(y, 0.0, 0.9), z, 1.0, 12, metal);
        s.cuboid_at(ALL, ears, [0.35, 0.65], shade(metal, 0.5));
        s.column_at([0.45, 0.55], [0.9, 1.0], [0.4, 0.6], 1.0, 8, DARK);
    }
}

/// Draw a kettle: a round body with lid, spout and handle.
pub fn kettle(s: &mut Sketch<'_>) {
    let [x, y, z] = s.spans();
    let metal = s.tint(0, STEEL);
    s.column_at([0.05, 0.95], [0.0, 0.75], [0.12, 0.78], 0.7, 12, metal);
    s.column_at([0.3, 0.7], [0.75, 0.85], [0.3, 0.6], 0.6, 8, DARK);
    s.cuboid_at([0.45, 0.55], [0.92, 1.0], [0.1, 0.8], DARK);
    for end in ends(between(z, 0.1, 0.8), 0.015, 0.0) {
        s.cuboid(between(x, 0.45, 0.55), between(y, 0.6, 0.92), end, DARK);
    }
    s.detail("spout", 1);
    let spout = [between(x, 0.42, 0.58), between(y, 0.5, 0.68), between(z, 0.7, 1.0)];
    s.round(Along::Z, 0.6, 8, spout, metal);
    s.cuboid(x, [0.0, 0.01], between(z, 0.0, 0.8), shade(metal, 0.6));
}
