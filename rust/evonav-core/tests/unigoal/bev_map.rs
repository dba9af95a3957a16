//! The map seen from above: what views put into it, and what is read off it.

use std::collections::{BTreeMap, BTreeSet};

use evonav_core::{
    grid::bits::BitGrid,
    sensors::camera::Camera,
    unigoal::{
        bev_config::BevConfig,
        bev_map::BevMap,
        depth_view::DepthView,
        exploration::{ExploreConfig, frontier_cells},
    },
};
use proptest::{collection::vec, prelude::*, sample::select};

use super::bev_scenes::room_depth;

pub const SIDE_PX: usize = 24;

pub fn camera(position_m: [f64; 3], yaw_rad: f64, horizon_rad: f64) -> Camera {
    Camera {
        width_px: SIDE_PX,
        height_px: SIDE_PX,
        vertical_fov_rad: std::f64::consts::FRAC_PI_2,
        position_m,
        yaw_rad,
        horizon_rad,
    }
}

/// Cells, and for each what its column of voxels holds: every voxel by itself.
struct Naive {
    explored: BTreeMap<[usize; 2], f64>,
    obstacle: BTreeMap<[usize; 2], f64>,
    floor: BTreeMap<[usize; 2], f64>,
    below: BTreeMap<[usize; 2], f64>,
    categories: BTreeMap<([usize; 2], i32), f64>,
}

