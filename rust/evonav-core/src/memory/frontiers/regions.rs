//! Find the regions of a map that are frontiers.

use std::f64::consts::{PI, TAU};

use evonav_simd::Kernel;

use crate::{
    Error,
    geometry::{Vec2, distance_2d_m},
    grid::{
        GridSpec,
        bits::{BitGrid, add3},
        components::{Components, Run},
        dilate::dilate_disk,
    },
    memory::{
        frontiers::frontier::{FrontierConfig, Span},
        occupancy::OccupancyMap,
    },
};

/// Regions and the cells that may serve as view positions.
pub(crate) struct Found {
    pub(crate) regions: Vec<Region>,
    pub(crate) edges: BitGrid,
    /// Whether these are borders of the known floor, because there are no regions.
    pub(crate) is_last_resort: bool,
}

pub(crate) fn find_regions(
    map: &OccupancyMap,
    agent_m: Vec2,
    seeds: &[[i32; 2]],
    given_up: Option<&BitGrid>,
    config: &FrontierConfig,
) -> Result<Found, Error> {
    config.check()?;
    Error::require_finite("agent_m", &agent_m)?;
    let island = island(map, agent_m, seeds);
    let (mut inner, edges) = split_by_unexplored_neighbours(&island, map.explored());
    given_up.into_iter().for_each(|cells| inner.subtract(cells));
    let mut regions = Vec::new();
    if !edges.is_empty() {
        for runs in Components::new(&inner).by_component().iter() {
            let num_cells: usize = runs.iter().map(Run::len).sum();
            if num_cells >= config.min_cells.max(2) {
                let region = Region::of_runs(runs);
                split_wide(map, agent_m, region, config.max_span_rad, &mut regions);
            }
        }
    }
    if !regions.is_empty() || config.min_border_cells == 0 {
        return Ok(Found { regions, edges, is_last_resort: false });
    }
    let (unknown, edges) = borders(map, &island, given_up);
    let groups = Components::with_corners(&unknown).by_component();
    let regions = groups.iter().map(Region::of_runs);
    let regions = regions.filter(|region| region.cells.len() >= config.min_border_cells).collect();
    Ok(Found { regions, edges, is_last_resort: true })
}

/// Cells that form a frontier, row-major.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Region {
    pub(crate) cells: Vec<[i32; 2]>,
    pub(crate) span: Span,
}

impl Region {
    pub(crate) fn new(cells: Vec<[i32; 2]>) -> Self {
        Self { span: Span::of(&cells), cells }
    }

    fn of_runs(runs: &[Run]) -> Self {
        let mut cells = Vec::with_capacity(runs.iter().map(Run::len).sum());
        let mut ends = Vec::with_capacity(2 * runs.len());
        for run in runs {
            let row = run.row as i32;
            cells.extend((run.start..run.end).map(|col| [row, col as i32]));
            ends.extend([[row, run.start as i32], [row, run.end as i32 - 1]]);
        }
        Self { span: Span::of(&ends), cells }
    }
}

/// Return the unknown cells beside island cells (4 neighbours), without those given up, and the
/// island cells beside them.
fn borders(map: &OccupancyMap, island: &BitGrid, given_up: Option<&BitGrid>) -> (BitGrid, BitGrid) {
    let mut unknown = dilate_disk(island, 1);
    for others in [map.free(), map.blocked()].into_iter().chain(given_up) {
        unknown.subtract(others);
    }
    let mut edges = dilate_disk(&unknown, 1);
    edges.intersect(island);
    (unknown, edges)
}

/// Return the free cells connected (4 neighbours) to the agent, or to the free cell nearest to it,
/// or to a seed.
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

