//! The sun's shadows against the ray caster, and pictures in any order.

use evonav_core::{
    assets::{
        Catalogue, UnknownAssets,
        part::{Part, Primitive},
    },
    geometry::{Aabb, Vec3, add, euler_rotation_deg},
    house::House,
    sensors::{
        camera::{Camera, View},
        raster::{
            FrameBuffer, Light, Style, Want, relight, render_lit, render_rows_of, render_view,
        },
        ray_caster::RayCaster,
    },
    world::{
        mesh::{SceneMesh, Triangle},
        scene::{BodyKind, Scene},
    },
};
use proptest::{collection::vec, prelude::*, sample::Index, test_runner::Config};

use crate::common::scenes::{cross, dot, scene_of};

const HOUSE: &str = include_str!("../data/house_39_objects.json");

fn house() -> (House, Scene) {
    let house = House::from_json("house", HOUSE).expect("a valid house");
    let scene = Scene::build(&house, Catalogue::bundled(), UnknownAssets::Error).expect("known");
    (house, scene)
}

fn scaled(v: Vec3, factor: f64) -> Vec3 {
    v.map(|x| factor * x)
}

fn unit(v: Vec3) -> Vec3 {
    scaled(v, 1.0 / dot(v, v).sqrt())
}

/// A scene under the house's sun, and rays to look for what is in the way.
struct Sunny {
    scene: Scene,
    mesh: SceneMesh,
    light: Light,
    caster: RayCaster,
    triangles: Vec<Triangle>,
}

impl Sunny {
    fn new(house: &House, scene: Scene) -> Self {
        let mesh = SceneMesh::build(&scene);
        let light = Light::build(house, &scene, &mesh);
        let (caster, triangles) = (RayCaster::build(&mesh), mesh.triangles().collect());
        Self { scene, mesh, light, caster, triangles }
    }

    /// Return whether the sun reaches a point; `None` if that is not clear: near the edge of a
    /// shadow, close to what shadows it, or behind a window.
    fn is_sunny(&self, point_m: Vec3) -> Option<bool> {
        /// Distance within which the edge of a shadow may lie, and spacing of the rays.
        const MARGIN: (i32, f64) = (4, 0.012);
        let towards = self.light.towards_sun();
        let across = unit(cross(towards, [0.0, 1.0, 0.0]));
        let up = cross(towards, across);
        let mut answer = None;
        let (steps, step_m) = MARGIN;
        for (i, j) in (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (i, j))) {
            let aside =
                add(scaled(across, step_m * f64::from(i)), scaled(up, step_m * f64::from(j)));
            let hit = |ahead_m: f64| {
                let from_m = add(add(point_m, aside), scaled(towards, ahead_m));
                self.caster.cast(&self.mesh, from_m, towards, 100.0)
            };
            let [behind, ahead] = [hit(-0.02), hit(0.03)];
            let is_window = |body: usize| self.scene.bodies[body].kind == BodyKind::Window;
            if behind.is_some() != ahead.is_some() || ahead.is_some_and(|hit| is_window(hit.body)) {
                return None;
            }
            let is_free = ahead.is_none();
            if *answer.get_or_insert(is_free) != is_free {
                return None;
            }
        }
        answer
    }

    /// Compare the sun at a point of a triangle with rays; return whether the answer was clear and
    /// the sun is there.
    fn check(&self, triangle: &Triangle, share: [f64; 2]) -> Result<Option<bool>, TestCaseError> {
        let [a, b, c] = triangle.vertices_m;
        let [s, t] = if share[0] + share[1] > 1.0 { share.map(|x| 1.0 - x) } else { share };
        let point_m = std::array::from_fn(|i| a[i] + s * (b[i] - a[i]) + t * (c[i] - a[i]));
        let sides = [b, c].map(|corner| std::array::from_fn(|i| corner[i] - a[i]));
        let normal = cross(sides[0], sides[1]);
        let facing = dot(normal, self.light.towards_sun()) / dot(normal, normal).sqrt();
        if facing.abs() < 0.2 {
            return Ok(None);
        }
        let Some(is_sunny) = self.is_sunny(point_m) else { return Ok(None) };
        let found = self.light.sun_at(&self.mesh, point_m);
        let expected = if is_sunny { 1.0 } else { 0.0 };
        prop_assert!((found - expected).abs() < 1e-6, "{found} at {point_m:?}, not {expected}");
        Ok(Some(is_sunny))
    }
}

fn part() -> impl Strategy<Value = Part> {
    let half_m = [0.1..0.8_f64, 0.1..0.8_f64, 0.1..0.8_f64];
    let primitive = prop_oneof![
        half_m.clone().prop_map(|half_m| Primitive::Cuboid { half_m }),
        half_m.prop_map(|half_m| Primitive::Ellipsoid { half_m }),
    ];
    let place = [0.0..4.0_f64, 0.0..3.0_f64, 0.0..4.0_f64];
    let angles = [0.0..360.0_f64, 0.0..360.0_f64, 0.0..360.0_f64];
    (primitive, place, angles).prop_map(|(primitive, centre_m, angles_deg)| Part {
        primitive,
        centre_m,
        rotation: euler_rotation_deg(angles_deg),
        colour: [200, 60, 40],
        material: Default::default(),
    })
}

