//! Shapes of tables and desks: a top, legs or a pedestal, and lower boards where objects were
//! recorded on them.

use crate::assets::{
    Asset,
    material::MaterialKind,
    shapes::{
        colour::{Paint, WOODS, shade},
        sketch::{Motion, Sketch, Span, between, ends, inside},
        storage,
    },
};

/// Round tables, identified by their names and by recorded children that leave the corners free.
const ROUND: [&str; 14] = [
    "Dining_Table_16_1",
    "Dining_Table_16_2",
    "Dining_Table_228_1",
    "Dining_Table_7_1",
    "Dining_Table_9_1",
    "RoboTHOR_dining_table_liatorp",
    "RoboTHOR_coffee_table_kragsta",
    "RoboTHOR_side_table_fornbro",
    "RoboTHOR_side_table_strind",
    "Coffee_Table_201_1",
    "Side_Table_207_1",
    "Side_Table_217_1",
    "Side_Table_309_1",
    "Side_Table_225_1",
];

/// Draw dining, coffee and side tables.
pub fn table(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let low: Vec<f64> = s.levels().into_iter().filter(|&y| y < h - 0.06).collect();
    // With objects inside it is a nightstand, unless it has one low board between legs.
    let is_small = s.asset().category == "SideTable" && h < 0.75 && w < 0.7;
    let is_carcass = low.len() >= 2 || is_small && low.first().is_some_and(|&y| y > 0.3 * h);
    if is_carcass && s.asset().category != "DiningTable" {
        return storage::carcass(s);
    }
    let [x, _, z] = s.spans();
    let wood = s.tint(0, s.choose(&WOODS, WOODS[1]));
    let support = s.tint(1, shade(wood, 0.8));
    let top = (0.06 * h).clamp(0.02, 0.045).min(h);
    let is_round = ROUND.contains(&s.asset().id.as_str());
    if is_round {
        s.form("round");
        s.detail("central pedestal", 1);
        let radius = 0.5 * w.min(d);
        s.column(x, [h - top, h], z, 1.0, 16, wood);
        s.pole([0.0, 0.0], (0.12 * radius).max(0.015), [0.03, h - top], 8, support);
        s.column(between(x, 0.2, 0.8), [0.0, 0.04], between(z, 0.2, 0.8), 0.8, 12, support);
        return;
    }
    let thick = (0.05 * w.min(d)).clamp(0.02, 0.08);
    let is_glass = has_glass_top(s);
    s.cuboid(x, [h - top, h], z, if is_glass { wood.of(MaterialKind::Pane) } else { wood });
    if is_glass {
        // The frame around the pane, a little under its surface.
        let frame = [x, [h - top, h], z];
        s.trim(|s| s.rim(frame, [0, 2], 1.4 * thick, wood));
    }
    s.legs([0.0, h - top], thick, 0.02 * w.min(d), support);
    let num_lower = s.levels().iter().filter(|&&y| y > 0.04 && y < h - 0.06).count();
    s.detail("lower shelf", num_lower);
    s.detail("leg", 4);
    let apron = (0.1 * h).min(0.08);
    if h > 0.3 {
        for z in ends(z, 0.02, 0.5 * thick) {
            s.cuboid(inside(x, thick), [h - top - apron, h - top], z, support);
        }
        s.trim(|s| {
            // The apron along the sides, and the shadow and the edge of the top.
            let y = [h - top - apron, h - top];
            for x in ends(x, 0.02, 0.5 * thick) {
                s.cuboid(x, y, inside(z, 0.5 * thick), support);
            }
            let shadow = [h - top - 0.008, h - top + 0.001];
            s.rim([inside(x, 0.004), shadow, inside(z, 0.004)], [0, 2], 0.03, shade(support, 0.4));
        });
    }
    for level in s.levels() {
        if level > 0.04 && level < h - 0.06 {
            s.cuboid(inside(x, thick), [level - 0.02, level], inside(z, thick), wood);
        }
    }
}

/// Return whether a table's top is clear glass.
fn has_glass_top(s: &Sketch<'_>) -> bool {
    let Asset { materials, made_of, .. } = s.asset();
    made_of.iter().any(|substance| substance == "glass")
        && materials.iter().any(|name| {
            ["Glass_Detailed_Tinted", "Glass_Detailed_White"]
                .iter()
                .any(|clear| name.starts_with(clear))
        })
}

/// Desks whose drawers and boards are on the right (+x); on all others they are on the left.
const RIGHT_HANDED: [&str; 2] = ["Desk_305_1", "Desk_328_1"];

