//! Images of a few walls: where the camera looks, colours, clip planes and ceilings.

use evonav_core::{
    assets::part::{Part, Primitive},
    geometry::{Vec3, euler_rotation_deg},
    sensors::{
        camera::{CLIP_M, Camera, View},
        raster::{FrameBuffer, Style, Want, render, render_view},
    },
    world::{mesh::SceneMesh, scene::BodyKind},
};

use super::tracer::scene_of;

fn red_cuboid(half_m: Vec3, centre_m: Vec3) -> Part {
    Part {
        primitive: Primitive::Cuboid { half_m },
        centre_m,
        rotation: euler_rotation_deg([0.0; 3]),
        colour: [200, 40, 40],
        material: Default::default(),
    }
}

fn level_camera(
    width_px: usize,
    height_px: usize,
    vertical_fov_rad: f64,
    position_m: Vec3,
) -> Camera {
    Camera { width_px, height_px, vertical_fov_rad, position_m, yaw_rad: 0.0, horizon_rad: 0.0 }
}

/// AI2-THOR's conventions: yaw 90 degrees looks along +x, a positive horizon looks down.
#[test]
fn camera_turns_clockwise_and_looks_down() {
    let mut camera = Camera {
        yaw_rad: 90.0_f64.to_radians(),
        ..level_camera(300, 300, 90.0_f64.to_radians(), [0.0, 1.575, 0.0])
    };
    let close = |a: Vec3, b: Vec3| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-9);
    // Facing +x, -z is on the right hand.
    assert!(close(camera.project([2.0, 1.575, -1.0]).unwrap(), [225.0, 150.0, 2.0]));
    assert!(close(camera.project([2.0, 2.575, 0.0]).unwrap(), [150.0, 75.0, 2.0]));
    camera.horizon_rad = 30.0_f64.to_radians();
    let floor_m = camera.unproject([150.0, 150.0], 3.15);
    assert!(close(floor_m, [3.15 * 0.75_f64.sqrt(), 0.0, 0.0]));
    camera.vertical_fov_rad = f64::NAN;
    assert!(camera.check().is_err());
}

#[test]
fn numbers_that_are_not_finite_draw_nothing_and_do_not_panic() {
    let part = red_cuboid([f64::NAN, 1.0, f64::INFINITY], [0.0, 1.0, 2.0]);
    let mesh = SceneMesh::build(&scene_of(&[part]));
    let camera = level_camera(16, 16, 1.5, [0.0; 3]);
    let mut frame = FrameBuffer::default();
    render(&mesh, &camera, Want { rgb: Some(Style::Plain), instances: true }, &mut frame).unwrap();
    assert!(frame.instances.iter().all(|&id| id == 0));
}

/// Sky where nothing is; the walls' own colour, darkest where they meet.
#[test]
fn colours_show_corners_and_sky() {
    // A wall across and one to the right of it that meets it; nothing to the left.
    let ahead = red_cuboid([1.5, 3.0, 0.1], [1.5, 0.0, 3.1]);
    let beside = red_cuboid([0.1, 3.0, 3.0], [2.1, 0.0, 0.0]);
    let mesh = SceneMesh::build(&scene_of(&[ahead, beside]));
    let camera = level_camera(301, 301, 90.0_f64.to_radians(), [0.5, 0.0, 0.0]);
    let mut frame = FrameBuffer::default();
    render(&mesh, &camera, Want { rgb: Some(Style::Plain), instances: false }, &mut frame).unwrap();
    let at = |col: usize| &frame.rgb[3 * (150 * 301 + col)..][..3];
    assert_eq!(at(20), [204, 222, 236]);
    assert!(at(160)[0] > 3 * at(160)[1]);
    // The walls meet at x = 2, z = 3.
    let corner = (150.5 + 150.5 * 1.5 / 3.0) as usize;
    assert!(u32::from(at(corner)[0]) * 10 < u32::from(at(corner - 30)[0]) * 8);
}

