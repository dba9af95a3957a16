//! Collision, reachability and shortest paths against slow, obviously right twins.

use evonav_core::{
    assets::part::{Part, Primitive},
    geometry::{Aabb, Vec2, Vec3, distance_2d_m, yaw_rotation},
    world::{
        navigation::{AgentBody, Navigation, NavigationConfig, VisibilityGraph, path_length_m},
        scene::{Body, BodyKind, OrientedBox, Scene},
    },
};
use proptest::prelude::*;

const ROOM_M: f64 = 5.0;
/// No slack, so that the twins need none.
const EXACT: NavigationConfig =
    NavigationConfig { step_height_m: 0.03, tolerance_m: 0.0, snap_m: 0.5 };

fn cuboid(centre_m: Vec3, half_m: Vec3, yaw_rad: f64) -> Part {
    Part {
        primitive: Primitive::Cuboid { half_m },
        centre_m,
        rotation: yaw_rotation(yaw_rad),
        colour: [0; 3],
        material: Default::default(),
    }
}

fn body(id: &str, kind: BodyKind, parts: Vec<Part>) -> Body {
    let aabb = Aabb { min_m: [0.0; 3], max_m: [ROOM_M, 2.5, ROOM_M] };
    let oriented = OrientedBox::of_aabb(&aabb);
    let (id, category, trim) = (id.to_owned(), id.to_owned(), Vec::new());
    Body { id, category, kind, parts, trim, aabb, unopened: aabb, oriented }
}

/// A square room with walls 2 cm thick outside its floor, and boxes.
fn room(boxes: Vec<Part>) -> Scene {
    let half = ROOM_M / 2.0;
    let side = |x: f64, z: f64, half_m: Vec3| cuboid([x, 1.25, z], half_m, 0.0);
    let walls = vec![
        side(-0.01, half, [0.01, 1.25, half]),
        side(ROOM_M + 0.01, half, [0.01, 1.25, half]),
        side(half, -0.01, [half, 1.25, 0.01]),
        side(half, ROOM_M + 0.01, [half, 1.25, 0.01]),
    ];
    let floor = cuboid([half, -0.05, half], [half, 0.05, half], 0.0);
    let mut bodies =
        vec![body("floor", BodyKind::Floor, vec![floor]), body("walls", BodyKind::Wall, walls)];
    bodies.extend(boxes.into_iter().map(|part| body("box", BodyKind::Object, vec![part])));
    let bounds = Aabb { min_m: [0.0; 3], max_m: [ROOM_M, 2.5, ROOM_M] };
    Scene { bodies, first_object: 2, bounds }
}

fn navigation(boxes: &[Part]) -> Navigation {
    let scene = room(boxes.to_vec());
    Navigation::build(&scene, AgentBody::DEFAULT, EXACT).expect("a sound scene")
}

/// Boxes from the floor up past the capsule's lower end, so that its full radius counts.
fn arb_boxes() -> impl Strategy<Value = Vec<Part>> {
    let yaw_rad = prop_oneof![Just(0.0), 0.0..3.2];
    let part = ([0.2..4.8, 0.2..4.8], [0.02..0.8, 0.02..0.8], yaw_rad, 0.3..1.2).prop_map(
        |(at, half, yaw_rad, half_height)| {
            cuboid([at[0], half_height, at[1]], [half[0], half_height, half[1]], yaw_rad)
        },
    );
    prop::collection::vec(part, 0..9)
}

/// Distance of a point from a box on the ground, in the box's own frame.
fn distance_naive(part: &Part, point_m: Vec2) -> f64 {
    let Primitive::Cuboid { half_m } = part.primitive else { unreachable!("only boxes here") };
    let offset = [point_m[0] - part.centre_m[0], point_m[1] - part.centre_m[2]];
    let r = &part.rotation; // The inverse of a rotation is its transpose.
    let x = (r[0][0] * offset[0] + r[2][0] * offset[1]).abs() - half_m[0];
    let z = (r[0][2] * offset[0] + r[2][2] * offset[1]).abs() - half_m[2];
    x.max(0.0).hypot(z.max(0.0))
}

/// How far the agent's skin is from everything, negative in collision.
fn clearance_naive(boxes: &[Part], point_m: Vec2) -> f64 {
    let walls = point_m.iter().flat_map(|v| [*v, ROOM_M - v]).fold(f64::INFINITY, f64::min);
    boxes.iter().map(|b| distance_naive(b, point_m)).fold(walls, f64::min) - 0.2
}

fn along(a: Vec2, b: Vec2, t: f64) -> Vec2 {
    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
}

