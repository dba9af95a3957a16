//! Choose the position from which to view a frontier's region.

use crate::{
    geometry::{Vec2, distance_2d_m},
    grid::bits::{BitGrid, add3, ones},
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
        let [x, z] = [0, 1].map(|i| centre_m[i] - agent_m[i]);
        let along_m = x * ahead[0] + z * ahead[1];
        // Most cells surely lie worse than the fifth.
        let about_m = (x * x + z * z).sqrt();
        let is_worse = |fifth: &(f64, f64, [usize; 2])| along_m < (fifth.0 - HAIR) * about_m;
        if about_m > 1e-9 && ranked.get(NUM_RANKED - 1).is_some_and(is_worse) {
            continue;
        }
        let distance_m = distance_2d_m(centre_m, agent_m);
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
    let blocks = low[1] / 64..(high[1] + 3).min(edges.cols()).div_ceil(64);
    // The region's words, and the number of its cells among the five of a row around each cell, in
    // binary: ones, twos, fours. Two rows of none lie above and below, a word of none at the end.
    let stride = blocks.len() + 1;
    let mut region = vec![0_u64; (rows.len() + 4) * stride + 1];
    let (mut at, mut bits) = (0, 0);
    for &[row, col] in cells {
        let (row, col) = (row as usize - low[0] + 2, col as usize - 64 * blocks.start);
        let index = row * stride + col / 64 + 1;
        if index != at {
            region[at] |= bits;
            (at, bits) = (index, 0);
        }
        bits |= 1 << (col % 64);
    }
    region[at] |= bits;
    let across = |index: usize| {
        let [before, here, after] = [index, index + 1, index + 2].map(|i| region[i]);
        let left = [here << 1 | before >> 63, here << 2 | before >> 62];
        let right = [here >> 1 | after << 63, here >> 2 | after << 62];
        let (ones, twos_a) = add3([here, left[0], left[1]]);
        let (ones, twos_b) = add3([ones, right[0], right[1]]);
        [ones, twos_a ^ twos_b, twos_a & twos_b]
    };
    let mut found = Vec::new();
    for row in rows {
        for (word, &bits) in blocks.clone().zip(&edges.row(row)[blocks.clone()]) {
            if bits == 0 {
                continue;
            }
            let first = (row - low[0]) * stride + word - blocks.start;
            let beside = bits & is_beside([0, 1, 2, 3, 4].map(|k| across(first + k * stride)));
            found.extend(ones(beside).map(|bit| [row, 64 * word + bit]));
        }
    }
    found
}

/// Return the bits for which five numbers, in binary, have a sum of 2 to 12, 64 at once.
fn is_beside(rows: [[u64; 3]; 5]) -> u64 {
    let [[a, b, c, d, e], twos, fours] = [0, 1, 2].map(|place| rows.map(|row| row[place]));
    let (ones, carry_a) = add3([a, b, c]);
    let (ones, carry_b) = add3([ones, d, e]);
    let (sum_a, carry_c) = add3([twos[0], twos[1], twos[2]]);
    let (sum_b, carry_d) = add3([twos[3], twos[4], carry_a]);
    let (twos, carry_e) = add3([sum_a, sum_b, carry_b]);
    let (sum_a, eight_a) = add3([fours[0], fours[1], fours[2]]);
    let (sum_b, eight_b) = add3([fours[3], fours[4], carry_c]);
    let (sum, eight_c) = add3([sum_a, sum_b, carry_d]);
    let (fours, eight_d) = (sum ^ carry_e, sum & carry_e);
    let (sum, sixteens) = add3([eight_a, eight_b, eight_c]);
    let (eights, sixteens) = (sum ^ eight_d, sixteens | sum & eight_d);
    !sixteens & ((eights & !(fours & (twos | ones))) | (!eights & (fours | twos)))
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
    let first = col as i64 - reach as i64;
    let mut nearest: Option<([usize; 2], f64)> = None;
    // Lengths are computed for cells alone whose squares may be the least.
    let mut most_m2 = within_m * within_m * (1.0 + HAIR);
    // Rows from the middle outwards: above and below in turn.
    for turn in 0..=2 * reach {
        let far = turn.div_ceil(2);
        let r = if turn % 2 == 0 { row + far } else { row.wrapping_sub(far) };
        let z = spec.centre_m([r, 0])[1] - point_m[1];
        if r >= spec.rows || z * z > most_m2 {
            continue;
        }
        for w in (0..=2 * reach as i64).step_by(64) {
            let width = (2 * reach as i64 + 1 - w).min(64) as u32;
            let bits = map.blocked().window(r, first + w) & (u64::MAX >> (64 - width));
            for bit in ones(bits) {
                let cell = [r, (first + w + bit as i64) as usize];
                let centre_m = spec.centre_m(cell);
                let x = centre_m[0] - point_m[0];
                if x * x + z * z > most_m2 {
                    continue;
                }
                let distance_m = distance_2d_m(centre_m, point_m);
                let is_first = nearest.map_or(distance_m < within_m, |(other, least_m)| {
                    distance_m < least_m || distance_m == least_m && cell < other
                });
                if is_first {
                    nearest = Some((cell, distance_m));
                    most_m2 = (x * x + z * z) * (1.0 + HAIR);
                }
            }
        }
    }
    nearest.map(|(cell, distance_m)| (spec.centre_m(cell), distance_m))
}
