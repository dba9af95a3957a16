//! Frontiers: where the known floor ends and exploring may go on, by 3D-Mem's rules.
//!
//! The free cells seen from afar but not from close by, well inside the unexplored, form regions;
//! the border of the explored, next to a region, is where to stand and look. Parameters and rules are those
//! of 3D-Mem (Yang et al., CVPR 2025), restated; where its code draws random numbers ours does not.

use std::f64::consts::{PI, TAU};

use crate::{
    Error,
    geometry::{Vec2, distance_2d_m},
    memory::{
        bits::BitGrid,
        components::{Components, Run},
        occupancy::OccupancyMap,
    },
};

/// When free cells are a frontier, and where to look at it from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontierConfig {
    /// Fewest cells of a region.
    pub min_cells: usize,
    /// A region that spans more than this, seen from the agent, is split.
    pub max_span_rad: f64,
    /// A view position keeps this far from obstacles where it can ...
    pub clearance_m: f64,
    /// ... by moving away from them in steps of this ...
    pub push_step_m: f64,
    /// ... this far at most.
    pub max_push_m: f64,
}

impl Default for FrontierConfig {
    fn default() -> Self {
        Self {
            min_cells: 20,
            max_span_rad: 150.0_f64.to_radians(),
            clearance_m: 0.5,
            push_step_m: 0.05,
            max_push_m: 0.3,
        }
    }
}

impl FrontierConfig {
    /// Checks every field.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the first field outside its domain.
    pub fn check(&self) -> Result<(), Error> {
        Error::require("max_span_rad", self.max_span_rad, "in [0.1, 2 pi]", |v| {
            (0.1..=TAU + 1e-9).contains(&v)
        })?;
        let is_length = |v: f64| v.is_finite() && v >= 0.0;
        Error::require("clearance_m", self.clearance_m, "finite and >= 0", is_length)?;
        Error::require("max_push_m", self.max_push_m, "finite and >= 0", is_length)?;
        Error::require("push_step_m", self.push_step_m, "finite and > 0", |v| {
            v.is_finite() && v > 0.0
        })
    }
}

/// A place to explore from.
#[derive(Debug, Clone, PartialEq)]
pub struct Frontier {
    /// Counts up; never used twice by one [`Frontiers`].
    pub id: u64,
    /// `[x, z]` where to stand.
    pub position_m: Vec2,
    /// Where to look: from the agent, as it stood when the frontier was made, to the region.
    pub direction_rad: f64,
    /// `[row, col]` of the region, row-major.
    pub cells: Vec<[i32; 2]>,
}

/// The frontiers of a map and their ids, kept from one update to the next.
#[derive(Debug, Clone, Default)]
pub struct Frontiers {
    list: Vec<Frontier>,
    next_id: u64,
}

impl Frontiers {
    /// The frontiers of the last update, by ascending id.
    pub fn list(&self) -> &[Frontier] {
        &self.list
    }

    /// Drops all frontiers. Ids go on counting.
    pub fn clear(&mut self) {
        self.list.clear();
    }

    /// Brings the frontiers up to date with the map. A frontier whose region has hardly changed
    /// keeps its id, position and direction.
    ///
    /// # Errors
    /// As [`extract`].
    pub fn update(
        &mut self,
        map: &OccupancyMap,
        agent_m: Vec2,
        config: &FrontierConfig,
    ) -> Result<&[Frontier], Error> {
        let seeds: Vec<[i32; 2]> = self
            .list
            .iter()
            .filter_map(|old| old.cells.get(old.cells.len() / 2))
            .copied()
            .collect();
        let found = find_regions(map, agent_m, &seeds, config)?;
        let (kept, fresh) = reconcile(std::mem::take(&mut self.list), found.regions, config);
        self.list = kept;
        for region in fresh {
            let frontier = place(map, &found.edges, agent_m, region, self.next_id, config);
            self.list.push(frontier);
            self.next_id += 1;
        }
        Ok(&self.list)
    }
}