proptest! {
    /// A hair's breadth decides.
    #[test]
    fn is_free_exactly_where_the_clearance_is_positive(
        boxes in arb_boxes(), point_m in [-0.5..5.5, -0.5..5.5],
    ) {
        let clearance_m = clearance_naive(&boxes, point_m);
        prop_assume!(clearance_m.abs() > 1e-9);
        prop_assert_eq!(navigation(&boxes).is_free(point_m), clearance_m > 0.0);
    }

    /// Against samples along the move: each misses a collision by at most half the spacing.
    #[test]
    fn moves_agree_with_dense_samples(
        boxes in arb_boxes(), a in [0.3..4.7, 0.3..4.7], b in [0.3..4.7, 0.3..4.7],
    ) {
        let nav = navigation(&boxes);
        let half_step_m = distance_2d_m(a, b) / 4000.0;
        let least_m = (0..=2000)
            .map(|i| clearance_naive(&boxes, along(a, b, f64::from(i) / 2000.0)))
            .fold(f64::INFINITY, f64::min);
        if least_m < -1e-9 {
            prop_assert!(!nav.try_move(a, b));
        } else if least_m > half_step_m {
            prop_assert!(nav.try_move(a, b));
        }
        prop_assert_eq!(nav.try_move(a, b), nav.try_move(b, a));
        prop_assert_eq!(nav.try_move(a, b), nav.obstacles().is_clear_between(a, b));
    }

    /// Flood fill on the same lattice, every step sampled densely.
    #[test]
    fn reachable_positions_are_the_flood_fill(boxes in arb_boxes()) {
        let nav = navigation(&boxes);
        let start_m = [2.5, 2.5];
        let got = nav.reachable_positions(start_m, 0.25).unwrap();
        let is_step = |a: Vec2, b: Vec2| {
            (0..=50).all(|i| clearance_naive(&boxes, along(a, b, f64::from(i) / 50.0)) > 0.0)
        };
        let mut expected = if clearance_naive(&boxes, start_m) > 0.0 { vec![start_m] } else { vec![] };
        let mut i = 0;
        while i < expected.len() {
            let a = expected[i];
            for [dx, dz] in [[0.25, 0.0], [-0.25, 0.0], [0.0, 0.25], [0.0, -0.25]] {
                let b = [a[0] + dx, a[1] + dz];
                if !expected.contains(&b) && is_step(a, b) {
                    expected.push(b);
                }
            }
            i += 1;
        }
        expected.sort_by(|a, b| a[1].total_cmp(&b[1]).then(a[0].total_cmp(&b[0])));
        // Samples can miss a corner that the sweep meets, not the other way round.
        prop_assert!(got.iter().all(|p| expected.contains(p)));
        if boxes.is_empty() {
            prop_assert_eq!(got, expected);
        }
    }

    /// Paths: sound, between the straight line and the grid path, symmetric, found where a grid
    /// path is.
    #[test]
    fn paths_beat_the_grid_and_touch_nothing(
        boxes in arb_boxes(), ends in [[1..20_i32, 1..20_i32], [1..20_i32, 1..20_i32]],
    ) {
        let nav = navigation(&boxes);
        let [a, b] = ends.map(|cell| cell.map(|v| f64::from(v) * 0.25));
        prop_assume!(nav.is_free(a) && nav.is_free(b));
        let grid_m = grid_path_length_naive(&nav, a, b);
        let Some(path) = nav.shortest_path(a, b) else {
            prop_assert!(grid_m.is_infinite(), "no path, but the grid has one of {grid_m}");
            return Ok(());
        };
        let length_m = path_length_m(&path);
        prop_assert_eq!((path[0], path[path.len() - 1]), (a, b));
        for leg in path.windows(2) {
            for i in 0..=200 {
                let at = along(leg[0], leg[1], f64::from(i) / 200.0);
                prop_assert!(clearance_naive(&boxes, at) > -1e-9, "collision at {at:?}");
            }
        }
        prop_assert!(length_m >= distance_2d_m(a, b) - 1e-9);
        prop_assert!(length_m <= grid_m + 1e-9, "{length_m} against the grid's {grid_m}");
        let back_m = path_length_m(&nav.shortest_path(b, a).unwrap());
        prop_assert!((length_m - back_m).abs() < 1e-9);
        prop_assert!(nav.is_connected(a, b));
        let field_m = nav.distances_m(a, &[b])[0];
        prop_assert!((length_m - field_m).abs() < 1e-9);
    }

    /// Corners that are left out because a box around them is blocked or outdoors have no node.
    #[test]
    fn paths_are_those_of_a_graph_that_tests_every_corner(
        boxes in arb_boxes(), a in [0.3..4.7, 0.3..4.7], b in [0.3..4.7, 0.3..4.7],
    ) {
        let nav = navigation(&boxes);
        let obstacles = nav.obstacles();
        if !nav.is_free(a) || !nav.is_free(b) || obstacles.is_clear_between(a, b) {
            return Ok(());
        }
        let graph = VisibilityGraph::build(obstacles, |point_m| nav.is_free(point_m), |_, _| true);
        prop_assert_eq!(nav.shortest_path(a, b), graph.shortest_path(obstacles, a, b));
    }

    /// Distances asked for together, one by one from a field, and one by one from fresh houses: what
    /// earlier questions leave behind changes no bit. Each is the length of the path.
    #[test]
    fn distances_do_not_depend_on_what_was_asked_before(
        boxes in arb_boxes(),
        start_m in [0.3..4.7, 0.3..4.7],
        targets_m in prop::collection::vec([-0.5..5.5, -0.5..5.5], 1..60),
    ) {
        let nav = navigation(&boxes);
        let together_m = nav.distances_m(start_m, &targets_m);
        let field = nav.field(start_m);
        for (&target_m, &together_m) in targets_m.iter().zip(&together_m) {
            let alone_m = navigation(&boxes).distances_m(start_m, &[target_m])[0];
            prop_assert_eq!(together_m.to_bits(), alone_m.to_bits());
            let field_m = field.as_ref().map(|field| nav.field_distance_m(field, target_m));
            prop_assert_eq!(field_m.unwrap_or(f64::INFINITY).to_bits(), alone_m.to_bits());
            let path_m = navigation(&boxes).shortest_path(start_m, target_m);
            let path_m = path_m.map_or(f64::INFINITY, |path_m| path_length_m(&path_m));
            prop_assert!(path_m == together_m || (path_m - together_m).abs() < 1e-9);
        }
    }

    /// The nearest free centre, found by trying all, and whatever moves between centres join to it,
    /// found by asking all pairs of neighbours until nothing changes.
    #[test]
    fn occupancy_is_what_moves_between_centres_join_to_the_start(
        boxes in arb_boxes(), start_m in [-0.3..5.3, -0.3..5.3],
    ) {
        let nav = navigation(&boxes);
        let spec = nav.map_spec(0.1).unwrap();
        let cells = nav.occupancy(&spec, start_m).unwrap();
        let centre_of = |i: usize| spec.centre_m([i / spec.cols, i % spec.cols]);
        let is_free: Vec<bool> =
            (0..spec.len()).map(|i| clearance_naive(&boxes, centre_of(i)) > 0.0).collect();
        let seed = (0..spec.len())
            .filter(|&i| is_free[i] && distance_2d_m(centre_of(i), start_m) <= 0.5)
            .min_by(|&a, &b| {
                let distance_m = |i| distance_2d_m(centre_of(i), start_m);
                distance_m(a).total_cmp(&distance_m(b))
            });
        let mut expected = vec![1; spec.len()];
        if let Some(seed) = seed {
            expected[seed] = 0;
        }
        let mut has_changed = seed.is_some();
        while has_changed {
            has_changed = false;
            for i in (0..spec.len()).filter(|&i| is_free[i]) {
                // Free centres are inside of the room, so all four neighbours are on the grid.
                let is_joined = |j: usize| expected[j] == 0 && nav.try_move(centre_of(i), centre_of(j));
                if expected[i] == 1 && [i - 1, i + 1, i - spec.cols, i + spec.cols].into_iter().any(is_joined) {
                    (expected[i], has_changed) = (0, true);
                }
            }
        }
        prop_assert_eq!(cells, expected);
    }
}

