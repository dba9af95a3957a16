//! View positions of frontiers against a plain twin, cell by cell.

use std::collections::BTreeSet;

use evonav_core::memory::{
    frontiers::{Frontier, FrontierConfig, Frontiers},
    occupancy::OccupancyMap,
};
use proptest::prelude::*;

use super::occupancy::{Cell, components_naive, walked};

/// The centre of the nearest blocked cell closer than `within_m`, and its distance.
fn nearest_blocked_naive(
    map: &OccupancyMap,
    point_m: [f64; 2],
    within_m: f64,
) -> Option<([f64; 2], f64)> {
    let off_m = |[x, z]: [f64; 2]| (x - point_m[0]).hypot(z - point_m[1]);
    let centres_m = map.blocked().cells().map(|cell| map.spec().centre_m(cell));
    let nearest_m = centres_m.min_by(|&a, &b| off_m(a).total_cmp(&off_m(b)))?;
    (off_m(nearest_m) < within_m).then(|| (nearest_m, off_m(nearest_m)))
}

/// Steps away from the nearest obstacle while the clearance grows and the floor is free.
fn pushed_away_naive(map: &OccupancyMap, start_m: [f64; 2], config: &FrontierConfig) -> [f64; 2] {
    let mut point_m = start_m;
    let mut moved_m = 0.0;
    while let Some((obstacle_m, clearance_m)) =
        nearest_blocked_naive(map, point_m, config.clearance_m)
    {
        moved_m += config.push_step_m;
        if moved_m > config.max_push_m + 1e-9 || clearance_m == 0.0 {
            break;
        }
        let step = config.push_step_m / clearance_m;
        let next_m = [0, 1].map(|i| point_m[i] + (point_m[i] - obstacle_m[i]) * step);
        let is_free = map.spec().cell_of(next_m).is_some_and(|[r, c]| map.free().get(r, c));
        let next = nearest_blocked_naive(map, next_m, config.clearance_m);
        if !is_free || next.is_some_and(|(_, next_m)| next_m <= clearance_m) {
            break;
        }
        point_m = next_m;
    }
    point_m
}

/// The cells of the agent's island with 4 to 6 unexplored neighbours.
fn edges_naive(map: &OccupancyMap, agent: Cell) -> Vec<Cell> {
    let free: BTreeSet<Cell> = map.free().cells().map(|cell| cell.map(|i| i as i32)).collect();
    let islands = components_naive(&free);
    let island = islands.into_iter().find(|island| island.contains(&agent)).unwrap_or_default();
    let (rows, cols) = (map.spec().rows as i32, map.spec().cols as i32);
    let is_unexplored = |[row, col]: Cell| {
        let is_on = (0..rows).contains(&row) && (0..cols).contains(&col);
        is_on && !map.explored().get(row as usize, col as usize)
    };
    let num_unexplored = |&[row, col]: &Cell| {
        let around = (-1..=1).flat_map(|r| (-1..=1).map(move |c| [row + r, col + c]));
        around.filter(|&cell| cell != [row, col] && is_unexplored(cell)).count()
    };
    island.into_iter().filter(|cell| (4..=6).contains(&num_unexplored(cell))).collect()
}

/// Ranks the edge cells beside a region by how well they lie in its direction, takes the nearest of
/// the first five, and pushes it away from obstacles.
fn position_naive(
    map: &OccupancyMap,
    edges: &[Cell],
    agent_m: [f64; 2],
    frontier: &Frontier,
    config: &FrontierConfig,
) -> [f64; 2] {
    let is_beside = |edge: &&Cell| {
        let is_near = |cell: &&Cell| (0..2).all(|i| (cell[i] - edge[i]).abs() <= 2);
        (2..=12).contains(&frontier.cells.iter().filter(is_near).count())
    };
    let mut candidates: Vec<&Cell> = edges.iter().filter(is_beside).collect();
    if candidates.is_empty() {
        candidates = edges.iter().collect();
    }
    let ahead = [frontier.direction_rad.sin(), frontier.direction_rad.cos()];
    let mut ranked: Vec<(f64, f64, [f64; 2])> = candidates
        .into_iter()
        .map(|cell| {
            let centre_m = map.spec().centre_m(cell.map(|i| i as usize));
            let [x, z] = [0, 1].map(|i| centre_m[i] - agent_m[i]);
            let far_m = x.hypot(z);
            ((x * ahead[0] + z * ahead[1]) / far_m.max(1e-9), far_m, centre_m)
        })
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let best = ranked.iter().take(5).min_by(|a, b| a.1.total_cmp(&b.1));
    best.map_or(agent_m, |best| pushed_away_naive(map, best.2, config))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..Default::default() })]

    #[test]
    fn regions_are_looked_at_from_the_place_of_the_plain_rule(
        seed in any::<u64>(),
        num_steps in 1..12_usize,
        side in 20..140_usize,
        min_cells in 2..40_usize,
        clearance_m in prop_oneof![0.0..1.0, 3.0..9.0],
    ) {
        let (map, agent_m) = walked(seed, num_steps, side);
        let config =
            FrontierConfig { min_cells, min_border_cells: 0, clearance_m, ..Default::default() };
        let mut frontiers = Frontiers::default();
        frontiers.update(&map, agent_m, &config).unwrap();
        let agent = map.spec().cell_of(agent_m).unwrap();
        prop_assume!(map.free().get(agent[0], agent[1]));
        let edges = edges_naive(&map, agent.map(|i| i as i32));
        for frontier in frontiers.list() {
            let sum = frontier.cells.iter().fold([0.0; 2], |[x, z], cell| {
                let centre_m = map.spec().centre_m(cell.map(|i| i as usize));
                let off_m = [centre_m[0] - agent_m[0], centre_m[1] - agent_m[1]];
                let far_m = off_m[0].hypot(off_m[1]).max(1e-9);
                [x + off_m[0] / far_m, z + off_m[1] / far_m]
            });
            let turn_rad = frontier.direction_rad - sum[0].atan2(sum[1]);
            prop_assert!(turn_rad.sin().abs() < 1e-9 && turn_rad.cos() > 0.0, "{frontier:?}");
            let naive_m = position_naive(&map, &edges, agent_m, frontier, &config);
            prop_assert_eq!(frontier.position_m, naive_m);
        }
    }
}