/// The frontiers of a map, without a history.
///
/// # Arguments
/// * `agent_m` - `[x, z]`; frontiers lie on the free floor that is connected to it.
///
/// # Returns
/// Frontiers in the order of their regions' first cells (row-major; the parts of a split region by angle), ids from 0.
///
/// # Errors
/// [`Error::InvalidArgument`] if a number is not finite or outside its domain.
///
/// # Complexity
/// O(cells / 64) for the map, O(cells of the regions) for the rest.
pub fn extract(
    map: &OccupancyMap,
    agent_m: Vec2,
    config: &FrontierConfig,
) -> Result<Vec<Frontier>, Error> {
    let mut frontiers = Frontiers::default();
    frontiers.update(map, agent_m, config)?;
    Ok(frontiers.list)
}

/// Regions and the cells that may serve as view positions.
struct Found {
    regions: Vec<Vec<[i32; 2]>>,
    edges: BitGrid,
}

fn find_regions(
    map: &OccupancyMap,
    agent_m: Vec2,
    seeds: &[[i32; 2]],
    config: &FrontierConfig,
) -> Result<Found, Error> {
    config.check()?;
    for value in agent_m {
        Error::require("agent_m", value, "finite", f64::is_finite)?;
    }
    let island = island(map, agent_m, seeds);
    let (inner, edges) = split_by_unexplored_neighbours(&island, map.explored());
    let mut regions = Vec::new();
    if edges.count() > 0 {
        for runs in Components::new(&inner).by_component() {
            let num_cells: usize = runs.iter().map(Run::len).sum();
            if num_cells >= config.min_cells.max(2) {
                let cells = runs.iter().flat_map(Run::cells).map(|c| c.map(|i| i as i32)).collect();
                split_wide(map, agent_m, cells, config.max_span_rad, &mut regions);
            }
        }
    }
    Ok(Found { regions, edges })
}

/// The free cells connected (4 neighbours) to the agent, or to the free cell nearest to it, or to a seed.
fn island(map: &OccupancyMap, agent_m: Vec2, seeds: &[[i32; 2]]) -> BitGrid {
    let mut island = BitGrid::new(map.spec().rows, map.spec().cols);
    let components = Components::new(map.free());
    let mut is_wanted = vec![false; components.num()];
    let own = map.spec().cell_of(agent_m);
    let under_agent = own.and_then(|[row, col]| components.of_cell(row, col));
    let nearest = || {
        let distance_m = |run: &Run| {
            let centre_m = |col: u32| map.spec().centre_m([run.row as usize, col as usize]);
            let (first, last) = (centre_m(run.start), centre_m(run.end - 1));
            distance_2d_m([agent_m[0].clamp(first[0], last[0]), first[1]], agent_m)
        };
        let by_distance =
            |a: &(Run, usize), b: &(Run, usize)| distance_m(&a.0).total_cmp(&distance_m(&b.0));
        components.runs().min_by(by_distance).map(|(_, component)| component)
    };
    if let Some(component) = under_agent.or_else(nearest) {
        is_wanted[component] = true;
    }
    for seed in seeds {
        if let Some(component) = components.of_cell(seed[0] as usize, seed[1] as usize) {
            is_wanted[component] = true;
        }
    }
    for (run, component) in components.runs() {
        if is_wanted[component] {
            island.insert_run(run.row as usize, run.start as usize, run.end as usize);
        }
    }
    island
}

/// Island cells whose 8 neighbours are all unexplored, and those with 4 to 6 unexplored ones.
/// What lies off the map counts as explored.
fn split_by_unexplored_neighbours(island: &BitGrid, explored: &BitGrid) -> (BitGrid, BitGrid) {
    let (rows, cols) = (island.rows(), island.cols());
    let (mut inner, mut edges) = (BitGrid::new(rows, cols), BitGrid::new(rows, cols));
    let num_words = cols.div_ceil(64);
    let unexplored = |row: usize, word: usize| match explored.row(row).get(word) {
        Some(&bits) => !bits & explored.word_mask(word),
        None => 0,
    };
    // The word, and the same shifted so that each bit holds its left and its right neighbour.
    let neighbours = |row: usize, word: usize| {
        let here = unexplored(row, word);
        let before = if word > 0 { unexplored(row, word - 1) } else { 0 };
        [here << 1 | before >> 63, here, here >> 1 | unexplored(row, word + 1) << 63]
    };
    for row in 0..rows {
        for word in 0..num_words {
            let candidates = island.row(row)[word];
            if candidates == 0 {
                continue;
            }
            let above = if row > 0 { neighbours(row - 1, word) } else { [0; 3] };
            let [left, _, right] = neighbours(row, word);
            let (ones_a, twos_a) = add3(above);
            let (ones_b, twos_b) = add3(neighbours(row + 1, word));
            let (ones_c, twos_c) = (left ^ right, left & right);
            // The number of neighbours in binary: eights, fours, twos (and ones), 64 cells at once.
            let (ones, carry) = add3([ones_a, ones_b, ones_c]);
            let (twos, fours_a) = add3([twos_a, twos_b, twos_c]);
            let (twos, fours_b) = (twos ^ carry, twos & carry);
            let (fours, eights) = (fours_a ^ fours_b, fours_a & fours_b);
            inner.row_mut(row)[word] = candidates & eights;
            edges.row_mut(row)[word] = candidates & fours & !(twos & ones);
        }
    }
    (inner, edges)
}