/// Dijkstra on the 8-connected 0.25 m lattice with swept moves.
fn grid_path_length_naive(nav: &Navigation, start_m: Vec2, target_m: Vec2) -> f64 {
    const N: usize = 21;
    let point = |i: usize| [(i % N) as f64 * 0.25, (i / N) as f64 * 0.25];
    let find = |p: Vec2| (0..N * N).find(|&i| point(i) == p).expect("a point of the grid");
    let mut cost = vec![f64::INFINITY; N * N];
    let mut is_done = vec![false; N * N];
    cost[find(start_m)] = 0.0;
    loop {
        let open = (0..N * N).filter(|&i| !is_done[i] && cost[i].is_finite());
        let Some(i) = open.min_by(|&a, &b| cost[a].total_cmp(&cost[b])) else {
            return cost[find(target_m)];
        };
        is_done[i] = true;
        for j in 0..N * N {
            let is_next = (i % N).abs_diff(j % N) <= 1 && (i / N).abs_diff(j / N) <= 1;
            let through = cost[i] + distance_2d_m(point(i), point(j));
            if is_next && through < cost[j] && nav.try_move(point(i), point(j)) {
                cost[j] = through;
            }
        }
    }
}

#[test]
fn a_path_around_a_corner_has_the_length_of_the_taut_string() {
    // A wall half across the room: straight, arc around its end, straight.
    let wall = cuboid([1.25, 1.0, 2.5], [1.25, 1.0, 0.05], 0.0);
    let nav = navigation(&[wall]);
    let path = nav.shortest_path([1.0, 1.5], [1.0, 3.5]).unwrap();
    let corner_m = 1.5_f64.hypot(0.95);
    let straight_m = (corner_m * corner_m - 0.04).sqrt();
    // From the tangent's heading to straight along the wall's end.
    let arc_rad = 1.5_f64.atan2(0.95) + (0.2 / corner_m).asin();
    let exact_m = 2.0 * (straight_m + 0.2 * arc_rad) + 0.1;
    let got_m = path_length_m(&path);
    assert!(got_m >= exact_m - 1e-6 && got_m < exact_m + 0.012, "{got_m} {exact_m}");
}