fn integrate_naive(map: &BevMap, view: &DepthView<'_>, config: &BevConfig) -> Naive {
    let mut voxels: BTreeMap<([i64; 2], i64, i32), f64> = BTreeMap::new();
    let camera = view.camera;
    for row in (config.stride_px / 2..SIDE_PX).step_by(config.stride_px) {
        for col in (config.stride_px / 2..SIDE_PX).step_by(config.stride_px) {
            let index = row * SIDE_PX + col;
            let depth_m = f64::from(view.depth_m[index]);
            if !depth_m.is_finite() || depth_m <= 0.0 || depth_m > config.max_depth_m {
                continue;
            }
            let [x, y, z] = camera.unproject([col as f64 + 0.5, row as f64 + 0.5], depth_m);
            let (dx, dz) = (x - camera.position_m[0], z - camera.position_m[2]);
            let ahead = dx * camera.yaw_rad.sin() + dz * camera.yaw_rad.cos();
            let right = dx * camera.yaw_rad.cos() - dz * camera.yaw_rad.sin();
            let is_inside = (0.0..config.block_m).contains(&ahead)
                && right.abs() < config.block_m / 2.0
                && (config.heights_m[0]..config.heights_m[1]).contains(&y);
            if !is_inside {
                continue;
            }
            let spec = map.spec();
            let at = [
                (z - spec.corner_m[1]) / spec.cell_m - 0.5,
                (x - spec.corner_m[0]) / spec.cell_m - 0.5,
                (y - config.heights_m[0]) / spec.cell_m,
            ];
            let category = view.categories.map_or(-1, |c| c[index]);
            for corner in 0..8 {
                let voxel: [i64; 3] =
                    std::array::from_fn(|i| at[i].floor() as i64 + (corner >> i & 1));
                let weight: f64 = (0..3).map(|i| 1.0 - (at[i] - voxel[i] as f64).abs()).product();
                let key = ([voxel[0], voxel[1]], voxel[2], category);
                *voxels.entry(key).or_default() += weight;
            }
        }
    }
    let mut naive = Naive {
        explored: BTreeMap::new(),
        obstacle: BTreeMap::new(),
        floor: BTreeMap::new(),
        below: BTreeMap::new(),
        categories: BTreeMap::new(),
    };
    let height_m = |level: i64| config.heights_m[0] + level as f64 * config.cell_m;
    for ((cell, level, category), weight) in voxels {
        let is_on_map = cell.iter().all(|&i| (0..map.spec().rows as i64).contains(&i));
        if !is_on_map {
            continue;
        }
        let cell = cell.map(|i| i as usize);
        *naive.explored.entry(cell).or_default() += weight;
        // The kernel's own slack: a camera may have any height, its top within a hair of a voxel's border.
        let hair_m = 1e-6 * config.cell_m;
        let (height_m, low_m) = (height_m(level) + hair_m, config.obstacle_min_m);
        // The last voxel is the one that the top falls into; it does not count.
        let top_m = camera.position_m[1] + config.obstacle_above_camera_m;
        let is_under_top = height_m + config.cell_m <= top_m + 2.0 * hair_m;
        let kind = if height_m < -low_m {
            &mut naive.below
        } else if height_m < low_m {
            &mut naive.floor
        } else if is_under_top {
            *naive.categories.entry((cell, category)).or_default() += weight;
            &mut naive.obstacle
        } else {
            continue;
        };
        *kind.entry(cell).or_default() += weight;
    }
    naive
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..Default::default() })]

    /// Against voxels that are kept one by one; sums near half a point may fall either way.
    #[test]
    fn a_view_fills_the_columns_that_its_voxels_fill(
        depths in vec(prop_oneof![4 => 0.2..7.0_f32, 1 => select(vec![f32::INFINITY, f32::NAN, 0.0, -1.0, 40.0])], SIDE_PX * SIDE_PX),
        categories in vec(-1..3_i32, SIDE_PX * SIDE_PX),
        place in [-2.5..2.5_f64, 0.6..1.8, -2.5..2.5],
        yaw_rad in -4.0..4.0_f64, horizon_rad in -0.3..0.9_f64, stride_px in 1..4_usize,
    ) {
        let config = BevConfig { size_m: 9.0, stride_px, max_depth_m: 6.0, ..Default::default() };
        let mut map = BevMap::new([0.3, -0.2], 3, config).unwrap();
        let camera = camera(place, yaw_rad, horizon_rad);
        let view = DepthView { camera, depth_m: &depths, categories: Some(&categories) };
        map.integrate(&view).unwrap();
        let naive = integrate_naive(&map, &view, &config);
        let sum = |of: &BTreeMap<[usize; 2], f64>, cell| of.get(&cell).copied().unwrap_or(0.0);
        let is_clear = |sum: f64| (sum - 0.5).abs() > 1e-3;
        for row in 0..map.spec().rows {
            for col in 0..map.spec().cols {
                let cell = [row, col];
                let explored = sum(&naive.explored, cell);
                let obstacle = sum(&naive.obstacle, cell);
                let (floor, below) = (sum(&naive.floor, cell), sum(&naive.below, cell));
                if is_clear(explored) {
                    prop_assert_eq!(map.explored().get(row, col), explored > 0.5);
                }
                if [explored, obstacle, floor, below].into_iter().all(is_clear) {
                    let is_obstacle = obstacle > 0.5 || (below > 0.5 && floor < 0.5);
                    prop_assert_eq!(map.obstacles().get(row, col), is_obstacle, "{:?}", cell);
                }
            }
        }
        for category in 0..3 {
            let found = map.category(category as usize).unwrap();
            for (index, &certainty) in found.iter().enumerate() {
                let cell = [index / map.spec().cols, index % map.spec().cols];
                let points = naive.categories.get(&(cell, category)).copied().unwrap_or(0.0);
                if (points - points.floor() - 0.5).abs() > 1e-3 {
                    let expected = points.round().min(5.0) / 5.0;
                    prop_assert!((f64::from(certainty) - expected).abs() < 1e-6, "{certainty} {points}");
                }
            }
        }
    }

    /// Whatever order views come in, the map is the same, and no view takes anything back.
    #[test]
    fn the_map_is_the_maximum_of_its_views(
        views in vec((vec(0.3..6.0_f32, SIDE_PX * SIDE_PX), vec(-1..2_i32, SIDE_PX * SIDE_PX), -4.0..4.0_f64), 1..4),
    ) {
        let map_of = |order: &[usize]| {
            let mut map = BevMap::new([0.0, 0.0], 2, BevConfig { size_m: 12.0, ..Default::default() }).unwrap();
            for &index in order {
                let (depth_m, categories, yaw_rad) = &views[index];
                let camera = camera([0.0, 1.5, 0.0], *yaw_rad, 0.5);
                let before = map.clone();
                map.integrate(&DepthView { camera, depth_m, categories: Some(categories) }).unwrap();
                let is_kept = |old: &BitGrid, new: &BitGrid| old.cells().all(|c| new.get(c[0], c[1]));
                assert!(is_kept(before.obstacles(), map.obstacles()));
                assert!(is_kept(before.explored(), map.explored()));
                for category in 0..2 {
                    let (old, new) = (before.category(category).unwrap(), map.category(category).unwrap());
                    assert!(old.iter().zip(&new).all(|(old, new)| old <= new));
                }
            }
            map
        };
        let forward: Vec<usize> = (0..views.len()).collect();
        let backward: Vec<usize> = forward.iter().rev().copied().collect();
        let (one, other) = (map_of(&forward), map_of(&backward));
        prop_assert_eq!(one.obstacles(), other.obstacles());
        prop_assert_eq!(one.explored(), other.explored());
        prop_assert_eq!(one.category(1).unwrap(), other.category(1).unwrap());
    }

}