/// The gap under a door is dark, not as bright as the sky.
#[test]
fn nothing_is_bright_above_the_horizon_and_dark_below() {
    let mesh = SceneMesh::build(&scene_of(&[red_cuboid([0.1; 3], [0.0, 0.0, -3.0])]));
    let camera = level_camera(40, 40, 1.5, [0.0, 1.5, 0.0]);
    let mut frame = FrameBuffer::default();
    let want = Want { rgb: Some(Style::Default), instances: false };
    render(&mesh, &camera, want, &mut frame).unwrap();
    let brightness: Vec<u32> =
        frame.rgb.chunks_exact(3 * 40).map(|row| row.iter().map(|&c| u32::from(c)).sum()).collect();
    let (above, below) = brightness.split_at(20);
    assert!(above.iter().all(|&row| row > 4 * below[19]));
    assert!(below.iter().all(|&row| row == below[19]));
}

/// A wall 20 m away is seen, one a hair farther is sky; so is what the near plane cuts off.
#[test]
fn surfaces_are_drawn_between_the_clip_planes() {
    let slab = |z: f64| red_cuboid([100.0, 100.0, 0.05], [0.0, 0.0, z + 0.05]);
    let camera = level_camera(9, 7, 1.5, [0.0; 3]);
    let [near_m, far_m] = CLIP_M;
    for half_height_m in [None, Some(2.0)] {
        let view = View { half_height_m, ..View::from(camera) };
        let mut frame = FrameBuffer::default();
        let want = Want { rgb: Some(Style::Plain), instances: true };
        for (z, is_seen) in [
            (near_m - 1e-3, false),
            (near_m + 1e-3, true),
            (far_m - 1e-3, true),
            (far_m + 1e-3, false),
        ] {
            let mesh = SceneMesh::build(&scene_of(&[slab(z)]));
            render_view(&mesh, &view, want, &mut frame).unwrap();
            assert!(frame.depth_m.iter().all(|d| d.is_finite() == is_seen), "{z}");
            assert!(frame.instances.iter().all(|&id| id == i32::from(is_seen)), "{z}");
            let is_sky = |pixel: &[u8]| pixel == [204, 222, 236];
            assert!(frame.rgb.chunks_exact(3).all(|pixel| is_sky(pixel) != is_seen), "{z}");
            let is_close = |d: f32| (f64::from(d) - z).abs() < 1e-4;
            assert!(!is_seen || frame.depth_m.iter().all(|&d| is_close(d)), "{z}");
        }
    }
    for clip_m in [[0.0, 1.0], [2.0, 1.0], [1.0, f64::NAN], [f64::NAN, 1.0], [0.1, f64::INFINITY]] {
        assert!(View { clip_m, ..View::from(camera) }.check().is_err(), "{clip_m:?}");
    }
}

/// AI2-THOR's ceilings have one side: seen from below, looked through from above.
#[test]
fn ceilings_are_seen_from_below_only() {
    let slab = |y: f64| red_cuboid([10.0, 0.01, 10.0], [0.0, y, 0.0]);
    let mut scene = scene_of(&[slab(0.0), slab(2.5)]);
    scene.bodies[1].kind = BodyKind::Ceiling;
    let mesh = SceneMesh::build(&scene);
    let middle = |y: f64, horizon_rad: f64| {
        let camera = Camera { horizon_rad, ..level_camera(3, 3, 1.0, [0.0, y, 0.0]) };
        let mut frame = FrameBuffer::default();
        render(&mesh, &camera, Want { rgb: None, instances: true }, &mut frame).unwrap();
        frame.instances[4]
    };
    assert_eq!(middle(1.0, -1.5), 2);
    assert_eq!(middle(1.0, 1.5), 1);
    assert_eq!(middle(6.0, std::f64::consts::FRAC_PI_2), 1);
}
