//! Cast single rays through a scene, for line of sight and picking; [`crate::sensors::raster`]
//! draws whole images.

use parry3d_f64::{
    bounding_volume::Aabb,
    math::Vector,
    partitioning::{Bvh, BvhBuildStrategy},
    query::Ray,
};

use crate::{
    geometry::{Vec3, add, sub},
    world::mesh::{Face, SceneMesh, dot},
};

/// Distance outside of an edge at which a ray still hits, so that neighbouring faces leave no gap.
const EDGE_M: f64 = 1e-9;

/// A bounding volume hierarchy over the parts of a mesh.
#[derive(Debug, Clone)]
pub struct RayCaster {
    bvh: Bvh,
}

/// The surface that a ray meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance as a multiple of the ray's direction.
    pub distance: f64,
    /// Index of the body in the scene.
    pub body: usize,
}

impl RayCaster {
    /// Build the hierarchy; `mesh` must be passed to the queries as well.
    pub fn build(mesh: &SceneMesh) -> Self {
        let vector = |v: Vec3| Vector::new(v[0], v[1], v[2]);
        let boxes: Vec<Aabb> = mesh
            .parts
            .iter()
            .map(|part| Aabb::new(vector(part.aabb.min_m), vector(part.aabb.max_m)))
            .collect();
        Self { bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes) }
    }

    /// Find the first surface that a ray meets within `max_distance` multiples of `direction`.
    ///
    /// As in images, faces are visible only from outside: a ray that starts inside a part leaves it
    /// without a hit.
    ///
    /// # Returns
    /// `None` if nothing is met, or a number is not finite.
    ///
    /// # Complexity
    /// O(log parts) for typical houses.
    pub fn cast(
        &self,
        mesh: &SceneMesh,
        origin_m: Vec3,
        direction: Vec3,
        max_distance: f64,
    ) -> Option<Hit> {
        let numbers = [origin_m, direction].concat();
        if !numbers.iter().all(|v| v.is_finite()) || max_distance.is_nan() {
            return None;
        }
        let vector = |v: Vec3| Vector::new(v[0], v[1], v[2]);
        let ray = Ray::new(vector(origin_m), vector(direction));
        let (part, distance) = self.bvh.find_best(
            max_distance.min(f64::MAX),
            |node, nearest| node.cast_ray(&ray, nearest),
            |part, nearest| enter(mesh, part as usize, origin_m, direction, nearest),
        )?;
        Some(Hit { distance, body: mesh.parts[part as usize].body as usize })
    }

    /// Return whether nothing is between two points. Bodies for which `ignores` is true do not
    /// count: an object does not hide itself. The result is false for points that are not finite.
    pub fn is_visible(
        &self,
        mesh: &SceneMesh,
        from_m: Vec3,
        to_m: Vec3,
        ignores: impl Fn(usize) -> bool,
    ) -> bool {
        let vector = |v: Vec3| Vector::new(v[0], v[1], v[2]);
        let direction = sub(to_m, from_m);
        if ![from_m, direction].as_flattened().iter().all(|v| v.is_finite()) {
            return false;
        }
        let ray = Ray::new(vector(from_m), vector(direction));
        let is_blocked = self
            .bvh
            .leaves(|node| node.cast_ray(&ray, 1.0) <= 1.0)
            .filter(|&part| !ignores(mesh.parts[part as usize].body as usize))
            .any(|part| enter(mesh, part as usize, from_m, direction, 1.0).is_some());
        !is_blocked
    }
}

/// Return the distance at which a ray enters a part, if it is less than `nearest`.
fn enter(
    mesh: &SceneMesh,
    part: usize,
    origin_m: Vec3,
    direction: Vec3,
    nearest: f64,
) -> Option<f64> {
    let part = &mesh.parts[part];
    let vertices_m = &mesh.vertices_m[part.vertices.clone()];
    let distance_to = |face: &Face| {
        let slope = dot(face.normal, direction);
        let distance = (face.offset_m - dot(face.normal, origin_m)) / slope;
        // `slope` is negative if the ray runs into the face.
        let is_ahead = slope < 0.0 && distance >= 0.0 && distance < nearest;
        let point_m = add(origin_m, direction.map(|d| d * distance));
        (is_ahead && contains(mesh.corners_of(face), vertices_m, face.normal, point_m))
            .then_some(distance)
    };
    mesh.faces[part.faces.clone()].iter().filter_map(distance_to).min_by(f64::total_cmp)
}

/// Return whether a point of a face's plane lies within its edges.
fn contains(corners: &[u32], vertices_m: &[Vec3], normal: Vec3, point_m: Vec3) -> bool {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).all(|(&a, &b)| {
        let (a_m, b_m) = (vertices_m[a as usize], vertices_m[b as usize]);
        let (edge, to_point) = (sub(b_m, a_m), sub(point_m, a_m));
        let inward = cross(normal, edge);
        dot(inward, to_point) >= -EDGE_M * dot(edge, edge).sqrt()
    })
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
