//! The lengths of ways over the occupancy map against a plain twin, cell by cell.

use std::collections::{BTreeMap, BTreeSet};

use evonav_core::{memory::occupancy::OccupancyMap, sensors::visible_cells::VisibleCells};
use proptest::prelude::*;

use super::occupancy::{spec, walked};

type Cell = [i32; 2];

/// Shortest ways over free cells in steps to the four or eight neighbours, in cells.
fn ways_naive(map: &OccupancyMap, start: Cell, is_diagonal: bool) -> BTreeMap<Cell, f64> {
    let free: BTreeSet<Cell> = map.free().cells().map(|cell| cell.map(|i| i as i32)).collect();
    let mut ways = BTreeMap::from([(start, 0.0)]);
    loop {
        let mut shorter = ways.clone();
        for (&[row, col], &way) in &ways {
            for (dr, dc) in (-1..=1).flat_map(|dr| (-1..=1).map(move |dc| (dr, dc))) {
                let next = [row + dr, col + dc];
                let is_corner = dr != 0 && dc != 0;
                // A step across a corner needs both cells beside it.
                let beside = [[row + dr, col], [row, col + dc]];
                let is_cut = is_corner && !beside.iter().all(|cell| free.contains(cell));
                if !free.contains(&next) || (is_corner && !is_diagonal) || is_cut {
                    continue;
                }
                let length = way + f64::from(dr * dr + dc * dc).sqrt();
                let kept = shorter.entry(next).or_insert(f64::INFINITY);
                *kept = kept.min(length);
            }
        }
        if shorter == ways {
            return ways;
        }
        ways = shorter;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..Default::default() })]

    #[test]
    fn ways_are_between_the_straight_line_and_steps_along_the_axes(
        seed in any::<u64>(),
        num_steps in 1..12_usize,
        side in 8..28_usize,
    ) {
        let (map, start_m) = walked(seed, num_steps, side);
        let spec = *map.spec();
        let start = spec.cell_of(start_m).unwrap().map(|i| i as i32);
        let cells: Vec<Cell> = (0..side as i32).flat_map(|r| (0..side as i32).map(move |c| [r, c])).collect();
        let targets_m: Vec<_> = cells.iter().map(|cell| spec.centre_m(cell.map(|i| i as usize))).collect();
        let found_m = map.distances_m(start_m, &targets_m).unwrap();
        let (upper, lower) = (ways_naive(&map, start, false), ways_naive(&map, start, true));
        for (cell, way_m) in cells.iter().zip(found_m) {
            let way = way_m / spec.cell_m;
            match (upper.get(cell), lower.get(cell)) {
                (Some(&most), Some(&octile)) => {
                    let straight = f64::from((cell[0] - start[0]).pow(2) + (cell[1] - start[1]).pow(2)).sqrt();
                    prop_assert!(straight - 1e-9 <= way && way <= most + 1e-3, "{cell:?}: {straight} {way} {most}");
                    prop_assert!(way <= 1.08 * octile + 0.5, "{cell:?}: {way} {octile}");
                }
                _ => prop_assert!(way.is_infinite(), "{cell:?}: {way}"),
            }
        }
    }
}

#[test]
fn a_wall_makes_the_way_longer_and_a_room_without_a_door_has_none() {
    let mut map = OccupancyMap::new(spec(5, 9)).unwrap();
    let all: Vec<Cell> = (0..5).flat_map(|r| (0..9).map(move |c| [r, c])).collect();
    let (blocked, free) = all.into_iter().partition(|[r, c]| *c == 4 && *r > 0 || *c == 7);
    map.integrate(&VisibleCells { free, blocked }, [0.0; 2], 1.0).unwrap();
    let spec = *map.spec();
    let at = |row, col| spec.centre_m([row, col]);
    let found_m =
        map.distances_m(at(4, 3), &[at(4, 3), at(4, 5), at(4, 8), at(4, 4), [-9.0, 0.0]]).unwrap();
    assert_eq!(found_m[0], 0.0);
    let around_m = 10.0 * spec.cell_m; // four cells up, two to the side, four down
    assert!((found_m[1] - around_m).abs() < 1e-6, "{found_m:?}");
    assert!(found_m[2..].iter().all(|way_m| way_m.is_infinite()), "{found_m:?}");
    assert!(map.distances_m([99.0, 99.0], &[at(0, 0)]).unwrap()[0].is_infinite());
    let message = map.distances_m([f64::NAN, 0.0], &[]).unwrap_err().to_string();
    assert!(message.contains("`start_m`"), "{message}");
}
