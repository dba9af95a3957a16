//! Shapes of storage furniture: carcasses with drawers, doors or open boards, shelving, carts,
//! safes.

use std::f64::consts::FRAC_PI_2;

use crate::assets::{
    material::MaterialKind,
    shapes::{
        colour::{DARK, Paint, STEEL, WOODS, rgb, shade},
        sketch::{Along, Motion, Sketch, Span, between, ends, inside, piece},
    },
};

/// Draw dressers, television stands and nightstands: open where objects were recorded inside, with
/// drawers elsewhere.
///
/// Open compartments have their boards at the recorded heights, so that the objects in them are
/// visible.
pub fn carcass(s: &mut Sketch<'_>) {
    let [w, h, _] = s.size();
    let [x, _, z] = s.spans();
    let wood = s.tint(0, s.choose(&WOODS, WOODS[1]));
    let front = s.tint(1, shade(wood, 1.12));
    let board = (0.03_f64).min(0.08 * h);
    let inner: Vec<f64> = s.levels().into_iter().filter(|&y| y < h - 0.06).collect();
    s.detail("open shelf", inner.len());
    let shell = [z[0], z[1] - 0.012];
    if inner.is_empty() {
        let foot = if h > 0.4 { 0.06 } else { 0.02 };
        s.cuboid(inside(x, 0.02), [0.0, foot], inside(z, 0.03), shade(wood, 0.5));
        s.cuboid(x, [foot, h - board], shell, wood);
        s.cuboid(x, [h - board, h], z, wood);
        let (columns, rows) =
            ((w / 0.7).round().clamp(1.0, 3.0), (h / 0.28).round().clamp(1.0, 5.0));
        drawers(s, [columns as usize, rows as usize], [foot, h - board], front);
        return;
    }
    let side = (0.03_f64).min(0.06 * w);
    let [left, right] = ends(x, side, 0.0);
    let width = inside(x, side);
    s.cuboid(left, [0.0, h - board], z, wood);
    s.cuboid(right, [0.0, h - board], z, wood);
    s.cuboid(x, [h - board, h], z, wood);
    s.cuboid(width, [0.0, h - board], [z[0], z[0] + 0.01], shade(wood, 0.7));
    let bottom = inner[0];
    if bottom > 0.25 {
        // No object was recorded below the first board, so a drawer or a door closes it.
        s.cuboid(width, [0.02, bottom], [z[0] + 0.01, shell[1]], front);
    } else {
        s.cuboid(width, [(bottom - board).max(0.0), bottom], [z[0] + 0.01, z[1]], wood);
    }
    for &level in &inner[1..] {
        s.cuboid(width, [level - 0.5 * board, level], [z[0] + 0.01, z[1] - 0.005], wood);
    }
}

/// Draw fronts with a handle each, on the +z side.
fn drawers(s: &mut Sketch<'_>, [columns, rows]: [usize; 2], y: [f64; 2], colour: Paint) {
    let [x, _, z] = s.spans();
    let face = [z[1] - 0.012, z[1] - 0.004];
    s.detail("drawer", columns * rows);
    for column in 0..columns {
        for row in 0..rows {
            let x = inside(piece(x, column, columns), 0.01);
            let y = inside(piece(y, row, rows), 0.01);
            let front = |s: &mut Sketch<'_>| {
                s.cuboid(x, y, face, colour.of(MaterialKind::Drawer));
                let grip = between(x, 0.4, 0.6);
                let (low, high) = (0.5 * (y[0] + y[1]) - 0.008, 0.5 * (y[0] + y[1]) + 0.008);
                s.cuboid(
                    grip,
                    [low, high],
                    [face[1], z[1]],
                    shade(colour, 0.45).of(MaterialKind::Metal),
                );
            };
            if row + 1 < rows {
                front(s);
                continue;
            }
            // The upper row of drawers opens.
            let depth = 0.5 * (z[1] - z[0]);
            s.opening(Motion::Slide { by_m: [0.0, 0.0, 0.8 * depth] }, |s| {
                front(s);
                tray(s, inside(x, 0.01), [y[0] + 0.01, y[1] - 0.02], [face[0] - depth, face[0]]);
            });
        }
    }
}