/// Sum and carry of three bits, 64 at once.
fn add3([a, b, c]: [u64; 3]) -> (u64, u64) {
    (a ^ b ^ c, (a & b) | (c & (a ^ b)))
}

/// Splits a region that spans a wide angle around the agent, by k-means on the angle.
fn split_wide(
    map: &OccupancyMap,
    agent_m: Vec2,
    cells: Vec<[i32; 2]>,
    max_span_rad: f64,
    regions: &mut Vec<Vec<[i32; 2]>>,
) {
    let angles = unwrapped_angles(map, agent_m, &cells);
    let (low, high) = angles
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &a| (low.min(a), high.max(a)));
    if high - low <= max_span_rad {
        regions.push(cells);
        return;
    }
    let num_parts = ((high - low) / max_span_rad) as usize + 1;
    let limits = k_means_limits(&angles, low, high, num_parts);
    let mut parts = vec![Vec::new(); num_parts];
    for (cell, angle) in cells.into_iter().zip(angles) {
        parts[limits.partition_point(|&limit| limit <= angle)].push(cell);
    }
    regions.extend(parts.into_iter().filter(|part| !part.is_empty()));
}

/// Angles of cells seen from the agent (0 along +z, growing towards +x), cut at the widest gap
/// so that neighbours do not lie a turn apart.
fn unwrapped_angles(map: &OccupancyMap, agent_m: Vec2, cells: &[[i32; 2]]) -> Vec<f64> {
    let mut angles: Vec<f64> = cells
        .iter()
        .map(|cell| {
            let centre_m = map.spec().centre_m(cell.map(|i| i as usize));
            (centre_m[0] - agent_m[0]).atan2(centre_m[1] - agent_m[1])
        })
        .collect();
    // Only a region on both sides of the cut behind the agent needs another cut.
    let is_near_cut = |angle: &f64| angle.abs() > 0.5 * PI;
    if angles.iter().any(|a| is_near_cut(a) && *a < 0.0)
        && angles.iter().any(|a| is_near_cut(a) && *a > 0.0)
    {
        let mut sorted = angles.clone();
        sorted.sort_by(f64::total_cmp);
        let across = sorted[0] + TAU - sorted[sorted.len() - 1];
        let mut widest = (across, -PI);
        for pair in sorted.windows(2) {
            if pair[1] - pair[0] > widest.0 {
                widest = (pair[1] - pair[0], pair[1]);
            }
        }
        for angle in &mut angles {
            if *angle < widest.1 {
                *angle += TAU;
            }
        }
    }
    angles
}

/// Borders between the `num_parts` clusters of one-dimensional k-means, started evenly spread.
fn k_means_limits(values: &[f64], low: f64, high: f64, num_parts: usize) -> Vec<f64> {
    let mut means: Vec<f64> =
        (0..num_parts).map(|i| low + (high - low) * (i as f64 + 0.5) / num_parts as f64).collect();
    let mut limits = Vec::new();
    for _ in 0..100 {
        let middle: Vec<f64> = means.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        if middle == limits {
            break;
        }
        limits = middle;
        let mut sums = vec![(0.0, 0.0); num_parts];
        for &value in values {
            let sum = &mut sums[limits.partition_point(|&limit| limit <= value)];
            *sum = (sum.0 + value, sum.1 + 1.0);
        }
        for (mean, (sum, count)) in means.iter_mut().zip(sums) {
            if count > 0.0 {
                *mean = sum / count;
            }
        }
    }
    limits
}

