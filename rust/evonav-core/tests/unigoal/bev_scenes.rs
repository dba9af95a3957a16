//! The map and plans on it in scenes of a wall, a hole and a ring.

use evonav_core::sensors::camera::Camera;
use evonav_core::unigoal::{
    bev_config::BevConfig,
    bev_map::BevMap,
    depth_view::DepthView,
    exploration::{ExploreConfig, choose_frontier},
    path_planning::{PlanConfig, plan},
};

use super::bev_map::{SIDE_PX, camera};

/// Floor, and a wall square to the view so far away.
pub fn room_depth(camera: &Camera, wall_m: f32) -> Vec<f32> {
    let (sin, cos) = camera.yaw_rad.sin_cos();
    let depth = |index: usize| {
        let pixel = [index % camera.width_px, index / camera.width_px].map(|k| k as f64 + 0.5);
        let [x, y, z] = camera.ray(pixel);
        let ahead = x * sin + z * cos;
        let to_wall = if ahead > 1e-6 { f64::from(wall_m) / ahead } else { f64::INFINITY };
        let to_floor = if y < -1e-6 { -camera.position_m[1] / y } else { f64::INFINITY };
        to_wall.min(to_floor) as f32
    };
    (0..camera.width_px * camera.height_px).map(depth).collect()
}

fn look(map: &mut BevMap, yaw_rad: f64, horizon_rad: f64, wall_m: f32) {
    let camera =
        Camera { width_px: 300, height_px: 300, ..camera([0.0, 1.575, 0.0], yaw_rad, horizon_rad) };
    let depth_m = room_depth(&camera, wall_m);
    map.integrate(&DepthView { camera, depth_m: &depth_m, categories: None })
        .expect("a valid view");
}

fn new_map() -> BevMap {
    BevMap::new([0.0, 0.0], 0, BevConfig::default()).expect("a valid map")
}

#[test]
fn a_wall_stands_where_it_is_whichever_way_the_camera_is_pitched() {
    for horizon_rad in [0.0_f64, 0.3, 30.0_f64.to_radians()] {
        let mut map = new_map();
        look(&mut map, 0.0, horizon_rad, 3.0);
        let spec = *map.spec();
        for col in [spec.cols / 2 - 30, spec.cols / 2, spec.cols / 2 + 30] {
            let rows: Vec<usize> =
                (0..spec.rows).filter(|&row| map.obstacles().get(row, col)).collect();
            let far_m = rows.iter().map(|&row| spec.centre_m([row, col])[1]);
            assert!(!rows.is_empty() && far_m.clone().all(|z| (z - 3.0).abs() < 0.1), "{rows:?}");
        }
        // Floor up to the wall: seen and free; nothing beyond it.
        let at = |z: f64| spec.cell_of([0.0, z]).unwrap();
        let floor_cell = at(2.5);
        assert!(map.explored().get(floor_cell[0], floor_cell[1]));
        assert!(!map.obstacles().get(floor_cell[0], floor_cell[1]));
        let beyond = at(3.3);
        assert!(!map.explored().get(beyond[0], beyond[1]));
    }
}

#[test]
fn what_stood_in_the_way_stays_in_the_way_when_it_is_gone() {
    let mut map = new_map();
    look(&mut map, 0.0, 0.3, 2.0);
    let before = map.obstacles().clone();
    assert!(before.count() > 50);
    look(&mut map, 0.0, 0.3, 4.5);
    assert!(before.cells().all(|cell| map.obstacles().get(cell[0], cell[1])));
    // The way through is shut for good, but for where the agent has been or stands.
    let through = plan(&map, [0.0, 0.0], &[[450, 360]], 3, &PlanConfig::default()).unwrap();
    assert!(through.distance_m.is_none_or(|way| way > 4.6), "{through:?}");
    map.visit([0.0, 0.0], [0.0, 4.5]).unwrap();
    let visited = plan(&map, [0.0, 0.0], &[[450, 360]], 3, &PlanConfig::default()).unwrap();
    assert!((visited.distance_m.unwrap() - 4.35).abs() < 0.15, "{visited:?}");
    // A collision on it shuts it again; the agent's own 3 x 3 cells are always free.
    let strip: Vec<[usize; 2]> = (350..371).map(|col| [400, col]).collect();
    map.collide(&strip);
    let shut = plan(&map, [0.0, 0.0], &[[450, 360]], 3, &PlanConfig::default()).unwrap();
    assert!(shut.distance_m.is_none_or(|way| way > 4.6), "{shut:?}");
    let passable = map.traversable([400, 360], 3);
    assert!((399..402).all(|row| (359..362).all(|col| passable.get(row, col))));
    assert!(!passable.get(400, 364));
}

#[test]
fn without_a_way_it_goes_where_the_goal_is_nearest() {
    let mut map = new_map();
    // A closed ring of bumps around the goal, 1 m off it.
    for step in 0..400_u32 {
        let angle = f64::from(step) * 0.0157;
        let cells: Vec<[usize; 2]> = [0.95, 1.0, 1.05]
            .iter()
            .filter_map(|r| map.spec().cell_of([3.0 + r * angle.sin(), r * angle.cos()]))
            .collect();
        map.collide(&cells);
    }
    let goal = map.spec().cell_of([3.0, 0.0]).unwrap().map(|i| i as i32);
    let config = PlanConfig::default();
    let far = plan(&map, [0.0, 0.0], &[goal], 3, &config).unwrap();
    assert!(far.distance_m.is_none() && far.short_term_m.unwrap()[0] > 0.15, "{far:?}");
    let behind = plan(&map, [3.0, 3.0], &[goal], 3, &config).unwrap();
    assert!(behind.distance_m.is_none() && behind.short_term_m.unwrap()[1] < 2.85, "{behind:?}");
    let near = plan(&map, [1.9, 0.0], &[goal], 3, &config).unwrap();
    assert!(
        near.distance_m.is_none() && near.short_term_m.is_none_or(|p| (p[0] - 1.9).abs() < 0.1),
        "{near:?}"
    );
}