/// Draw desks: a top, and on one side a block of drawers, or of open boards where objects were
/// recorded inside. Tall desks carry a shelf at the back, deep ones are L-shaped like corner
/// counters. The side and the L are measured on recorded children.
pub fn desk(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, _, z] = s.spans();
    let id = s.asset().id.as_str();
    if id == "Desk_329_1" {
        return storage::carcass(s);
    }
    let wood = s.tint(0, s.choose(&WOODS, WOODS[1]));
    let front = s.tint(1, shade(wood, 0.85));
    let levels = s.levels();
    let working = levels.iter().copied().rfind(|&y| y > 0.5 && y < 0.95);
    let desk_top = match working {
        Some(level) if level < h - 0.06 => level,
        _ if h <= 0.95 => h,
        _ => 0.75,
    };
    let (top, side) = (0.035, 0.025);
    let leg_y = [0.0, desk_top - top];
    let [left, right] = ends(x, side, 0.0);
    if d > 1.1 && w > 1.5 {
        s.form("L-shaped");
        let (wing, back) = (between(x, 1.0 - 0.62 / w, 1.0), between(z, 0.0, 0.65 / d));
        s.cuboid(x, [desk_top - top, desk_top], back, wood);
        s.cuboid(wing, [desk_top - top, desk_top], [back[1], z[1]], wood);
        s.cuboid(left, leg_y, back, front);
        s.cuboid(right, leg_y, back, front);
        s.cuboid(wing, leg_y, ends(z, side, 0.0)[1], front);
        return;
    }
    s.cuboid(x, [desk_top - top, desk_top], z, wood);
    s.cuboid(left, leg_y, z, front);
    s.cuboid(right, leg_y, z, front);
    s.cuboid(inside(x, side), [0.45 * desk_top, desk_top - top], ends(z, 0.015, 0.03)[0], front);
    let low: Vec<f64> = levels.iter().copied().filter(|&y| y < desk_top - 0.06).collect();
    let left_block = between(x, side / w, 0.36);
    let right_block = between(x, 0.64, 1.0 - side / w);
    let block = if RIGHT_HANDED.contains(&id) { right_block } else { left_block };
    if low.is_empty() && w > 1.0 {
        drawer_block(s, block, desk_top - top, front);
    }
    if low.iter().any(|&level| level <= desk_top - 0.16) {
        // This upright carries the boards' inner ends.
        let edge = if RIGHT_HANDED.contains(&id) { block[0] } else { block[1] - side };
        s.cuboid([edge, edge + side], leg_y, inside(z, 0.02), front);
        if id == "Desk_301_1" {
            s.cuboid([right_block[0], right_block[0] + side], leg_y, inside(z, 0.02), front);
        }
    }
    for level in low {
        // A level just under the top is a drawer or a ledge along the whole desk.
        let is_ledge = level > desk_top - 0.16;
        let board = [(level - 0.02).max(0.0), level];
        s.cuboid(if is_ledge { inside(x, side) } else { block }, board, inside(z, 0.02), wood);
        if id == "Desk_301_1" {
            s.cuboid(right_block, board, inside(z, 0.02), wood);
        }
    }
    if h > desk_top + 0.05 {
        // The shelf over the back of the desk.
        s.detail("raised shelf", 1);
        let back = between(z, 0.0, 0.42);
        s.cuboid(x, [h - 0.025, h], back, wood);
        s.cuboid(left, [desk_top, h - 0.025], back, front);
        s.cuboid(right, [desk_top, h - 0.025], back, front);
        s.cuboid(inside(x, side), [desk_top, h - 0.025], ends(z, 0.012, 0.0)[0], front);
        for level in levels.iter().copied().filter(|&y| y > desk_top + 0.1 && y < h - 0.05) {
            s.cuboid(inside(x, side), [level - 0.02, level], back, wood);
        }
    }
}

/// Draw three drawers, one above the other.
fn drawer_block(s: &mut Sketch<'_>, x: Span, top: f64, colour: Paint) {
    let z = s.spans()[2];
    s.detail("drawer", 3);
    s.cuboid(x, [0.08, top], inside(z, 0.02), colour);
    let third = (top - 0.08) / 3.0;
    for k in 1..4 {
        let y = 0.08 + third * (f64::from(k) - 0.5);
        let grip = |s: &mut Sketch<'_>| {
            let z = [z[1] - 0.025, z[1] - 0.008];
            s.cuboid(between(x, 0.35, 0.65), [y - 0.008, y + 0.008], z, shade(colour, 0.5));
        };
        if k < 3 {
            grip(s);
            continue;
        }
        // The upper drawer opens.
        let depth = 0.5 * (z[1] - z[0]);
        s.opening(Motion::Slide { by_m: [0.0, 0.0, 0.8 * depth] }, |s| {
            grip(s);
            if s.is_ajar() {
                let (y, front) = ([y - 0.45 * third, y + 0.45 * third], z[1] - 0.02);
                s.cuboid(inside(x, 0.01), y, [front - 0.012, front], shade(colour, 1.05));
                storage::tray(
                    s,
                    inside(x, 0.02),
                    [y[0], y[1] - 0.02],
                    [front - depth, front - 0.012],
                );
            }
        });
    }
}