/// Return the island cells whose 8 neighbours are all unexplored, and those with 4 to 6 unexplored
/// neighbours. Cells off the map count as explored.
fn split_by_unexplored_neighbours(island: &BitGrid, explored: &BitGrid) -> (BitGrid, BitGrid) {
    let (rows, cols) = (island.rows(), island.cols());
    let (mut inner, mut edges) = (BitGrid::new(rows, cols), BitGrid::new(rows, cols));
    let num_words = cols.div_ceil(64);
    let masks: Vec<u64> = (0..num_words).map(|word| explored.word_mask(word)).collect();
    // Unexplored cells of the rows above, here and below, with a word of none on both sides.
    let mut unexplored = [(); 3].map(|()| vec![0_u64; num_words + 2]);
    let fill = |words: &mut [u64], row: usize| {
        words.fill(0);
        for ((word, bits), mask) in words[1..].iter_mut().zip(explored.row(row)).zip(&masks) {
            *word = !bits & mask;
        }
    };
    let has_cells = |row: &usize| island.row(*row).iter().any(|&word| word != 0);
    let Some(first) = (0..rows).find(has_cells) else { return (inner, edges) };
    let last = (first..rows).rfind(has_cells).unwrap_or(first);
    if first > 0 {
        fill(&mut unexplored[1], first - 1);
    }
    fill(&mut unexplored[2], first);
    for row in first..=last {
        unexplored.rotate_left(1);
        fill(&mut unexplored[2], row + 1);
        let [above, here, below] = unexplored.each_ref().map(|words| words.windows(3));
        let around = above.zip(here).zip(below);
        let cells = island.row(row).iter().zip(inner.row_mut(row)).zip(edges.row_mut(row));
        for (((&candidates, inner), edges), ((above, here), below)) in cells.zip(around) {
            if candidates == 0 {
                continue;
            }
            // The word, and the word shifted so that each bit is its left or its right neighbour.
            let neighbours = |words: &[u64]| {
                let [before, here, after] = [words[0], words[1], words[2]];
                [here << 1 | before >> 63, here, here >> 1 | after << 63]
            };
            let [left, _, right] = neighbours(here);
            let (ones_a, twos_a) = add3(neighbours(above));
            let (ones_b, twos_b) = add3(neighbours(below));
            let (ones_c, twos_c) = (left ^ right, left & right);
            // The number of neighbours in binary: eights, fours, twos (and ones), 64 cells at once.
            let (ones, carry) = add3([ones_a, ones_b, ones_c]);
            let (twos, fours_a) = add3([twos_a, twos_b, twos_c]);
            let (twos, fours_b) = (twos ^ carry, twos & carry);
            let (fours, eights) = (fours_a ^ fours_b, fours_a & fours_b);
            *inner = candidates & eights;
            *edges = candidates & fours & !(twos & ones);
        }
    }
    (inner, edges)
}

/// Split a region that spans a wide angle around the agent, by k-centres on the angle.
fn split_wide(
    map: &OccupancyMap,
    agent_m: Vec2,
    region: Region,
    max_span_rad: f64,
    regions: &mut Vec<Region>,
) {
    if is_in_narrow_box(map, agent_m, &region.span, max_span_rad)
        || is_narrow(map, agent_m, &region.cells, max_span_rad)
    {
        regions.push(region);
        return;
    }
    let angles = unwrapped_angles(map, agent_m, &region.cells);
    let (low, high) = extremes(&angles);
    if high - low <= max_span_rad {
        regions.push(region);
        return;
    }
    let num_parts = ((high - low) / max_span_rad) as usize + 1;
    let limits = k_means_limits(&angles, low, high, num_parts);
    let mut parts = vec![Vec::new(); num_parts];
    for (cell, angle) in region.cells.into_iter().zip(angles) {
        parts[limits.partition_point(|&limit| limit <= angle)].push(cell);
    }
    regions.extend(parts.into_iter().filter(|part| !part.is_empty()).map(Region::new));
}

/// Return `[x, z]` from the agent to the middle of a cell.
fn offset_m(map: &OccupancyMap, agent_m: Vec2, cell: &[i32; 2]) -> Vec2 {
    let centre_m = map.spec().centre_m(cell.map(|i| i as usize));
    [centre_m[0] - agent_m[0], centre_m[1] - agent_m[1]]
}

/// Return the sum of the directions of cells seen from the agent, which points in the mean
/// direction.
pub(crate) fn mean_direction(map: &OccupancyMap, agent_m: Vec2, cells: &[[i32; 2]]) -> Vec2 {
    evonav_simd::compute(MeanDirection { spec: map.spec(), agent_m, cells })
}

struct MeanDirection<'a> {
    spec: &'a GridSpec,
    agent_m: Vec2,
    cells: &'a [[i32; 2]],
}

impl Kernel for MeanDirection<'_> {
    type Output = Vec2;

    /// Roots and quotients of eight cells at once, sums in the order of the cells.
    #[inline(always)]
    fn compute(self) -> Vec2 {
        let (corner_m, cell_m) = (self.spec.corner_m, self.spec.cell_m);
        let (mut sum_x, mut sum_z) = (0.0, 0.0);
        for some in self.cells.chunks(8) {
            let (mut xs, mut zs) = ([0.0; 8], [0.0; 8]);
            for ((x, z), cell) in xs.iter_mut().zip(&mut zs).zip(some) {
                *x = corner_m[0] + (f64::from(cell[1]) + 0.5) * cell_m - self.agent_m[0];
                *z = corner_m[1] + (f64::from(cell[0]) + 0.5) * cell_m - self.agent_m[1];
            }
            for (x, z) in xs.iter_mut().zip(&mut zs) {
                let length = (*x * *x + *z * *z).sqrt();
                let length = if length > 1e-9 { length } else { 1e-9 };
                (*x, *z) = (*x / length, *z / length);
            }
            for (x, z) in xs.iter().zip(&zs).take(some.len()) {
                (sum_x, sum_z) = (sum_x + x, sum_z + z);
            }
        }
        [sum_x, sum_z]
    }
}