#[test]
fn a_hole_in_the_floor_is_an_obstacle_and_a_step_down_beside_floor_is_none() {
    let mut map = new_map();
    let camera = Camera { width_px: 300, height_px: 300, ..camera([0.0, 1.5, 0.0], 0.0, 0.6) };
    // Floor 0.6 m lower from 2 m on.
    let depth_m: Vec<f32> = (0..300 * 300)
        .map(|index| {
            let [_, y, z] = camera.ray([(index % 300) as f64 + 0.5, (index / 300) as f64 + 0.5]);
            let upper = -1.5 / y;
            let depth = if upper * z < 2.0 { upper } else { -2.1 / y };
            if y < -1e-6 { depth as f32 } else { f32::INFINITY }
        })
        .collect();
    map.integrate(&DepthView { camera, depth_m: &depth_m, categories: None }).unwrap();
    let at = |z: f64| map.spec().cell_of([0.0, z]).unwrap();
    let (near, edge, far) = (at(1.5), at(2.9), at(4.0));
    assert!(map.explored().get(near[0], near[1]) && !map.obstacles().get(near[0], near[1]));
    let beyond: Vec<[usize; 2]> =
        map.explored().cells().filter(|c| (edge[0]..far[0]).contains(&c[0])).collect();
    assert!(beyond.len() > 500 && beyond.iter().all(|c| map.obstacles().get(c[0], c[1])));
}

#[test]
fn the_nearest_frontier_wins_and_a_goal_only_breaks_ties() {
    // Looks to both sides see 4 m of floor each way.
    let mut map = new_map();
    for (yaw_rad, wall_m) in [(0.0, 9.0), (std::f64::consts::PI, 9.0)] {
        look(&mut map, yaw_rad, 0.5, wall_m);
    }
    let config = ExploreConfig::default();
    let agent = map.spec().cell_of([0.0, 0.0]).unwrap();
    let near = choose_frontier(&map, agent, None, &config).unwrap();
    assert!(near.distance_m >= 1.2 && near.goal_distance_m.is_none());
    let scores: Vec<f64> = [[0.0, 8.0], [0.0, -8.0]]
        .iter()
        .map(|&goal_m| {
            let goal = map.spec().cell_of(goal_m);
            let chosen = choose_frontier(&map, agent, goal, &config).unwrap();
            let centre_m = map.spec().centre_m(chosen.cell);
            // The goal's share is 1 at most: worth a detour of a metre.
            assert!(chosen.distance_m <= near.distance_m + 1.0, "{chosen:?} {near:?}");
            assert!(centre_m[1] * goal_m[1] > 0.0, "{centre_m:?} towards {goal_m:?}");
            let near_goal = chosen.goal_distance_m.unwrap().clamp(0.0, 11.2) - 1.2;
            let expected =
                10.0 - (chosen.distance_m.clamp(0.0, 11.2) - 1.2) + 1.0 - near_goal / 10.0;
            assert!((chosen.score - expected).abs() < 1e-9);
            chosen.score
        })
        .collect();
    assert!(scores.iter().all(|&score| score > near.score));
    // No frontier, no target.
    assert!(choose_frontier(&new_map(), agent, None, &config).is_none());
}

#[test]
fn numbers_out_of_their_domain_are_refused_by_name() {
    let bad = |config: BevConfig| BevMap::new([0.0, 0.0], 1, config).unwrap_err().to_string();
    let good = BevConfig::default();
    assert!(bad(BevConfig { cell_m: 0.0, ..good }).contains("cell_m"));
    assert!(bad(BevConfig { size_m: f64::NAN, ..good }).contains("size_m"));
    assert!(bad(BevConfig { size_m: 1e6, ..good }).contains("size_m / cell_m"));
    assert!(bad(BevConfig { block_m: 0.1, ..good }).contains("block_m"));
    assert!(bad(BevConfig { stride_px: 0, ..good }).contains("stride_px"));
    assert!(bad(BevConfig { heights_m: [0.5, 1.0], ..good }).contains("heights_m[0]"));
    assert!(BevMap::new([f64::INFINITY, 0.0], 1, good).is_err());
    let mut map = BevMap::new([0.0, 0.0], 1, good).unwrap();
    let camera = camera([0.0, 1.5, 0.0], 0.0, 0.0);
    let (depth_m, categories) = (vec![1.0; SIDE_PX * SIDE_PX], vec![1; SIDE_PX * SIDE_PX]);
    let short = DepthView { camera, depth_m: &depth_m[1..], categories: None };
    assert!(map.integrate(&short).unwrap_err().to_string().contains("depth_m"));
    let unknown = DepthView { camera, depth_m: &depth_m, categories: Some(&categories) };
    assert!(map.integrate(&unknown).unwrap_err().to_string().contains("categories"));
    assert_eq!(map.explored().count(), 0);
    assert!(map.category(1).is_err());
    assert!(plan(&map, [99.0, 0.0], &[[1, 1]], 3, &PlanConfig::default()).is_err());
    let nowhere = plan(&map, [0.0, 0.0], &[[-1, 5], [9000, 3]], 3, &PlanConfig::default()).unwrap();
    assert!(nowhere.distance_m.is_none() && nowhere.straight_m.is_infinite());
}
