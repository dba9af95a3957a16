//! Dilation, fast marching, frontiers and short-term goals against plain twins, cell by cell.

use std::collections::{BTreeSet, VecDeque};

use evonav_core::{
    geometry::Pose,
    grid::{
        GridSpec,
        bits::BitGrid,
        dilate::dilate_disk,
        fast_marching::{Field, Until, Window, flood, march},
    },
    unigoal::{
        collision_strip::{Strip, strip_cells},
        exploration::keep_large,
        path_planning::short_term_goal,
    },
};
use proptest::{collection::vec, prelude::*, sample::select};

fn grid_of(bits: &[bool], cols: usize) -> BitGrid {
    let mut grid = BitGrid::new(bits.len() / cols, cols);
    for (i, _) in bits.iter().enumerate().filter(|(_, bit)| **bit) {
        grid.insert(i / cols, i % cols);
    }
    grid
}

/// Cells of which most are set, or few.
fn cells(most: bool) -> impl Strategy<Value = (usize, Vec<bool>)> {
    let choice = if most { [true, true, true, false] } else { [false, false, false, true] };
    (1..14_usize, 1..90_usize)
        .prop_flat_map(move |(rows, cols)| (Just(cols), vec(select(choice.to_vec()), rows * cols)))
}

fn whole(grid: &BitGrid) -> Window {
    Window { first: [0, 0], shape: [grid.rows(), grid.cols()] }
}

fn dilate_naive(grid: &BitGrid, radius: usize) -> BTreeSet<[usize; 2]> {
    let mut found = BTreeSet::new();
    for row in 0..grid.rows() {
        for col in 0..grid.cols() {
            let is_near = |c: [usize; 2]| {
                c[0].abs_diff(row).pow(2) + c[1].abs_diff(col).pow(2) <= radius * radius
            };
            if grid.cells().any(is_near) {
                found.insert([row, col]);
            }
        }
    }
    found
}

/// Fast marching by the textbook, every step a search through all cells, in double precision.
fn march_naive(passable: &BitGrid, seeds: &BitGrid) -> Vec<f64> {
    let (rows, cols) = (passable.rows() as i64, passable.cols() as i64);
    let at = |r: i64, c: i64| (r * cols + c) as usize;
    let is_open = |r: i64, c: i64| {
        (0..rows).contains(&r)
            && (0..cols).contains(&c)
            && (passable.get(r as usize, c as usize) || seeds.get(r as usize, c as usize))
    };
    let mut trial = vec![f64::INFINITY; (rows * cols) as usize];
    for [r, c] in seeds.cells().map(|cell| cell.map(|i| i as i64)) {
        trial[at(r, c)] = 0.0;
    }
    for [r, c] in seeds.cells().map(|cell| cell.map(|i| i as i64)) {
        for (dr, dc) in [(-1, -1), (-1, 1), (1, -1), (1, 1)] {
            if is_open(r + dr, c) && is_open(r, c + dc) && is_open(r + dr, c + dc) {
                let index = at(r + dr, c + dc);
                trial[index] = trial[index].min(2.0_f64.sqrt());
            }
        }
    }
    let mut done = vec![f64::INFINITY; trial.len()];
    loop {
        let open = (0..trial.len()).filter(|&i| done[i].is_infinite() && trial[i].is_finite());
        let Some(next) = open.min_by(|&a, &b| trial[a].total_cmp(&trial[b])) else { break };
        done[next] = trial[next];
        let (row, col) = (next as i64 / cols, next as i64 % cols);
        for (r, c) in [(row - 1, col), (row + 1, col), (row, col - 1), (row, col + 1)] {
            if !is_open(r, c) || done[at(r, c)].is_finite() {
                continue;
            }
            let value = |r: i64, c: i64| if is_open(r, c) { done[at(r, c)] } else { f64::INFINITY };
            // a d^2 - 2 b d + c = 1, term by term.
            let mut terms: Vec<(f64, f64, f64)> = Vec::new();
            for (dr, dc) in [(1, 0), (0, 1)] {
                let (minus, plus) = (value(r - dr, c - dc), value(r + dr, c + dc));
                let sign = if plus < minus { 1 } else { -1 };
                let near = minus.min(plus);
                let far = value(r + 2 * sign * dr, c + 2 * sign * dc);
                if near.is_finite() {
                    let is_second = far < near;
                    let offset = if is_second { (4.0 * near - far) / 3.0 } else { near };
                    terms.push((if is_second { 9.0 / 4.0 } else { 1.0 }, offset, near));
                }
            }
            let alone = |t: &(f64, f64, f64)| t.1 + 1.0 / t.0.sqrt();
            let a: f64 = terms.iter().map(|t| t.0).sum();
            let b: f64 = terms.iter().map(|t| t.0 * t.1).sum();
            let k: f64 = terms.iter().map(|t| t.0 * t.1 * t.1).sum::<f64>() - 1.0;
            let root = (b + (b * b - a * k).sqrt()) / a;
            let is_upwind = terms.iter().all(|t| root >= t.2);
            let single = terms.iter().map(alone).fold(f64::INFINITY, f64::min);
            let found = if is_upwind { root } else { single };
            trial[at(r, c)] = trial[at(r, c)].min(found);
        }
    }
    done
}