#[test]
fn a_gap_half_a_millimetre_wider_than_the_agent_is_passed() {
    // Two boxes whose corners face each other half-way between two tangents of their arcs.
    let [x, z] = [33.75_f64.to_radians().cos(), 33.75_f64.to_radians().sin()];
    for (gap_m, is_open) in [(0.4005, true), (0.3995, false)] {
        let [half_x, half_z] = [x, z].map(|v| (5.0 - 2.3 - gap_m * v) / 2.0);
        let near = cuboid([1.15, 1.0, 1.15], [1.15, 1.0, 1.15], 0.0);
        let far = cuboid([5.0 - half_x, 1.0, 5.0 - half_z], [half_x, 1.0, half_z], 0.0);
        let path = navigation(&[near, far]).shortest_path([1.0, 4.0], [4.0, 1.0]);
        assert_eq!(path.is_some(), is_open);
    }
}

#[test]
fn low_things_are_walked_over_and_high_ones_under() {
    let rug = cuboid([2.5, 0.01, 2.5], [1.0, 0.01, 1.0], 0.0);
    let shelf = cuboid([2.5, 1.9, 2.5], [1.0, 0.05, 1.0], 0.0);
    assert!(navigation(&[rug, shelf]).try_move([0.5, 2.5], [4.5, 2.5]));
    let step = cuboid([2.5, 0.05, 2.5], [0.1, 0.05, 0.1], 0.0);
    let nav = navigation(&[step]);
    // The capsule's lower end is a half sphere: at 0.1 m it is 0.173 m wide.
    assert!(nav.is_free([2.5, 2.774]) && !nav.is_free([2.5, 2.773]));
}

#[test]
fn walled_off_places_have_no_path() {
    let wall = cuboid([2.5, 1.0, 2.5], [2.5, 1.0, 0.05], 0.0);
    let nav = navigation(&[wall]);
    assert_eq!(nav.shortest_path([1.0, 1.0], [1.0, 4.0]), None);
    assert!(!nav.is_connected([1.0, 1.0], [1.0, 4.0]) && nav.is_connected([1.0, 1.0], [4.0, 1.0]));
    assert_eq!(nav.distances_m([1.0, 1.0], &[[1.0, 4.0], [1.0, 2.0]]), [f64::INFINITY, 1.0]);
    let reached = nav.reachable_positions([1.0, 1.0], 0.25).unwrap();
    assert!(!reached.is_empty() && reached.iter().all(|p| p[1] < 2.3));
    assert_eq!(nav.nearest_reachable([1.1, 4.0], &reached), Some([1.0, 2.25]));
}

#[test]
fn points_off_the_free_space_are_pulled_back() {
    let nav = navigation(&[]);
    assert_eq!(nav.snap([1.0, 1.0]), Some([1.0, 1.0]));
    let snapped = nav.snap([1.0, 0.05]).unwrap();
    assert!(nav.is_free(snapped) && distance_2d_m(snapped, [1.0, 0.05]) < 0.18);
    assert_eq!(nav.snap([1.0, -3.0]), None);
    assert_eq!(nav.snap([f64::NAN, 1.0]), None);
    assert!(!nav.is_free([f64::INFINITY, 1.0]));
}

#[test]
fn arguments_outside_their_domain_are_errors() {
    let scene = room(vec![]);
    let config = NavigationConfig::default();
    let flat = AgentBody { radius_m: 0.5, height_m: 0.9 };
    assert!(Navigation::build(&scene, flat, config).is_err());
    let nan = cuboid([f64::NAN, 0.5, 1.0], [0.1; 3], 0.0);
    assert!(Navigation::build(&room(vec![nan]), AgentBody::DEFAULT, config).is_err());
    let empty = Scene { bodies: vec![], ..scene };
    assert!(Navigation::build(&empty, AgentBody::DEFAULT, config).is_err());
    let nav = navigation(&[]);
    assert!(nav.reachable_positions([1.0, 1.0], 0.0).is_err());
    assert!(nav.map_spec(f64::NAN).is_err());
}