/// Draw bottom, sides and back of a drawer, which only show when it is pulled out.
pub fn tray(s: &mut Sketch<'_>, x: Span, y: Span, z: Span) {
    if !s.is_ajar() {
        return;
    }
    let wood = WOODS[0];
    s.cuboid(x, [y[0], y[0] + 0.01], z, shade(wood, 0.9));
    for side in ends(x, 0.01, 0.0) {
        s.cuboid(side, y, z, wood);
    }
    s.cuboid(x, y, [z[0], z[0] + 0.01], wood);
}

/// Draw open shelving: sides, back and boards at the recorded heights.
pub fn shelves(s: &mut Sketch<'_>) {
    let [w, h, _] = s.size();
    let [x, _, z] = s.spans();
    let wood = s.tint(0, s.choose(&WOODS, WOODS[0]));
    let board = (0.025_f64).min(0.05 * h);
    let side = (0.025_f64).min(0.06 * w);
    let [left, right] = ends(x, side, 0.0);
    s.cuboid(left, [0.0, h], z, wood);
    s.cuboid(right, [0.0, h], z, wood);
    let mut levels = s.levels();
    if levels.len() < 2 {
        let count = (h / 0.38).round().max(2.0) as usize;
        levels = (0..=count).map(|i| 0.06 + (h - 0.06) * i as f64 / count as f64).collect();
    }
    if levels.last().is_some_and(|&last| last < h - 0.1) {
        levels.push(h);
    }
    let width = inside(x, side);
    s.detail("open shelf", levels.len());
    for level in levels {
        s.cuboid(width, [(level - board).max(0.0), level], z, wood);
    }
    s.cuboid(width, [0.0, h], [z[0], z[0] + 0.008], shade(wood, 0.75));
}

/// Draw a serving cart: boards on four posts, with castors.
pub fn cart(s: &mut Sketch<'_>) {
    let h = s.size()[1];
    let [x, _, z] = s.spans();
    let wood = s.tint(0, WOODS[1]);
    s.legs([0.0, h], 0.03, 0.0, s.tint(1, STEEL));
    let mut levels = s.levels();
    if levels.len() < 2 {
        levels.extend([0.15 * h, 0.5 * h]);
    }
    s.detail("shelf", levels.len());
    for level in levels {
        s.cuboid(x, [level - 0.025, level], z, wood);
    }
}

/// Draw a safe: a body, a door with a dial.
pub fn safe(s: &mut Sketch<'_>) {
    let [w, h, _] = s.size();
    let [x, y, z] = s.spans();
    let steel = s.tint(0, rgb(90, 95, 100).of(MaterialKind::Metal));
    s.cuboid(x, y, [z[0], z[1] - 0.03], steel);
    s.detail("dial", 1);
    let door = [inside(x, 0.08 * w), inside(y, 0.08 * h)];
    let pivot_m = [door[0][0], 0.0, z[1] - 0.03];
    s.opening(Motion::Hinge { pivot_m, axis: Along::Y, angle_rad: -FRAC_PI_2 }, |s| {
        s.cuboid(door[0], door[1], [z[1] - 0.03, z[1] - 0.015], shade(steel, 1.2));
        let dial = [between(x, 0.42, 0.58), between(y, 0.42, 0.58), [z[1] - 0.015, z[1]]];
        s.round(Along::Z, 1.0, 8, dial, DARK);
    });
    if s.is_ajar() {
        let hollow = [inside(x, 0.12 * w), inside(y, 0.12 * h)];
        s.cuboid(hollow[0], hollow[1], [z[1] - 0.03, z[1] - 0.029], shade(steel, 0.4));
    }
}
