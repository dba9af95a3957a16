//! The occupancy map and its frontiers against plain twins, cell by cell.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::Arc,
};

use evonav_core::{
    Error,
    grid::{GridSpec, bits::BitGrid, components::Components},
    memory::{
        frontiers::{Frontier, FrontierConfig, Frontiers},
        occupancy::{BLOCKED, FREE, OccupancyMap, UNKNOWN},
    },
    sensors::visible_cells::{VisibleCells, visible_cells},
};
use proptest::{collection::vec, prelude::*, sample::select};

pub(super) type Cell = [i32; 2];

/// The frontiers of a map without a history.
fn extract(
    map: &OccupancyMap,
    agent_m: [f64; 2],
    config: &FrontierConfig,
) -> Result<Vec<Arc<Frontier>>, Error> {
    Frontiers::default().update(map, agent_m, config).map(<[_]>::to_vec)
}

pub(super) fn spec(rows: usize, cols: usize) -> GridSpec {
    GridSpec { rows, cols, cell_m: 0.1, corner_m: [-1.0, 0.5] }
}

fn neighbours4([row, col]: Cell) -> [Cell; 4] {
    [[row - 1, col], [row, col - 1], [row, col + 1], [row + 1, col]]
}

/// Breadth-first components in the order of their first cells.
pub(super) fn components_naive(cells: &BTreeSet<Cell>) -> Vec<BTreeSet<Cell>> {
    let mut left = cells.clone();
    let mut components = Vec::new();
    while let Some(first) = left.pop_first() {
        let (mut component, mut queue) = (BTreeSet::from([first]), VecDeque::from([first]));
        while let Some(cell) = queue.pop_front() {
            for next in neighbours4(cell) {
                if left.remove(&next) {
                    component.insert(next);
                    queue.push_back(next);
                }
            }
        }
        components.push(component);
    }
    components
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    #[test]
    fn components_are_those_of_a_flood(
        (rows, cols, bits) in (1..9_usize, 1..140_usize).prop_flat_map(|(rows, cols)| {
            (Just(rows), Just(cols), vec(select(&[true, true, false][..]), rows * cols))
        }),
    ) {
        let mut grid = BitGrid::new(rows, cols);
        let mut cells = BTreeSet::new();
        for (i, _) in bits.iter().enumerate().filter(|(_, bit)| **bit) {
            grid.insert(i / cols, i % cols);
            cells.insert([(i / cols) as i32, (i % cols) as i32]);
        }
        prop_assert_eq!(grid.count(), cells.len());
        let listed: Vec<Cell> = grid.cells().map(|c| c.map(|i| i as i32)).collect();
        prop_assert!(listed.iter().eq(cells.iter()));
        let components = Components::new(&grid);
        let found: Vec<BTreeSet<Cell>> = components
            .by_component()
            .iter()
            .map(|runs| runs.iter().flat_map(|r| r.cells()).map(|c| c.map(|i| i as i32)).collect())
            .collect();
        prop_assert_eq!(&found, &components_naive(&cells));
        for (i, bit) in bits.iter().enumerate() {
            let cell = [(i / cols) as i32, (i % cols) as i32];
            let expected = found.iter().position(|component| component.contains(&cell));
            prop_assert_eq!(components.of_cell(i / cols, i % cols), expected.filter(|_| *bit));
        }
    }

    #[test]
    fn runs_fill_what_single_cells_would(cols in 1..200_usize, start in 0..210_usize, len in 0..210_usize) {
        let (mut runs, mut cells) = (BitGrid::new(2, cols), BitGrid::new(2, cols));
        runs.insert_run(1, start, start + len);
        (start..start + len).for_each(|col| cells.insert(1, col));
        prop_assert_eq!(runs, cells);
    }

    /// What is remembered is the last thing seen; conflicts are what it contradicts.
    #[test]
    fn the_map_is_a_dictionary_of_the_last_observations(
        views in vec((vec((0..6_i32, 0..70_i32, any::<bool>()), 0..40), [-0.5..5.5, 0.6..1.0]), 1..6),
        assumed in proptest::option::of(([-0.9..5.9, 0.6..1.0], 0.0..0.4)),
    ) {
        let spec = spec(6, 70);
        let mut map = OccupancyMap::new(spec).expect("a valid grid");
        let (mut state, mut explored) = (BTreeMap::new(), BTreeSet::new());
        let distance = |cell: Cell, point: [f64; 2]| {
            let centre = spec.centre_m(cell.map(|i| i as usize));
            (centre[0] - point[0]).hypot(centre[1] - point[1])
        };
        if let Some((centre, radius)) = assumed {
            map.assume_free(centre, radius).unwrap();
            for cell in (0..6).flat_map(|row| (0..70).map(move |col| [row, col])) {
                if distance(cell, centre) < radius {
                    state.insert(cell, (FREE, false));
                    explored.insert(cell);
                }
            }
        }
        for (cells, origin_m) in views {
            let cells: BTreeMap<Cell, bool> =
                cells.into_iter().map(|(row, col, is_free)| ([row, col], is_free)).collect();
            let of = |wanted: bool| cells.iter().filter(|(_, f)| **f == wanted).map(|(c, _)| *c).collect();
            let seen = VisibleCells { free: of(true), blocked: of(false) };
            let contradicts = |cell: &&Cell, before: u8| state.get(*cell) == Some(&(before, true));
            let freed: Vec<Cell> = seen.free.iter().filter(|c| contradicts(c, BLOCKED)).copied().collect();
            let obstructed: Vec<Cell> = seen.blocked.iter().filter(|c| contradicts(c, FREE)).copied().collect();
            prop_assert_eq!(&map.conflicts(&seen).unwrap(), &map.clone().integrate(&seen, origin_m, 1.7).unwrap());
            let conflicts = map.integrate(&seen, origin_m, 1.7).unwrap();
            prop_assert_eq!(conflicts.len(), freed.len() + obstructed.len());
            prop_assert_eq!((conflicts.freed, conflicts.obstructed), (freed, obstructed));
            for (cell, is_free) in cells {
                state.insert(cell, (if is_free { FREE } else { BLOCKED }, true));
                if distance(cell, origin_m) < 1.7 {
                    explored.insert(cell);
                }
            }
            let (found, found_explored) = (map.cells(), map.explored().to_bools());
            for (i, value) in found.into_iter().enumerate() {
                let cell = [(i / 70) as i32, (i % 70) as i32];
                prop_assert_eq!(value, state.get(&cell).map_or(UNKNOWN, |s| s.0));
                prop_assert_eq!(found_explored[i], explored.contains(&cell));
            }
        }
        let cells: Vec<Cell> = state.keys().copied().collect();
        map.forget(&cells).unwrap();
        prop_assert_eq!(map, OccupancyMap::new(spec).expect("a valid grid"));
    }
}

