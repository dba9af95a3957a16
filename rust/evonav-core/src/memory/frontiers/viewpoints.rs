//! Choose the position from which to view a frontier's region.

use crate::{
    geometry::{Vec2, distance_2d_m},
    grid::bits::{BitGrid, ones},
    memory::{
        frontiers::{
            Frontier, FrontierConfig,
            frontier::Span,
            regions::{Region, mean_direction},
        },
        occupancy::OccupancyMap,
    },
};

/// Number of cells among which a view position is chosen.
const NUM_RANKED: usize = 5;
/// Relative error of squares of lengths beside `hypot`, far above rounding.
const HAIR: f64 = 1e-12;

/// Create the frontier of a region: its direction and view position.
pub(crate) fn place(
    map: &OccupancyMap,
    edges: &BitGrid,
    agent_m: Vec2,
    Region { cells, span }: Region,
    id: u64,
    config: &FrontierConfig,
) -> Frontier {
    let [x, z] = mean_direction(map, agent_m, &cells);
    let direction_rad = x.atan2(z);
    let ahead = [direction_rad.sin(), direction_rad.cos()];
    let mut candidates = edges_beside(edges, &cells, &span);
    if candidates.is_empty() {
        candidates = edges.cells().collect();
    }
    // Of the five cells that lie best in that direction, the one nearest to the agent is used.
    let mut ranked: Vec<(f64, f64, [usize; 2])> = Vec::with_capacity(NUM_RANKED + 1);
    for cell in candidates {
        let centre_m = map.spec().centre_m(cell);
        let distance_m = distance_2d_m(centre_m, agent_m);
        let along_m = (centre_m[0] - agent_m[0]) * ahead[0] + (centre_m[1] - agent_m[1]) * ahead[1];
        let share = along_m / distance_m.max(1e-9);
        // Cells come in order, so that an equal one stays behind those before it.
        let place = ranked.partition_point(|other| other.0.total_cmp(&share).is_ge());
        if place < NUM_RANKED {
            ranked.insert(place, (share, distance_m, cell));
            ranked.truncate(NUM_RANKED);
        }
    }
    let nearest = ranked.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    let position_m =
        nearest.map_or(agent_m, |&(_, _, cell)| push_away(map, map.spec().centre_m(cell), config));
    Frontier { id, position_m, direction_rad, cells, span }
}

/// Create the frontier of a group of unknown cells: the view position is on the nearest border
/// cell, right beside the group.
pub(crate) fn place_at_border(
    map: &OccupancyMap,
    edges: &BitGrid,
    agent_m: Vec2,
    Region { cells, span }: Region,
    id: u64,
    _: &FrontierConfig,
) -> Frontier {
    let is_beside = |row: i32, col: i32| edges.get(row as usize, col as usize);
    let nearest = cells
        .iter()
        .flat_map(|&[r, c]| [[r - 1, c], [r, c - 1], [r, c + 1], [r + 1, c]])
        .filter(|&[row, col]| row >= 0 && col >= 0 && is_beside(row, col))
        .map(|cell| map.spec().centre_m(cell.map(|i| i as usize)))
        .min_by(|a, b| distance_2d_m(*a, agent_m).total_cmp(&distance_2d_m(*b, agent_m)));
    let position_m = nearest.unwrap_or(agent_m);
    let [x, z] = mean_direction(map, position_m, &cells);
    Frontier { id, position_m, direction_rad: x.atan2(z), cells, span }
}

/// Return the edge cells with 2 to 12 cells of the region in the 5 x 5 cells around them,
/// row-major.
fn edges_beside(edges: &BitGrid, cells: &[[i32; 2]], span: &Span) -> Vec<[usize; 2]> {
    if cells.is_empty() {
        return Vec::new();
    }
    let (low, high) = (span.low.map(|i| (i - 2).max(0) as usize), span.high.map(|i| i as usize));
    let rows = low[0]..(high[0] + 3).min(edges.rows());
    let mut region = BitGrid::new(rows.len(), edges.cols());
    for cell in cells {
        region.insert(cell[0] as usize - low[0], cell[1] as usize);
    }
    let mut found = Vec::new();
    for row in rows {
        for first in (low[1]..high[1] + 3).step_by(64) {
            let width = (high[1] + 3 - first).min(64) as u32;
            let bits = edges.window(row, first as i64) & (u64::MAX >> (64 - width));
            let beside = ones(bits)
                .map(|bit| [row, first + bit])
                .filter(|&[row, col]| (2..=12).contains(&region.count_5x5(row - low[0], col)));
            found.extend(beside);
        }
    }
    found
}

/// Move a point away from the nearest obstacle while its clearance grows and it stays on free
/// floor.
fn push_away(map: &OccupancyMap, mut point_m: Vec2, config: &FrontierConfig) -> Vec2 {
    let mut moved_m = 0.0;
    let mut nearest = nearest_blocked(map, point_m, config.clearance_m);
    while let Some((obstacle_m, clearance_m)) = nearest
        && moved_m + config.push_step_m <= config.max_push_m + 1e-9
        && clearance_m > 0.0
    {
        let step = config.push_step_m / clearance_m;
        let next_m = [0, 1].map(|i| point_m[i] + (point_m[i] - obstacle_m[i]) * step);
        if !map.spec().cell_of(next_m).is_some_and(|[r, c]| map.free().get(r, c)) {
            break;
        }
        nearest = nearest_blocked(map, next_m, config.clearance_m);
        if nearest.is_some_and(|(_, next_clearance_m)| next_clearance_m <= clearance_m) {
            break;
        }
        point_m = next_m;
        moved_m += config.push_step_m;
    }
    point_m
}

/// Return the centre of the nearest blocked cell closer than `within_m`, and its distance; the
/// first, row-major, of equally near ones.
fn nearest_blocked(map: &OccupancyMap, point_m: Vec2, within_m: f64) -> Option<(Vec2, f64)> {
    let spec = map.spec();
    let [row, col] = spec.cell_of(point_m)?;
    let reach = (within_m / spec.cell_m).ceil().min((spec.rows + spec.cols) as f64) as usize;
    let rows = row.saturating_sub(reach)..(row + reach + 1).min(spec.rows);
    let first = col as i64 - reach as i64;
    let mut nearest: Option<(Vec2, f64)> = None;
    // Lengths are computed for cells alone whose squares may be the least.
    let mut most_m2 = within_m * within_m * (1.0 + HAIR);
    for r in rows {
        for w in (0..=2 * reach as i64).step_by(64) {
            let width = (2 * reach as i64 + 1 - w).min(64) as u32;
            let bits = map.blocked().window(r, first + w) & (u64::MAX >> (64 - width));
            for bit in ones(bits) {
                let centre_m = spec.centre_m([r, (first + w + bit as i64) as usize]);
                let [x, z] = [0, 1].map(|i| centre_m[i] - point_m[i]);
                if x * x + z * z > most_m2 {
                    continue;
                }
                let distance_m = distance_2d_m(centre_m, point_m);
                let least_m = nearest.map_or(within_m, |(_, least_m)| least_m);
                if distance_m < least_m {
                    nearest = Some((centre_m, distance_m));
                    most_m2 = (x * x + z * z) * (1.0 + HAIR);
                }
            }
        }
    }
    nearest
}