/// Steps of 1 along rows and columns, and of sqrt(2) if `diagonal`, cutting corners.
fn dijkstra(passable: &BitGrid, seeds: &BitGrid, diagonal: bool) -> Vec<f64> {
    let (rows, cols) = (passable.rows() as i64, passable.cols() as i64);
    let is_open = |r: i64, c: i64| {
        r >= 0 && c >= 0 && r < rows && c < cols && {
            let (r, c) = (r as usize, c as usize);
            passable.get(r, c) || seeds.get(r, c)
        }
    };
    let mut distances = vec![f64::INFINITY; (rows * cols) as usize];
    let mut queue: VecDeque<[i64; 2]> = seeds.cells().map(|c| c.map(|i| i as i64)).collect();
    queue.iter().for_each(|[r, c]| distances[(r * cols + c) as usize] = 0.0);
    while let Some([r, c]) = queue.pop_front() {
        let here = distances[(r * cols + c) as usize];
        for dr in -1..=1_i64 {
            for dc in -1..=1_i64 {
                let is_way = is_open(r + dr, c + dc) && (diagonal || dr == 0 || dc == 0);
                if !is_way {
                    continue;
                }
                let there = here + ((dr * dr + dc * dc) as f64).sqrt();
                let kept = &mut distances[((r + dr) * cols + c + dc) as usize];
                if there < *kept - 1e-12 {
                    *kept = there;
                    queue.push_back([r + dr, c + dc]);
                }
            }
        }
    }
    distances
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..Default::default() })]

    #[test]
    fn a_disk_reaches_as_far_as_its_radius((cols, bits) in cells(false), radius in 0..12_usize) {
        let grid = grid_of(&bits, cols);
        let found: BTreeSet<[usize; 2]> = dilate_disk(&grid, radius).cells().collect();
        prop_assert_eq!(found, dilate_naive(&grid, radius));
    }

    #[test]
    fn the_front_is_that_of_the_textbook(
        (cols, bits) in cells(true), picks in vec(any::<prop::sample::Index>(), 1..4),
    ) {
        let passable = grid_of(&bits, cols);
        let mut seeds = BitGrid::new(passable.rows(), cols);
        for pick in picks {
            let at = pick.index(bits.len());
            seeds.insert(at / cols, at % cols);
        }
        let field = march(&passable, &seeds, whole(&passable), Until::Never);
        let naive = march_naive(&passable, &seeds);
        let (fewest, most) = (dijkstra(&passable, &seeds, true), dijkstra(&passable, &seeds, false));
        for (i, &distance) in field.distances.iter().enumerate() {
            let (distance, naive) = (f64::from(distance), naive[i]);
            prop_assert_eq!(distance.is_finite(), naive.is_finite());
            if naive.is_finite() {
                // Rounding may decide between first and second order, which are so far apart.
                prop_assert!((distance - naive).abs() < 0.01 + 0.005 * naive, "{distance} {naive}");
                // Steps along the axes are the longest way there is; diagonal ones are at most 8.3% too long.
                prop_assert!(distance <= most[i] + 1e-3, "{distance} {}", most[i]);
                prop_assert!(distance >= fewest[i] / 1.083 - 0.3, "{distance} {}", fewest[i]);
            }
        }
    }

    /// Stopping early changes nothing of what is nearer.
    #[test]
    fn a_front_that_stops_early_is_the_same_up_to_there(
        (cols, bits) in cells(true), seed in any::<prop::sample::Index>(), end in any::<prop::sample::Index>(),
    ) {
        let passable = grid_of(&bits, cols);
        let mut seeds = BitGrid::new(passable.rows(), cols);
        let (seed, end) = (seed.index(bits.len()), end.index(bits.len()));
        seeds.insert(seed / cols, seed % cols);
        let full = march(&passable, &seeds, whole(&passable), Until::Never);
        let target = [end / cols, end % cols];
        let part = march(&passable, &seeds, whole(&passable), Until::All(&[target]));
        prop_assert_eq!(part.at(target), full.at(target));
        let nearer = |d: f32| d < full.at(target);
        for (part, full) in part.distances.iter().zip(&full.distances) {
            prop_assert!(!nearer(*full) || part == full);
        }
    }

    /// The nearest of the cells that the front may stop at is where it stops.
    #[test]
    fn a_front_that_may_stop_anywhere_stops_at_the_nearest(
        (cols, bits) in cells(true), seed in any::<prop::sample::Index>(),
        ends in vec(any::<prop::sample::Index>(), 1..6),
    ) {
        let passable = grid_of(&bits, cols);
        let at = |index: &prop::sample::Index| [index.index(bits.len()) / cols, index.index(bits.len()) % cols];
        let mut seeds = BitGrid::new(passable.rows(), cols);
        seeds.insert(at(&seed)[0], at(&seed)[1]);
        let mut goals = BitGrid::new(passable.rows(), cols);
        ends.iter().for_each(|end| goals.insert(at(end)[0], at(end)[1]));
        let full = march(&passable, &seeds, whole(&passable), Until::Never);
        let nearest = goals.cells().map(|c| full.at(c)).fold(f32::INFINITY, f32::min);
        let part = march(&passable, &seeds, whole(&passable), Until::Any(&goals));
        let last = part.last.unwrap();
        if nearest.is_finite() {
            prop_assert!(goals.get(last[0], last[1]));
            prop_assert_eq!(full.at(last), nearest);
        }
        // What a front reaches over passable cells is what a flood reaches.
        let reached = flood(&passable, at(&seed), whole(&passable));
        for row in 0..passable.rows() {
            for col in 0..cols {
                prop_assert_eq!(reached.get(row, col), full.at([row, col]).is_finite());
            }
        }
    }

    #[test]
    fn groups_are_those_of_a_flood((cols, bits) in cells(false), min_cells in 1..9_usize) {
        let grid = grid_of(&bits, cols);
        let mut left: BTreeSet<[usize; 2]> = grid.cells().collect();
        let mut expected = BTreeSet::new();
        while let Some(first) = left.pop_first() {
            let mut group = BTreeSet::from([first]);
            loop {
                let touches = |c: &[usize; 2]| {
                    group.iter().any(|g| g[0].abs_diff(c[0]) <= 1 && g[1].abs_diff(c[1]) <= 1)
                };
                let more: Vec<[usize; 2]> = left.iter().copied().filter(touches).collect();
                if more.is_empty() {
                    break;
                }
                more.iter().for_each(|c| { left.remove(c); });
                group.extend(more);
            }
            if group.len() >= min_cells {
                expected.extend(group);
            }
        }
        let kept: BTreeSet<[usize; 2]> = keep_large(&grid, min_cells).cells().collect();
        prop_assert_eq!(kept, expected);
    }

    #[test]
    fn the_short_term_goal_is_the_best_of_the_circle(
        (cols, bits) in cells(true), seed in any::<prop::sample::Index>(),
        position in [0.0..14.0_f64, 0.0..90.0], radius in 2..7_usize,
    ) {
        let passable = grid_of(&bits, cols);
        let mut seeds = BitGrid::new(passable.rows(), cols);
        let seed = seed.index(bits.len());
        seeds.insert(seed / cols, seed % cols);
        let field = march(&passable, &seeds, whole(&passable), Until::Never);
        let own = field.at(position.map(|p| p as usize));
        let mut best: Option<([usize; 2], f32)> = None;
        for row in 0..passable.rows() {
            for col in 0..cols {
                let far = (row as f64 + 0.5 - position[0]).hypot(col as f64 + 0.5 - position[1]);
                let gain = own - field.at([row, col]);
                let is_candidate = far <= radius as f64
                    && far > radius as f64 - 1.0
                    && gain > 1e-4
                    && f64::from(gain) <= 1.5 * far.max(radius as f64);
                if own.is_finite() && is_candidate && best.is_none_or(|b| gain > b.1) {
                    best = Some(([row, col], gain));
                }
            }
        }
        let found = short_term_goal(&field, position, radius).map(|g| (g.cell, g.gain));
        prop_assert_eq!(found, best);
    }

    /// A strip lies ahead, is as wide and long as asked, and turns with the agent.
    #[test]
    fn a_strip_lies_ahead(
        x in 3.0..7.0_f64, z in 3.0..7.0_f64, yaw_rad in -4.0..4.0_f64,
        start in 0..6_usize, length in 1..5_usize, width in select(vec![1_usize, 3, 5, 7]),
    ) {
        let spec = GridSpec { rows: 200, cols: 200, cell_m: 0.05, corner_m: [0.0, 0.0] };
        let pose = Pose { position_m: [x, 0.9, z], yaw_rad, horizon_rad: 0.5 };
        let cells = strip_cells(&spec, &pose, Strip { start, length, width });
        prop_assert_eq!(cells.len(), length * width);
        for cell in cells {
            let [cx, cz] = spec.centre_m(cell);
            let ahead = (cx - x) * yaw_rad.sin() + (cz - z) * yaw_rad.cos();
            let right = (cx - x) * yaw_rad.cos() - (cz - z) * yaw_rad.sin();
            // Half a cell's diagonal off at most.
            let span = [start as f64 * 0.05 - 0.036, (start + length - 1) as f64 * 0.05 + 0.036];
            prop_assert!((span[0]..=span[1]).contains(&ahead), "{ahead} {span:?}");
            prop_assert!(right.abs() <= (width / 2) as f64 * 0.05 + 0.036, "{right}");
        }
    }
}

