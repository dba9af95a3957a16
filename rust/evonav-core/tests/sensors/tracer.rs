//! A ray tracer that tries every triangle: the plain twin of what renders images.

use evonav_core::{
    assets::part::{Part, Primitive},
    geometry::{Vec3, add, euler_rotation_deg, rotate, sub},
    sensors::camera::{Camera, View},
    world::{mesh::Triangle, scene::Scene},
};
use proptest::prelude::*;

use crate::common::scenes::{self, cross, dot};

/// A scene with a body for each part.
pub fn scene_of(parts: &[Part]) -> Scene {
    scenes::scene_of(&parts.iter().map(|part| vec![*part]).collect::<Vec<_>>())
}

/// A turned cuboid before a camera at the origin that looks along z.
pub fn cuboid_ahead() -> impl Strategy<Value = Part> {
    let half_m = [0.1..0.8_f64, 0.1..0.8_f64, 0.1..0.8_f64];
    let place = [-1.5..1.5_f64, -1.0..1.5_f64, 1.5..4.0_f64];
    let angles = [0.0..360.0_f64, 0.0..360.0_f64, 0.0..360.0_f64];
    (half_m, place, angles, any::<[u8; 3]>()).prop_map(|(half_m, centre_m, angles_deg, colour)| {
        Part {
            primitive: Primitive::Cuboid { half_m },
            centre_m,
            rotation: euler_rotation_deg(angles_deg),
            colour,
            material: Default::default(),
        }
    })
}

/// Moeller & Trumbore 1997, front side only. Returns the distance and how deep inside the
/// triangle the ray passes (smallest barycentric coordinate).
pub fn intersect(triangle: &Triangle, origin_m: Vec3, direction: Vec3) -> Option<(f64, f64)> {
    let [a, b, c] = triangle.vertices_m;
    let (ab, ac, to_origin) = (sub(b, a), sub(c, a), sub(origin_m, a));
    let normal = cross(ab, ac);
    let facing = dot(normal, direction);
    if facing >= 0.0 {
        return None;
    }
    let distance = -dot(normal, to_origin) / facing;
    let turn = cross(direction, to_origin);
    let beta = dot(ac, turn) / facing;
    let gamma = -dot(ab, turn) / facing;
    let depth_inside = beta.min(gamma).min(1.0 - beta - gamma);
    Some((distance, depth_inside))
}

/// Origin and direction of the look through a pixel: lengths along it are planar depths.
pub fn look_through(view: &View, image_px: [f64; 2]) -> (Vec3, Vec3) {
    let Camera { width_px, height_px, vertical_fov_rad, position_m, yaw_rad, horizon_rad } =
        view.camera;
    let half_m = view.half_height_m.unwrap_or((vertical_fov_rad / 2.0).tan());
    let metres =
        |px: f64, size_px: usize| (px - size_px as f64 / 2.0) * half_m / (height_px as f64 / 2.0);
    let (right, up) = (metres(image_px[0], width_px), -metres(image_px[1], height_px));
    // Unity's rotation takes the camera's own right, up and forward to the world.
    let angles_deg = [horizon_rad, yaw_rad, view.roll_rad].map(f64::to_degrees);
    let to_world = |v: Vec3| rotate(&euler_rotation_deg(angles_deg), v);
    match view.half_height_m {
        Some(_) => (add(position_m, to_world([right, up, 0.0])), to_world([0.0, 0.0, 1.0])),
        None => (position_m, to_world([right, up, 1.0])),
    }
}

/// The first triangle along the look through a pixel's middle, and its unit normal.
pub fn first_met<'a>(
    triangles: &'a [Triangle],
    view: &View,
    pixel: [i64; 2],
) -> Option<(&'a Triangle, Vec3)> {
    let (origin_m, ray) = look_through(view, pixel.map(|at| at as f64 + 0.5));
    let hits = triangles.iter().filter_map(|triangle| {
        let (distance, inside) = intersect(triangle, origin_m, ray)?;
        let is_met = inside >= 0.0 && (view.clip_m[0]..view.clip_m[1]).contains(&distance);
        is_met.then_some((distance, triangle))
    });
    let (_, triangle) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let [a, b, c] = triangle.vertices_m;
    let normal: Vec3 = cross(sub(b, a), sub(c, a));
    let length = dot(normal, normal).sqrt();
    Some((triangle, normal.map(|x| x / length)))
}
