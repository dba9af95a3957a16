//! Find the bodies that AI2-THOR calls *visible* to an agent: near, in the image, and not hidden.

use crate::{
    Error,
    geometry::{Vec2, Vec3, add, outline::distance_squared, sub},
    sensors::{camera::View, ray_caster::RayCaster},
    world::{
        footprint::footprint,
        mesh::SceneMesh,
        scene::{BodyKind, Scene},
    },
};

/// Spacing of the points on large faces.
const PITCH_M: f64 = 0.3;
/// Largest number of points along a side of a face.
const MAX_POINTS_A_SIDE: f64 = 20.0;
/// Position of the points at corners between the middle of the face, 0, and the corner, 1.
const INSIDE: f64 = 0.96;
/// Largest number of points of a body.
const MAX_POINTS: usize = 200;
/// Distance beyond the point to which AI2-THOR casts its rays.
const BEYOND_M: f64 = 0.5;

/// Return the bodies that an agent sees by AI2-THOR's default rule (`visibilityScheme` "Collider"):
/// a part of the body is within `max_distance_m` of the agent's axis on the ground plane, and one
/// of its visibility points is inside the image with nothing else in front of it.
///
/// The points themselves may be farther away than `max_distance_m`, as in AI2-THOR. Ceilings are
/// left out, because AI2-THOR has no objects there.
///
/// # Arguments
/// * `scene`, `mesh`, `rays` - a house's scene, and mesh and ray caster built from it.
/// * `view` - view of the image; its clip planes do not count.
/// * `agent_m` - `[x, z]` of the agent's axis.
/// * `max_distance_m` - AI2-THOR's `visibilityDistance`.
///
/// # Returns
/// Indices of bodies, ascending.
///
/// # Errors
/// [`Error::InvalidArgument`] as [`View::check`], or if `agent_m` or `max_distance_m` is not
/// finite.
///
/// # Complexity
/// O(bodies), and up to 200 rays for each one that is near.
///
/// # Source
/// `GetAllVisibleSimObjPhysicsCollider` and `CheckIfVisibilityPointInViewport` of AI2-THOR's
/// `BaseFPSAgentController`. AI2-THOR's points are part of its assets; here they are
/// [`visibility_points`].
pub fn visible_bodies(
    scene: &Scene,
    mesh: &SceneMesh,
    rays: &RayCaster,
    view: &View,
    agent_m: Vec2,
    max_distance_m: f64,
) -> Result<Vec<usize>, Error> {
    view.check()?;
    Error::require_finite("agent_m", &agent_m)?;
    Error::require("max_distance_m", max_distance_m, "finite", f64::is_finite)?;
    let eye_m = view.camera.position_m;
    let is_first_hit = |body: usize, point_m: Vec3| {
        let to_point = sub(point_m, eye_m);
        let length_m = to_point.map(|v| v * v).iter().sum::<f64>().sqrt();
        let hit = rays.cast(mesh, eye_m, to_point, 1.0 + BEYOND_M / length_m);
        hit.is_some_and(|hit| hit.body == body)
    };
    let is_seen = |&index: &usize| {
        scene.bodies[index].kind != BodyKind::Ceiling
            && is_near(scene, index, agent_m, max_distance_m)
            && visibility_points(mesh, index)
                .into_iter()
                .any(|point_m| view.frames(point_m) && is_first_hit(index, point_m))
    };
    Ok((0..scene.bodies.len()).filter(is_seen).collect())
}

/// Return whether some part of a body is within reach of an upright axis.
fn is_near(scene: &Scene, index: usize, axis_m: Vec2, reach_m: f64) -> bool {
    let body = &scene.bodies[index];
    let gap_m = |axis: usize, at: f64| {
        (body.aabb.min_m[axis] - at).max(at - body.aabb.max_m[axis]).max(0.0)
    };
    gap_m(0, axis_m[0]).hypot(gap_m(2, axis_m[1])) <= reach_m
        && body.parts.iter().any(|part| {
            footprint(part, f64::MIN, f64::MAX).is_some_and(|shadow| {
                distance_squared(&shadow.outline_m, axis_m) <= reach_m * reach_m
            })
        })
}

/// Return the points by which a body is seen: on a grid of about 0.3 m over its four-sided faces,
/// in the middle of all other faces, and just inside the corners of all. If there are more than
/// 200, every second, third ... is used.
///
/// The corners matter for bodies that the image's border or another body cuts: 4 of 14 objects that
/// AI2-THOR calls visible in recordings do not show the middle of any face.
pub fn visibility_points(mesh: &SceneMesh, body: usize) -> Vec<Vec3> {
    let body = body as u32;
    let from = mesh.parts.partition_point(|part| part.body < body);
    let parts = mesh.parts[from..].iter().take_while(|part| part.body == body);
    let mut points_m = Vec::new();
    for part in parts {
        let vertices_m = &mesh.vertices_m[part.vertices.clone()];
        for face in &mesh.faces[part.faces.clone()] {
            let corners = mesh.corners_of(face);
            let at = |i: usize| vertices_m[corners[i] as usize];
            match corners.len() {
                4 => push_grid(&mut points_m, [at(0), at(1), at(2), at(3)]),
                count => points_m.push(weighted((0..count).map(|i| (1.0 / count as f64, at(i))))),
            }
            push_corners(&mut points_m, corners.len(), at);
        }
    }
    let step = points_m.len().div_ceil(MAX_POINTS).max(1);
    points_m.into_iter().step_by(step).collect()
}

/// Add the points of a face just inside its corners.
fn push_corners(points_m: &mut Vec<Vec3>, count: usize, at: impl Fn(usize) -> Vec3) {
    let middle_m = weighted((0..count).map(|i| (1.0 / count as f64, at(i))));
    let inside = |i| weighted([(INSIDE, at(i)), (1.0 - INSIDE, middle_m)].into_iter());
    points_m.extend((0..count).map(inside));
}

/// Add the centres of the cells of a grid over a face with four corners.
fn push_grid(points_m: &mut Vec<Vec3>, [a, b, c, d]: [Vec3; 4]) {
    let count = |from: Vec3, to: Vec3| {
        let length_m = sub(to, from).map(|v| v * v).iter().sum::<f64>().sqrt();
        (length_m / PITCH_M).ceil().clamp(1.0, MAX_POINTS_A_SIDE)
    };
    let (num_u, num_v) = (count(a, b), count(a, d));
    for i in 0..num_u as usize {
        for j in 0..num_v as usize {
            let (u, v) = ((i as f64 + 0.5) / num_u, (j as f64 + 0.5) / num_v);
            let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v];
            points_m.push(weighted(weights.into_iter().zip([a, b, c, d])));
        }
    }
}

fn weighted(terms: impl Iterator<Item = (f64, Vec3)>) -> Vec3 {
    terms.fold([0.0; 3], |sum, (weight, point_m)| add(sum, point_m.map(|v| weight * v)))
}