/// A floor plan and a walk over it, seen through real visibility.
pub(super) fn walked(seed: u64, num_steps: usize, side: usize) -> (OccupancyMap, [f64; 2]) {
    let mut stream = evonav_core::rng::Stream::new(seed, &["walk"]);
    let spec = spec(side, side);
    let mut blocked = vec![0_u8; spec.len()];
    for _ in 0..side / 4 {
        let (row, col) = (stream.below(side), stream.below(side));
        let (height, width) = (1 + stream.below(3), 1 + stream.below(side / 3));
        let is_upright = stream.below(2) == 0;
        for r in 0..height {
            for c in 0..width {
                let at = if is_upright { [row + c, col + r] } else { [row + r, col + c] };
                if at[0] < side && at[1] < side {
                    blocked[spec.index(at)] = 1;
                }
            }
        }
    }
    let mut map = OccupancyMap::new(spec).expect("a valid grid");
    let mut origin_m = spec.centre_m([side / 2, side / 2]);
    for _ in 0..num_steps {
        let yaw_rad = stream.uniform() * 6.0;
        let seen =
            visible_cells(&blocked, &spec, origin_m, yaw_rad, 2.0, 3.0).expect("a valid view");
        map.integrate(&seen, origin_m, 1.0).expect("cells of the map");
        if !seen.free.is_empty() {
            let next = seen.free[stream.below(seen.free.len())];
            origin_m = spec.centre_m(next.map(|i| i as usize));
        }
    }
    (map, origin_m)
}