/// Old frontiers that stay, and the regions that become new ones.
fn reconcile(
    old: Vec<Frontier>,
    regions: Vec<Vec<[i32; 2]>>,
    config: &FrontierConfig,
) -> (Vec<Frontier>, Vec<Vec<[i32; 2]>>) {
    let mut is_taken = vec![false; regions.len()];
    let mut is_kept = vec![false; old.len()];
    let overlaps: Vec<Vec<Overlap>> = old
        .iter()
        .map(|frontier| regions.iter().map(|r| Overlap::new(&frontier.cells, r)).collect())
        .collect();
    for (i, row) in overlaps.iter().enumerate() {
        // The same region, give or take a few cells.
        if let Some(j) = (0..regions.len()).find(|&j| !is_taken[j] && row[j].is_same()) {
            (is_kept[i], is_taken[j]) = (true, true);
            continue;
        }
        // The region fell into parts that together are still it.
        let parts: Vec<usize> =
            (0..regions.len()).filter(|&j| !is_taken[j] && row[j].iou() > 0.02).collect();
        let total: f64 = parts.iter().map(|&j| row[j].iou()).sum();
        if parts.len() >= 2 && total > 0.95 && total <= 1.0 {
            is_kept[i] = true;
            parts.iter().for_each(|&j| is_taken[j] = true);
        }
    }
    // Old regions that grew together.
    for (j, region) in regions.iter().enumerate() {
        if is_taken[j] {
            continue;
        }
        let parts: Vec<usize> =
            (0..old.len()).filter(|&i| !is_kept[i] && overlaps[i][j].iou() > 0.02).collect();
        let total: f64 = parts.iter().map(|&i| overlaps[i][j].iou()).sum();
        let num_cells: usize = parts.iter().map(|&i| old[i].cells.len()).sum();
        let ratio = num_cells.min(region.len()) as f64 / num_cells.max(region.len()) as f64;
        if parts.len() >= 2 && total > 0.95 && total <= 1.0 && ratio > 0.95 {
            is_taken[j] = true;
            parts.iter().for_each(|&i| is_kept[i] = true);
        }
    }
    let kept: Vec<Frontier> =
        old.into_iter().zip(is_kept).filter(|(_, keep)| *keep).map(|(f, _)| f).collect();
    let is_covered = |cell: &[i32; 2]| kept.iter().any(|f| f.cells.binary_search(cell).is_ok());
    let fresh = regions.into_iter().zip(is_taken).filter(|(_, taken)| !taken).filter_map(
        |(mut region, _)| {
            let num_before = region.len();
            region.retain(|cell| !is_covered(cell));
            (region.len() == num_before || region.len() >= config.min_cells).then_some(region)
        },
    );
    let fresh = fresh.collect();
    (kept, fresh)
}

/// How two regions (cells in row-major order) share cells.
struct Overlap {
    shared: usize,
    either: usize,
}

impl Overlap {
    fn new(a: &[[i32; 2]], b: &[[i32; 2]]) -> Self {
        let mut shared = 0;
        let (mut i, mut j) = (0, 0);
        while i < a.len() && j < b.len() {
            match a[i].cmp(&b[j]) {
                std::cmp::Ordering::Less => i += 1,
                std::cmp::Ordering::Greater => j += 1,
                std::cmp::Ordering::Equal => (shared, i, j) = (shared + 1, i + 1, j + 1),
            }
        }
        Self { shared, either: a.len() + b.len() - shared }
    }

    fn iou(&self) -> f64 {
        self.shared as f64 / self.either.max(1) as f64
    }

    fn is_same(&self) -> bool {
        let difference = self.either - self.shared;
        (self.iou() > 0.95 && difference < 75) || difference <= 3
    }
}

