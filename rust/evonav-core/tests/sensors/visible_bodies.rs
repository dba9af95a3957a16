//! Visibility against rays cast one by one between all the directions where anything can change.

use std::{
    collections::BTreeSet,
    f64::consts::{PI, TAU},
};

use evonav_core::{
    geometry::Vec2,
    grid::GridSpec,
    sensors::visible_cells::{VisibleCells, visible_cells},
};
use proptest::{collection::vec, prelude::*, sample::select};

const SPEC: GridSpec = GridSpec { rows: 9, cols: 11, cell_m: 0.5, corner_m: [-1.0, 2.0] };
const HAIR: f64 = 1e-7;

/// Where a ray enters and leaves a cell; slab test.
fn crossing_m(origin_m: Vec2, angle_rad: f64, cell: usize) -> Option<(f64, f64)> {
    let direction = [angle_rad.sin(), angle_rad.cos()];
    let low = [cell % SPEC.cols, cell / SPEC.cols];
    let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
    for axis in 0..2 {
        let side_m = SPEC.corner_m[axis] + low[axis] as f64 * SPEC.cell_m - origin_m[axis];
        let (a, b) = (side_m / direction[axis], (side_m + SPEC.cell_m) / direction[axis]);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    (leave - enter > 1e-12).then_some((enter, leave))
}

/// Cells entered within `range_m` before the first blocked cell (origin's own left out) ends.
fn cast(blocked: &[u8], own: usize, origin_m: Vec2, angle_rad: f64, range_m: f64) -> Vec<usize> {
    let crossings: Vec<(usize, f64)> = (0..SPEC.len())
        .filter_map(|cell| Some((cell, crossing_m(origin_m, angle_rad, cell)?.0)))
        .collect();
    let stops = crossings.iter().filter(|(cell, _)| blocked[*cell] != 0 && *cell != own);
    let stop_m = stops.map(|(_, enter_m)| *enter_m).fold(f64::INFINITY, f64::min);
    let is_reached = |enter_m: f64| enter_m <= stop_m && enter_m <= range_m;
    crossings
        .into_iter()
        .filter(|(_, enter_m)| is_reached(*enter_m))
        .map(|(cell, _)| cell)
        .collect()
}

/// Between two neighbouring directions towards cell corners all rays cross the same cells in the
/// same order, so rays at both ends and in the middle of each gap tell all there is. The axes are
/// ends too: along one, a cell straight ahead is nearest.
fn visible_naive(
    blocked: &[u8],
    origin_m: Vec2,
    yaw_rad: f64,
    fov_rad: f64,
    range_m: f64,
) -> BTreeSet<usize> {
    let own = SPEC.index(SPEC.cell_of(origin_m).expect("on the grid"));
    let corners = (0..=SPEC.rows).flat_map(|row| (0..=SPEC.cols).map(move |col| (row, col)));
    let first_rad = yaw_rad - 0.5 * fov_rad;
    let mut turns: Vec<f64> = corners
        .map(|(row, col)| {
            let x = SPEC.corner_m[0] + col as f64 * SPEC.cell_m - origin_m[0];
            let z = SPEC.corner_m[1] + row as f64 * SPEC.cell_m - origin_m[1];
            x.atan2(z)
        })
        .chain((0..4).map(|quarter| f64::from(quarter) * 0.5 * PI))
        .map(|angle_rad| (angle_rad - first_rad).rem_euclid(TAU))
        .filter(|turn| *turn < fov_rad)
        .chain([0.0, fov_rad])
        .collect();
    turns.sort_by(f64::total_cmp);
    let mut seen = BTreeSet::from([own]);
    for gap in turns.windows(2).filter(|gap| gap[1] - gap[0] > 1e-8) {
        let width = gap[1] - gap[0];
        for part in [1e-3, 0.5, 1.0 - 1e-3] {
            let angle_rad = first_rad + gap[0] + part * width.min(1e-5_f64.max(width));
            seen.extend(cast(blocked, own, origin_m, angle_rad, range_m));
        }
        for angle_rad in [gap[0] + 1e-9, gap[1] - 1e-9] {
            seen.extend(cast(blocked, own, origin_m, first_rad + angle_rad, range_m));
        }
    }
    seen
}

fn indices(seen: &VisibleCells, blocked: &[u8]) -> BTreeSet<usize> {
    let index = |cell: &[i32; 2]| SPEC.index(cell.map(|i| i as usize));
    assert!(seen.free.iter().all(|cell| blocked[index(cell)] == 0));
    assert!(seen.blocked.iter().all(|cell| blocked[index(cell)] != 0));
    assert!(seen.free.is_sorted() && seen.blocked.is_sorted());
    seen.free.iter().chain(&seen.blocked).map(index).collect()
}

fn origin() -> impl Strategy<Value = Vec2> {
    // Off the borders of cells by more than the kernel's own margin.
    ((0..SPEC.cols, 0..SPEC.rows), [0.01..0.99, 0.01..0.99]).prop_map(|((col, row), inside)| {
        [
            SPEC.corner_m[0] + (col as f64 + inside[0]) * SPEC.cell_m,
            SPEC.corner_m[1] + (row as f64 + inside[1]) * SPEC.cell_m,
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn visible_cells_lie_between_a_shorter_and_a_longer_reach(
        blocked in vec(select(&[0_u8, 0, 0, 0, 1][..]), SPEC.len()),
        origin_m in origin(),
        yaw_rad in -10.0..10.0,
        fov_rad in prop_oneof![0.2..TAU, Just(PI / 2.0), Just(TAU)],
        range_m in 0.1..6.0,
    ) {
        let seen = visible_cells(&blocked, &SPEC, origin_m, yaw_rad, fov_rad, range_m).unwrap();
        let seen = indices(&seen, &blocked);
        let wide = (fov_rad + 4.0 * HAIR).min(TAU);
        let least = visible_naive(&blocked, origin_m, yaw_rad, fov_rad - 4.0 * HAIR, range_m - HAIR);
        let most = visible_naive(&blocked, origin_m, yaw_rad, wide, range_m + HAIR);
        prop_assert!(least.is_subset(&seen), "missing {:?}", least.difference(&seen));
        prop_assert!(seen.is_subset(&most), "too many {:?}", seen.difference(&most));
    }

    /// On the border of a cell the answer may fall either way, but there is one.
    #[test]
    fn an_origin_on_a_border_sees_its_own_cell(
        blocked in vec(0..2_u8, SPEC.len()),
        row in 0..SPEC.rows,
        col in 0..SPEC.cols,
        quarter in 0..8_i32,
        range_m in prop_oneof![0.01..9.0, Just(1e300)],
    ) {
        let origin_m = [
            SPEC.corner_m[0] + col as f64 * SPEC.cell_m,
            SPEC.corner_m[1] + row as f64 * SPEC.cell_m,
        ];
        let yaw_rad = f64::from(quarter) * PI / 4.0;
        let seen = visible_cells(&blocked, &SPEC, origin_m, yaw_rad, PI, range_m).unwrap();
        let own = SPEC.cell_of(origin_m).unwrap();
        prop_assert!(indices(&seen, &blocked).contains(&SPEC.index(own)));
    }
}

#[test]
fn an_empty_grid_is_seen_whole_and_a_wall_hides_what_lies_behind() {
    let mut blocked = vec![0; SPEC.len()];
    let all = visible_cells(&blocked, &SPEC, [1.1, 4.1], 0.0, TAU, 1e3).unwrap();
    assert_eq!((all.free.len(), all.blocked.len()), (SPEC.len(), 0));
    blocked[5 * SPEC.cols..6 * SPEC.cols].fill(1);
    let ahead = visible_cells(&blocked, &SPEC, [1.1, 4.1], 0.0, PI, 1e3).unwrap();
    assert_eq!(ahead.blocked.len(), SPEC.cols);
    assert!(ahead.free.iter().all(|cell| cell[0] == 4), "{:?}", ahead.free);
}

#[test]
fn arguments_outside_their_domain_are_named() {
    let blocked = vec![0; SPEC.len()];
    let call = |blocked: &[u8], origin_m, yaw_rad, fov_rad, range_m| {
        visible_cells(blocked, &SPEC, origin_m, yaw_rad, fov_rad, range_m).unwrap_err().to_string()
    };
    let inside = [0.0, 3.0];
    assert!(call(&blocked[1..], inside, 0.0, 1.0, 1.0).contains("`blocked`"));
    assert!(call(&blocked, [90.0, 0.0], 0.0, 1.0, 1.0).contains("`origin_m`"));
    assert!(call(&blocked, [f64::NAN, 3.0], 0.0, 1.0, 1.0).contains("`origin_m`"));
    assert!(call(&blocked, inside, f64::NAN, 1.0, 1.0).contains("`yaw_rad`"));
    assert!(call(&blocked, inside, 0.0, 7.0, 1.0).contains("`horizontal_fov_rad`"));
    assert!(call(&blocked, inside, 0.0, 1.0, -1.0).contains("`range_m`"));
}