/// Regions by the rule's words: the agent's island, eight unexplored neighbours, 4-connected, large enough.
fn regions_naive(map: &OccupancyMap, agent_m: [f64; 2], min_cells: usize) -> Vec<BTreeSet<Cell>> {
    let spec = *map.spec();
    let all: Vec<Cell> = (0..spec.rows as i32)
        .flat_map(|row| (0..spec.cols as i32).map(move |col| [row, col]))
        .collect();
    let (cells, explored) = (map.cells(), map.explored().to_bools());
    let at = |cell: Cell| spec.index(cell.map(|i| i as usize));
    let is_on =
        |[row, col]: Cell| row >= 0 && col >= 0 && row < spec.rows as i32 && col < spec.cols as i32;
    let free: BTreeSet<Cell> = all.iter().copied().filter(|&c| cells[at(c)] == FREE).collect();
    let islands = components_naive(&free);
    let distance = |cell: &Cell| {
        let centre = spec.centre_m(cell.map(|i| i as usize));
        (centre[0] - agent_m[0]).hypot(centre[1] - agent_m[1])
    };
    let nearest = free.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let own = spec.cell_of(agent_m).map(|c| c.map(|i| i as i32)).filter(|c| free.contains(c));
    let Some(start) = own.or(nearest.copied()) else { return Vec::new() };
    let island = islands.into_iter().find(|island| island.contains(&start)).expect("an island");
    let num_unexplored = |[row, col]: Cell| {
        let around = (-1..=1).flat_map(|r| (-1..=1).map(move |c| [row + r, col + c]));
        around.filter(|&c| c != [row, col] && is_on(c) && !explored[at(c)]).count()
    };
    if !island.iter().any(|&c| (4..=6).contains(&num_unexplored(c))) {
        return Vec::new();
    }
    let inner = island.into_iter().filter(|&c| num_unexplored(c) == 8).collect();
    let regions = components_naive(&inner);
    regions.into_iter().filter(|region| region.len() >= min_cells.max(2)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..Default::default() })]

    #[test]
    fn frontiers_cover_the_regions_of_the_plain_rule(
        seed in any::<u64>(), num_steps in 1..12_usize, side in 20..90_usize, min_cells in 1..40_usize,
    ) {
        let (map, agent_m) = walked(seed, num_steps, side);
        let config = FrontierConfig { min_cells, min_border_cells: 0, ..Default::default() };
        let frontiers = extract(&map, agent_m, &config).unwrap();
        let naive = regions_naive(&map, agent_m, min_cells);
        // A region split by angle gives several frontiers; together they are the region.
        let mut merged: Vec<BTreeSet<Cell>> = vec![BTreeSet::new(); naive.len()];
        for frontier in &frontiers {
            let index = naive.iter().position(|r| r.contains(&frontier.cells[0])).unwrap();
            for cell in &frontier.cells {
                prop_assert!(naive[index].contains(cell) && merged[index].insert(*cell));
            }
        }
        prop_assert_eq!(&merged, &naive);
        for (index, frontier) in frontiers.iter().enumerate() {
            prop_assert_eq!(frontier.id, index as u64);
            prop_assert!(frontier.cells.is_sorted());
            let [row, col] = map.spec().cell_of(frontier.position_m).unwrap();
            prop_assert!(map.free().get(row, col));
        }
        for region in &naive {
            let num_parts = frontiers.iter().filter(|f| region.contains(&f.cells[0])).count();
            let cells: Vec<Cell> = region.iter().copied().collect();
            let span = span_rad(&map, agent_m, &cells) / config.max_span_rad;
            prop_assert!(num_parts <= span as usize + 1 && (num_parts > 1) == (span > 1.0), "{span}");
            // Every cell lies nearest to the mean angle of its own part, where no cut is behind the agent.
            let angle = |cell: &Cell| {
                let centre = map.spec().centre_m(cell.map(|i| i as usize));
                (centre[0] - agent_m[0]).atan2(centre[1] - agent_m[1])
            };
            let parts = frontiers.iter().filter(|f| region.contains(&f.cells[0]));
            let parts: Vec<Vec<f64>> = parts.map(|f| f.cells.iter().map(angle).collect()).collect();
            let means = parts.iter().map(|part| part.iter().sum::<f64>() / part.len() as f64);
            let means: Vec<f64> = means.collect();
            let is_cut = [-1.0, 1.0].map(|side| parts.iter().flatten().any(|a| side * a > 1.57)) == [true; 2];
            for (part, own) in parts.iter().zip(&means).filter(|_| !is_cut) {
                let is_own = |a: &f64| means.iter().all(|other| (a - own).abs() <= (a - other).abs() + 1e-9);
                prop_assert!(part.iter().all(is_own), "{parts:?}");
            }
        }
    }

    /// New frontiers leave out the cells of those that stay.
    #[test]
    fn no_cell_belongs_to_two_frontiers(seed in any::<u64>(), side in 20..90_usize) {
        let config = FrontierConfig { min_cells: 3, min_border_cells: 0, ..Default::default() };
        let mut frontiers = Frontiers::default();
        for num_steps in 1..16 {
            let (map, agent_m) = walked(seed, num_steps, side);
            let list = frontiers.update(&map, agent_m, &config).unwrap();
            let cells: Vec<Cell> = list.iter().flat_map(|f| f.cells.iter().copied()).collect();
            prop_assert_eq!(cells.iter().collect::<BTreeSet<_>>().len(), cells.len());
        }
    }

    /// Only without regions: unknown cells beside the island, each group looked at from beside it.
    #[test]
    fn the_unknown_beside_the_known_is_the_last_resort(
        seed in any::<u64>(), num_steps in 1..12_usize, side in 20..60_usize,
    ) {
        let (map, agent_m) = walked(seed, num_steps, side);
        let config = FrontierConfig { min_cells: 500, min_border_cells: 1, ..Default::default() };
        let frontiers = extract(&map, agent_m, &config).unwrap();
        prop_assume!(regions_naive(&map, agent_m, 500).is_empty());
        let own = map.spec().cell_of(agent_m).unwrap().map(|i| i as i32);
        let cells = map.cells();
        let of = |value: u8| -> BTreeSet<Cell> {
            let all = (0..side as i32).flat_map(|row| (0..side as i32).map(move |col| [row, col]));
            all.filter(|c| cells[c[0] as usize * side + c[1] as usize] == value).collect()
        };
        let islands = components_naive(&of(FREE));
        let island = islands.into_iter().find(|i| i.contains(&own));
        prop_assume!(island.is_some());
        let island = island.unwrap();
        let mut expected = of(UNKNOWN);
        expected.retain(|c| neighbours4(*c).iter().any(|n| island.contains(n)));
        let found: BTreeSet<Cell> = frontiers.iter().flat_map(|f| f.cells.iter().copied()).collect();
        prop_assert_eq!(found.len(), frontiers.iter().map(|f| f.cells.len()).sum::<usize>());
        prop_assert_eq!(found, expected);
        for frontier in &frontiers {
            let at = map.spec().cell_of(frontier.position_m).unwrap().map(|i| i as i32);
            prop_assert!(island.contains(&at) && frontier.cells.is_sorted());
            prop_assert!(neighbours4(at).iter().any(|n| frontier.cells.contains(n)));
        }
    }

    #[test]
    fn an_unchanged_map_keeps_every_frontier_and_a_cleared_one_counts_on(
        seed in any::<u64>(), num_steps in 1..12_usize,
    ) {
        let (map, agent_m) = walked(seed, num_steps, 70);
        let config = FrontierConfig { min_border_cells: 0, ..Default::default() };
        let mut frontiers = Frontiers::default();
        let first = frontiers.update(&map, agent_m, &config).unwrap().to_vec();
        prop_assert_eq!(&first, frontiers.update(&map, agent_m, &config).unwrap());
        frontiers.clear();
        let again = frontiers.update(&map, agent_m, &config).unwrap();
        for (old, new) in first.iter().zip(again) {
            prop_assert_eq!((old.id + first.len() as u64, &old.cells), (new.id, &new.cells));
        }
    }
}