proptest! {
    #![proptest_config(Config { cases: 48, ..Config::default() })]

    /// Away from the edges of shadows, the map of shadows says what rays to the sun say.
    #[test]
    fn shadows_of_solids_are_where_rays_to_the_sun_are_blocked(
        parts in vec(part(), 1..8),
        places in vec((any::<Index>(), [0.0..1.0_f64, 0.0..1.0_f64]), 40),
    ) {
        let (house, _) = house();
        let scene = scene_of(&parts.iter().map(|part| vec![*part]).collect::<Vec<_>>());
        let sunny = Sunny::new(&house, scene);
        for (index, share) in places {
            sunny.check(index.get(&sunny.triangles), share)?;
        }
    }
}

/// Indoors, rays to the sun pass windows or are blocked.
#[test]
fn the_sun_is_nowhere_in_a_house_where_rays_to_it_are_blocked() {
    let (house, scene) = house();
    let sunny = Sunny::new(&house, scene);
    let mut num_blocked = 0;
    for (number, triangle) in sunny.triangles.iter().enumerate() {
        let share = [0.618_034, 0.414_214].map(|step| (step * (number + 1) as f64).fract());
        let found = sunny.check(triangle, share).expect("the sun as rays say");
        num_blocked += i32::from(found == Some(false));
    }
    assert!(num_blocked > 1000, "too few clear places: {num_blocked}");
}

/// What was seen before changes no picture, though it decides when the light on a part is computed.
#[test]
fn pictures_do_not_depend_on_what_was_seen_before() {
    let (house, scene) = house();
    let mesh = SceneMesh::build(&scene);
    let centre_m = Aabb::of_points(mesh.triangles().flat_map(|t| t.vertices_m)).centre_m();
    let view_of = |index: usize| {
        let yaw_rad = index as f64 * std::f64::consts::FRAC_PI_3;
        let camera = Camera {
            width_px: 96,
            height_px: 72,
            vertical_fov_rad: 1.4,
            position_m: [centre_m[0], 1.5, centre_m[2]],
            yaw_rad,
            horizon_rad: 0.3,
        };
        View::from(camera)
    };
    let want = Want { rgb: Some(Style::Default), instances: false };
    let draw = |light: &Light, index: usize| {
        let mut frame = FrameBuffer::default();
        render_lit(&mesh, Some(light), &view_of(index), want, &mut frame).expect("a valid view");
        frame.rgb
    };
    let own = Light::build(&house, &scene, &mesh);
    let forwards: Vec<_> = (0..6).map(|index| draw(&own, index)).collect();
    assert!(forwards.windows(2).all(|pair| pair[0] != pair[1]));
    let shared = Light::build(&house, &scene, &mesh);
    let pictures: Vec<_> = std::thread::scope(|scope| {
        let (shared, draw) = (&shared, &draw);
        let draw_one = |index| scope.spawn(move || draw(shared, index));
        let threads: Vec<_> = (0..6).rev().map(draw_one).collect();
        threads.into_iter().rev().map(|thread| thread.join().expect("a picture")).collect()
    });
    assert_eq!(pictures, forwards);
}

/// A picture that is lit after another style was drawn is the one that is lit at once; of a view with
/// lines, only rows with an instance are drawn.
#[test]
fn pictures_are_the_same_when_they_are_lit_later() {
    let (house, scene) = house();
    let mesh = SceneMesh::build(&scene);
    let light = Light::build(&house, &scene, &mesh);
    let centre_m = Aabb::of_points(mesh.triangles().flat_map(|t| t.vertices_m)).centre_m();
    let want = |style| Want { rgb: Some(style), instances: true };
    let (mut frame, mut num_left_out) = (FrameBuffer::default(), 0);
    for index in 0..6 {
        let camera = Camera {
            width_px: 90,
            height_px: 70,
            vertical_fov_rad: 1.4,
            position_m: [centre_m[0], 1.5, centre_m[2]],
            yaw_rad: f64::from(index) * std::f64::consts::FRAC_PI_3,
            horizon_rad: 0.3,
        };
        let view = View::from(camera);
        let [mut flat, mut lit] = [FrameBuffer::default(), FrameBuffer::default()];
        render_view(&mesh, &view, want(Style::Plain), &mut flat).expect("a valid view");
        render_lit(&mesh, Some(&light), &view, want(Style::Default), &mut lit).expect("valid");
        let instance = flat.instances[35 * 90 + 45];
        render_rows_of(&mesh, &view, instance, &mut frame).expect("a valid view");
        for (row, instances) in frame.instances.chunks_exact(90).enumerate() {
            let pixels = 270 * row..270 * (row + 1);
            if instances.contains(&instance) {
                // Lines alone make a pixel darker.
                let pairs = frame.rgb[pixels.clone()].iter().zip(&flat.rgb[pixels]);
                assert!(pairs.clone().all(|(lined, plain)| lined <= plain), "row {row}");
            } else {
                num_left_out += 1;
            }
        }
        relight(&mesh, &light, &view, &mut frame);
        assert_eq!(frame.take(), lit.take());
    }
    assert!(num_left_out > 0);
}