/// Return whether a box of cells, two cells or more from the agent, spans less than an angle.
fn is_in_narrow_box(
    map: &OccupancyMap,
    agent_m: Vec2,
    &Span { low, high }: &Span,
    max_span_rad: f64,
) -> bool {
    let corners =
        [low, [low[0], high[1]], [high[0], low[1]], high].map(|cell| offset_m(map, agent_m, &cell));
    let ahead = [0, 1].map(|i| corners[0][i] + corners[3][i]);
    let away_m = 2.0 * map.spec().cell_m;
    let is_away = (0..2).any(|i| corners[0][i] > away_m || corners[3][i] < -away_m);
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for [x, z] in corners {
        let along = x * ahead[0] + z * ahead[1];
        if along <= 0.0 {
            return false;
        }
        let tangent = (x * ahead[1] - z * ahead[0]) / along;
        (least, most) = (least.min(tangent), most.max(tangent));
    }
    is_away && most.atan() - least.atan() < max_span_rad - 1e-9
}

/// Return whether cells surely span at most an angle, without an arc tangent for each cell.
fn is_narrow(map: &OccupancyMap, agent_m: Vec2, cells: &[[i32; 2]], max_span_rad: f64) -> bool {
    let ahead = mean_direction(map, agent_m, cells);
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for cell in cells {
        let [x, z] = offset_m(map, agent_m, cell);
        let along = x * ahead[0] + z * ahead[1];
        if along <= 0.0 {
            return false;
        }
        let tangent = (x * ahead[1] - z * ahead[0]) / along;
        (low, high) = (low.min(tangent), high.max(tangent));
    }
    high.atan() - low.atan() <= max_span_rad
}

/// Return the least and the largest of some angles.
fn extremes(angles: &[f64]) -> (f64, f64) {
    let widen = |(low, high): (f64, f64), &angle: &f64| (low.min(angle), high.max(angle));
    angles.iter().fold((f64::INFINITY, f64::NEG_INFINITY), widen)
}

/// Return the angles of cells seen from the agent (0 along +z, growing towards +x), unwrapped at
/// the widest gap so that neighbours do not differ by a turn.
fn unwrapped_angles(map: &OccupancyMap, agent_m: Vec2, cells: &[[i32; 2]]) -> Vec<f64> {
    let mut angles: Vec<f64> = cells
        .iter()
        .map(|cell| {
            let [x, z] = offset_m(map, agent_m, cell);
            x.atan2(z)
        })
        .collect();
    // Only a region on both sides of the cut behind the agent needs another cut.
    let is_near_cut = |angle: &f64| angle.abs() > 0.5 * PI;
    if angles.iter().any(|a| is_near_cut(a) && *a < 0.0)
        && angles.iter().any(|a| is_near_cut(a) && *a > 0.0)
    {
        let (low, high) = extremes(&angles);
        // The least and the largest angle of equal parts, as many as angles: the widest gap is
        // wider than a part.
        let mut parts = vec![(f64::INFINITY, f64::NEG_INFINITY); angles.len()];
        let per_rad = angles.len() as f64 / (high - low);
        for &angle in &angles {
            let part = ((angle - low) * per_rad) as usize;
            let (least, most) = &mut parts[part.min(angles.len() - 1)];
            (*least, *most) = (least.min(angle), most.max(angle));
        }
        let (mut widest, mut before) = ((low + TAU - high, -PI), high);
        for (least, most) in parts.into_iter().filter(|(least, most)| least <= most) {
            if least - before > widest.0 {
                widest = (least - before, least);
            }
            before = most;
        }
        for angle in &mut angles {
            if *angle < widest.1 {
                *angle += TAU;
            }
        }
    }
    angles
}

/// Return the borders between the `num_parts` clusters of one-dimensional k-centres, started evenly
/// spread.
fn k_means_limits(values: &[f64], low: f64, high: f64, num_parts: usize) -> Vec<f64> {
    let mut centres: Vec<f64> =
        (0..num_parts).map(|i| low + (high - low) * (i as f64 + 0.5) / num_parts as f64).collect();
    let mut limits = Vec::new();
    for _ in 0..100 {
        let middle: Vec<f64> = centres.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        if middle == limits {
            break;
        }
        limits = middle;
        for (part, centres) in centres.chunks_mut(2).enumerate() {
            let low = if part == 0 { f64::NEG_INFINITY } else { limits[2 * part - 1] };
            let [middle, high] =
                [2 * part, 2 * part + 1].map(|i| limits.get(i).copied().unwrap_or(f64::INFINITY));
            // Two sums at a time, which stay in registers.
            let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
            for &value in values {
                let is_in = [low <= value && value < middle, middle <= value && value < high];
                for ((sum, count), is_in) in sums.iter_mut().zip(&mut counts).zip(is_in) {
                    *sum += if is_in { value } else { 0.0 };
                    *count += if is_in { 1.0 } else { 0.0 };
                }
            }
            for ((mean, sum), count) in centres.iter_mut().zip(sums).zip(counts) {
                if count > 0.0 {
                    *mean = sum / count;
                }
            }
        }
    }
    limits
}