/// Smallest angle that holds all cells, seen from the agent.
fn span_rad(map: &OccupancyMap, agent_m: [f64; 2], cells: &[Cell]) -> f64 {
    let mut angles: Vec<f64> = cells
        .iter()
        .map(|cell| {
            let centre = map.spec().centre_m(cell.map(|i| i as usize));
            (centre[0] - agent_m[0]).atan2(centre[1] - agent_m[1])
        })
        .collect();
    angles.sort_by(f64::total_cmp);
    let around = angles[0] + std::f64::consts::TAU - angles[angles.len() - 1];
    let widest = angles.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f64::max);
    std::f64::consts::TAU - widest
}

#[test]
fn a_frontier_looks_from_the_edge_of_the_explored_into_the_open() {
    // A corridor along +x, 12 cells wide; the agent stands at its western end.
    let spec = spec(12, 80);
    let blocked = vec![0; spec.len()];
    let mut map = OccupancyMap::new(spec).unwrap();
    let agent_m = [-0.45, 1.15];
    let seen = visible_cells(&blocked, &spec, agent_m, 1.57, 3.0, 3.0).unwrap();
    map.integrate(&seen, agent_m, 1.7).unwrap();
    let frontiers = extract(&map, agent_m, &FrontierConfig::default()).unwrap();
    assert_eq!(frontiers.len(), 1, "{frontiers:?}");
    let east = &frontiers[0];
    assert!((east.direction_rad - 1.57).abs() < 0.1, "{}", east.direction_rad);
    assert!((east.position_m[0] - (agent_m[0] + 1.7)).abs() < 0.3, "{:?}", east.position_m);
    map.explore_around([0.5, 1.1], 9.0).unwrap();
    let config = FrontierConfig { min_border_cells: 0, ..Default::default() };
    assert!(extract(&map, agent_m, &config).unwrap().is_empty());
    // What is left is the unknown end of the corridor, until the agent has stood there in vain.
    let mut frontiers = Frontiers::default();
    let config = FrontierConfig::default();
    let mut agent_m = agent_m;
    for _ in 0..20 {
        match frontiers.update(&map, agent_m, &config).unwrap() {
            [] => return,
            list => agent_m = list[0].position_m,
        }
    }
    panic!("the agent looks at the same unknown cells for ever");
}