proptest! {
    // Slow: a look around, and a twin that measures from every cell to every obstacle.
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..Default::default() })]

    /// Explored, two cells off obstacles, beside an unknown cell that is as far off them.
    #[test]
    fn frontiers_are_free_cells_beside_unknown_ones(
        depths in vec(prop_oneof![3 => 2.0..6.0_f32, 1 => Just(f32::INFINITY)], 3),
        horizon_rad in 0.0..0.8_f64, min_cells in 1..30_usize,
    ) {
        let map = seen_around(&depths, horizon_rad);
        let config = ExploreConfig { min_cells, frontier_obstacle_radius: 2, ..Default::default() };
        let obstacles: Vec<[usize; 2]> = map.obstacles().cells().collect();
        let is_near = |r: usize, c: usize| {
            obstacles.iter().any(|o| o[0].abs_diff(r).pow(2) + o[1].abs_diff(c).pow(2) <= 4)
        };
        let side = map.spec().rows;
        let is_unknown = |r: usize, c: usize| {
            r < side && c < side && !map.explored().get(r, c) && !is_near(r, c)
        };
        let mut expected = BTreeSet::new();
        for [r, c] in map.explored().cells() {
            let around = [[r.wrapping_sub(1), c], [r + 1, c], [r, c.wrapping_sub(1)], [r, c + 1]];
            if !is_near(r, c) && around.iter().any(|&[r, c]| is_unknown(r, c)) {
                expected.insert([r, c]);
            }
        }
        let all = frontier_cells(&map, &ExploreConfig { min_cells: 1, ..config });
        prop_assert_eq!(all.cells().collect::<BTreeSet<_>>(), expected);
        let large = frontier_cells(&map, &config);
        prop_assert!(large.cells().all(|c| all.get(c[0], c[1])));
    }
}

/// A map after looks to four sides, into distances that repeat.
fn seen_around(depths: &[f32], horizon_rad: f64) -> BevMap {
    let config = BevConfig { size_m: 12.0, stride_px: 1, cell_m: 0.1, ..Default::default() };
    let mut map = BevMap::new([0.0, 0.0], 0, config).expect("a valid map");
    for quarter in 0..4 {
        let camera = Camera {
            width_px: 120,
            height_px: 120,
            ..camera([0.0, 1.5, 0.0], f64::from(quarter) * std::f64::consts::FRAC_PI_2, horizon_rad)
        };
        let depth_m = room_depth(&camera, depths[quarter as usize % depths.len()]);
        map.integrate(&DepthView { camera, depth_m: &depth_m, categories: None })
            .expect("a valid view");
    }
    map
}