/// Gives a region its direction and view position.
fn place(
    map: &OccupancyMap,
    edges: &BitGrid,
    agent_m: Vec2,
    cells: Vec<[i32; 2]>,
    id: u64,
    config: &FrontierConfig,
) -> Frontier {
    let angles = unwrapped_angles(map, agent_m, &cells);
    let mean = angles.iter().sum::<f64>() / angles.len().max(1) as f64;
    let direction_rad = if mean > PI { mean - TAU } else { mean };
    let ahead = [direction_rad.sin(), direction_rad.cos()];
    let mut candidates = edges_beside(edges, &cells);
    if candidates.is_empty() {
        candidates = edges.cells().collect();
    }
    // The five cells that lie best in that direction, then the one nearest to the agent.
    let mut ranked: Vec<(f64, f64, [usize; 2])> = candidates
        .into_iter()
        .map(|cell| {
            let centre_m = map.spec().centre_m(cell);
            let distance_m = distance_2d_m(centre_m, agent_m);
            let along_m =
                (centre_m[0] - agent_m[0]) * ahead[0] + (centre_m[1] - agent_m[1]) * ahead[1];
            (along_m / distance_m.max(1e-9), distance_m, cell)
        })
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.2.cmp(&b.2)));
    ranked.truncate(5);
    let nearest = ranked.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    let position_m =
        nearest.map_or(agent_m, |&(_, _, cell)| push_away(map, map.spec().centre_m(cell), config));
    Frontier { id, position_m, direction_rad, cells }
}

/// Edge cells with 2 to 12 cells of the region in the 5 x 5 cells around them, row-major.
fn edges_beside(edges: &BitGrid, cells: &[[i32; 2]]) -> Vec<[usize; 2]> {
    let mut region = BitGrid::new(edges.rows(), edges.cols());
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for cell in cells {
        let cell = cell.map(|i| i as usize);
        region.insert(cell[0], cell[1]);
        low = [low[0].min(cell[0]), low[1].min(cell[1])];
        high = [high[0].max(cell[0]), high[1].max(cell[1])];
    }
    let low = low.map(|i| i.saturating_sub(2));
    let rows = low[0]..(high[0] + 3).min(edges.rows());
    rows.flat_map(|row| {
        let words = edges.row(row).iter().enumerate().skip(low[1] / 64);
        words.take((high[1] + 2) / 64 - low[1] / 64 + 1).flat_map(move |(index, &word)| {
            crate::memory::bits::ones(word).map(move |bit| [row, index * 64 + bit])
        })
    })
    .filter(|&[row, col]| (2..=12).contains(&region.count_5x5(row, col)))
    .collect()
}

/// Moves a point away from the nearest obstacle while that gains clearance and stays on free floor.
fn push_away(map: &OccupancyMap, mut point_m: Vec2, config: &FrontierConfig) -> Vec2 {
    let mut moved_m = 0.0;
    while let Some((obstacle_m, clearance_m)) = nearest_blocked(map, point_m, config.clearance_m)
        && moved_m + config.push_step_m <= config.max_push_m + 1e-9
        && clearance_m > 0.0
    {
        let step = config.push_step_m / clearance_m;
        let next_m = [0, 1].map(|i| point_m[i] + (point_m[i] - obstacle_m[i]) * step);
        let is_free = map.spec().cell_of(next_m).is_some_and(|[r, c]| map.free().get(r, c));
        let next_clearance_m =
            nearest_blocked(map, next_m, config.clearance_m).map_or(f64::INFINITY, |n| n.1);
        if !is_free || next_clearance_m <= clearance_m {
            break;
        }
        point_m = next_m;
        moved_m += config.push_step_m;
    }
    point_m
}

/// Centre of the nearest blocked cell closer than `within_m`, and its distance.
fn nearest_blocked(map: &OccupancyMap, point_m: Vec2, within_m: f64) -> Option<(Vec2, f64)> {
    let spec = map.spec();
    let [row, col] = spec.cell_of(point_m)?;
    let reach = (within_m / spec.cell_m).ceil().min((spec.rows + spec.cols) as f64) as usize;
    let rows = row.saturating_sub(reach)..(row + reach + 1).min(spec.rows);
    let cols = col.saturating_sub(reach)..(col + reach + 1).min(spec.cols);
    rows.flat_map(|r| cols.clone().map(move |c| [r, c]))
        .filter(|&[r, c]| map.blocked().get(r, c))
        .map(|cell| {
            let centre_m = spec.centre_m(cell);
            (centre_m, distance_2d_m(centre_m, point_m))
        })
        .filter(|&(_, distance_m)| distance_m < within_m)
        .min_by(|a, b| a.1.total_cmp(&b.1))
}