#[test]
fn arguments_outside_their_domain_are_named() {
    let names =
        |name: &str, message: String| assert!(message.contains(&format!("`{name}`")), "{message}");
    names("rows * cols", OccupancyMap::new(spec(0, 5)).unwrap_err().to_string());
    names("rows * cols", OccupancyMap::new(spec(1 << 20, 1 << 20)).unwrap_err().to_string());
    names(
        "cell_m",
        OccupancyMap::new(GridSpec { cell_m: f64::NAN, ..spec(4, 5) }).unwrap_err().to_string(),
    );
    let mut map = OccupancyMap::new(spec(4, 5)).unwrap();
    let seen = |cell| VisibleCells { free: vec![[0, 0]], blocked: vec![cell] };
    for cell in [[4, 0], [0, 5], [-1, 0], [0, i32::MIN]] {
        names("blocked", map.integrate(&seen(cell), [0.0; 2], 1.0).unwrap_err().to_string());
    }
    names("origin_m", map.integrate(&seen([1, 1]), [f64::NAN, 0.0], 1.0).unwrap_err().to_string());
    names("cells", map.forget(&[[9, 9]]).unwrap_err().to_string());
    names("radius_m", map.explore_around([0.0; 2], -1.0).unwrap_err().to_string());
    assert_eq!(map, OccupancyMap::new(spec(4, 5)).unwrap(), "a refused call changes nothing");
    map.assume_free([1e300, -1e300], 1e300).unwrap();
    let config = FrontierConfig { push_step_m: 0.0, ..Default::default() };
    names("push_step_m", extract(&map, [0.0; 2], &config).unwrap_err().to_string());
    names(
        "agent_m",
        extract(&map, [f64::NAN, 0.0], &FrontierConfig::default()).unwrap_err().to_string(),
    );
}