fn open(rows: usize, cols: usize) -> BitGrid {
    let mut grid = BitGrid::new(rows, cols);
    (0..rows).for_each(|row| grid.insert_run(row, 0, cols));
    grid
}

fn front(passable: &BitGrid, seed: [usize; 2]) -> Field {
    let mut seeds = BitGrid::new(passable.rows(), passable.cols());
    seeds.insert(seed[0], seed[1]);
    march(passable, &seeds, whole(passable), Until::Never)
}

#[test]
fn free_space_is_euclidean_within_two_percent() {
    let field = front(&open(201, 201), [100, 100]);
    for row in 0..201_usize {
        for col in 0..201_usize {
            let straight = (row as f64 - 100.0).hypot(col as f64 - 100.0);
            let found = f64::from(field.at([row, col]));
            assert!(
                (found - straight).abs() <= 0.02 * straight + 0.1,
                "{row} {col}: {found} {straight}"
            );
        }
    }
}

#[test]
fn a_wall_is_walked_around_its_end() {
    // A wall along row 60, open only beyond column 140.
    let mut passable = open(121, 201);
    (0..140).for_each(|col| passable.remove(60, col));
    let field = front(&passable, [20, 20]);
    let corner = [60.0, 140.0];
    let leg = |from: [f64; 2]| (corner[0] - from[0]).hypot(corner[1] - from[1]);
    for end in [[100_usize, 20_usize], [119, 100], [70, 80]] {
        let way = leg([20.0, 20.0]) + leg(end.map(|i| i as f64));
        let found = f64::from(field.at(end));
        assert!((found / way - 1.0).abs() < 0.02, "{end:?}: {found} {way}");
    }
    assert!(field.at([60, 10]).is_infinite());
    // Downhill all the way: no cell is a local minimum but the seed.
    for row in 0..121_usize {
        for col in 0..201_usize {
            let own = field.at([row, col]);
            let around = [
                [row.wrapping_sub(1), col],
                [row + 1, col],
                [row, col.wrapping_sub(1)],
                [row, col + 1],
            ];
            let is_minimum = around.iter().all(|&c| field.at(c) >= own);
            assert!(own.is_infinite() || !is_minimum || own == 0.0, "{row} {col}");
        }
    }
}

#[test]
fn a_window_off_the_grid_and_an_empty_grid_are_no_trouble() {
    let passable = open(5, 5);
    let window = Window { first: [9, 9], shape: [usize::MAX, 3] };
    assert!(march(&passable, &passable, window, Until::Never).distances.is_empty());
    let nothing = BitGrid::new(0, 0);
    assert!(march(&nothing, &nothing, whole(&nothing), Until::All(&[[3, 3]])).distances.is_empty());
    assert_eq!(dilate_disk(&nothing, 3).count(), 0);
    let field = front(&passable, [0, 0]);
    for position in [[f64::NAN, 1.0], [-1.0, 1.0], [1e300, 2.0], [f64::INFINITY, 0.0]] {
        assert_eq!(short_term_goal(&field, position, 5), None);
    }
}

#[test]
fn what_is_beyond_a_thin_wall_is_no_short_term_goal() {
    // The goal is just behind the wall; the way leads around its far end.
    let mut passable = open(41, 101);
    (0..90).for_each(|col| passable.remove(20, col));
    let field = front(&passable, [23, 10]);
    let goal = short_term_goal(&field, [18.5, 10.5], 5).unwrap();
    assert!(goal.cell[0] < 20 && goal.cell[1] > 12, "{goal:?}");
}
