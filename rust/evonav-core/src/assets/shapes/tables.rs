//! Tables and desks: a top, legs or a pedestal, and lower boards where things were seen on them.

use super::{
    colour::{WOODS, shade},
    sketch::{Sketch, between, ends, inside},
    storage,
};

/// Round tables, told by their names and by recorded children that leave the corners free.
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

/// Dining, coffee and side tables.
pub fn table(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let low_levels = s.levels().iter().filter(|&&y| y < 0.8 * h).count();
    let is_nightstand = s.asset().category == "SideTable" && h < 0.75 && w < 0.7;
    if s.asset().category != "DiningTable" && (low_levels >= 2 || is_nightstand && low_levels > 0) {
        return storage::carcass(s);
    }
    let [x, _, z] = s.spans();
    let wood = s.tint(0, s.choose(&WOODS, WOODS[1]));
    let support = s.tint(1, shade(wood, 0.8));
    let top = (0.06 * h).clamp(0.02, 0.045).min(h);
    let is_round = ROUND.contains(&s.asset().id.as_str());
    if is_round {
        let radius = 0.5 * w.min(d);
        s.column(x, [h - top, h], z, 1.0, 16, wood);
        s.pole([0.0, 0.0], (0.12 * radius).max(0.015), [0.03, h - top], 8, support);
        s.column(between(x, 0.2, 0.8), [0.0, 0.04], between(z, 0.2, 0.8), 0.8, 12, support);
        return;
    }
    let thick = (0.05 * w.min(d)).clamp(0.02, 0.08);
    s.cuboid(x, [h - top, h], z, wood);
    s.legs([0.0, h - top], thick, 0.02 * w.min(d), support);
    let apron = (0.1 * h).min(0.08);
    if h > 0.3 {
        for z in ends(z, 0.02, 0.5 * thick) {
            s.cuboid(inside(x, thick), [h - top - apron, h - top], z, support);
        }
    }
    for level in s.levels() {
        if level > 0.04 && level < 0.8 * h {
            s.cuboid(inside(x, thick), [level - 0.02, level], inside(z, thick), wood);
        }
    }
}

/// Desks: a table with a drawer block on one side; tall ones carry a shelf at the back; deep ones
/// are L shaped like corner counters (measured: things stand along the back and along +x).
pub fn desk(s: &mut Sketch<'_>) {
    let [w, h, d] = s.size();
    let [x, _, z] = s.spans();
    let wood = s.tint(0, s.choose(&WOODS, WOODS[1]));
    let front = s.tint(1, shade(wood, 0.85));
    let levels = s.levels();
    let working = levels.iter().copied().rfind(|&y| y > 0.5 && y < 0.95);
    let desk_top = match working {
        Some(level) if level < h - 0.06 => level,
        _ if h <= 0.95 => h,
        _ => 0.75,
    };
    let top = 0.035;
    let side = 0.025;
    let leg_y = [0.0, desk_top - top];
    let [left, right] = ends(x, side, 0.0);
    if d > 1.1 && w > 1.5 {
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
    if w > 1.0 {
        let block = between(x, 0.7, 0.98);
        s.cuboid(block, [0.08, desk_top - top], inside(z, 0.02), front);
        let handle = between(block, 0.35, 0.65);
        for k in 1..4 {
            let y = 0.08 + (desk_top - top - 0.08) * (f64::from(k) - 0.5) / 3.0;
            s.cuboid(
                handle,
                [y - 0.008, y + 0.008],
                [z[1] - 0.025, z[1] - 0.008],
                shade(front, 0.5),
            );
        }
    }
    if h > desk_top + 0.05 {
        // Shelf over the back of the desk.
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
