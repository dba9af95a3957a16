//! Scenes of bodies that are given by their parts, and products of vectors.

use evonav_core::{
    assets::part::{Part, aabb_of},
    geometry::{Aabb, Vec3},
    world::scene::{Body, BodyKind, OrientedBox, Scene},
};

pub fn scene_of(bodies: &[Vec<Part>]) -> Scene {
    let body = |(index, parts): (usize, &Vec<Part>)| Body {
        id: format!("body|{index}"),
        category: "Box".to_owned(),
        kind: BodyKind::Object,
        parts: parts.clone(),
        trim: Vec::new(),
        aabb: aabb_of(parts),
        unopened: Aabb::EMPTY,
        oriented: OrientedBox::of_aabb(&aabb_of(parts)),
    };
    let bodies = bodies.iter().enumerate().map(body).collect();
    Scene { bodies, first_object: 0, bounds: Aabb::EMPTY }
}

pub fn dot(a: Vec3, b: Vec3) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}
