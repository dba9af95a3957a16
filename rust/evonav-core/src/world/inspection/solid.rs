//! Convex parts for contact tests by GJK and EPA.

use parry3d_f64::{
    math::{Pose, Vector},
    query::details::{contact_support_map_support_map, intersection_test_support_map_support_map},
    shape::SupportMap,
};

use crate::{
    assets::part::{Part, Primitive},
    geometry::{Aabb, IDENTITY, Mat3, Vec2, Vec3, add, rotate, sub, transposed},
};

/// Half the width of the column that tests whether something is over a point.
const COLUMN_M: f64 = 1e-4;

/// Length below which a cross product of edges is that of parallels; solids may be thinner than
/// millimetres.
const MIN_AXIS: f64 = 1e-9;

/// A convex part in the world's axes, about its own centre.
#[derive(Debug, Clone)]
pub(super) struct Solid {
    centre_m: Vec3,
    shape: Shape,
    /// Normals of the faces, of any length.
    normals: Vec<Vector>,
    /// Directions of the edges, of any length.
    edges: Vec<Vector>,
    pub(super) aabb: Aabb,
}

#[derive(Debug, Clone)]
enum Shape {
    Corners(Vec<Vector>),
    /// Half axes and orientation: `world = rotation * own`.
    Ellipsoid(Vec3, Mat3),
}

impl Solid {
    pub(super) fn of(part: &Part) -> Self {
        let turned = |corner: Vec3| vector(rotate(&part.rotation, corner));
        let (shape, normals, edges) = match part.primitive {
            Primitive::Cuboid { half_m: [x, y, z] } | Primitive::Pad { half_m: [x, y, z], .. } => {
                let axes =
                    [turned([1.0, 0.0, 0.0]), turned([0.0, 1.0, 0.0]), turned([0.0, 0.0, 1.0])];
                let signs = (0..8)
                    .map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|bit| 1.0 - 2.0 * f64::from(bit)));
                let corners = signs.map(|[a, b, c]| turned([a * x, b * y, c * z])).collect();
                (Shape::Corners(corners), axes.to_vec(), axes.to_vec())
            }
            Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => {
                let lower = Primitive::ring_m(bottom_m, -half_height_m, sides);
                let upper = Primitive::ring_m(top_m, half_height_m, sides);
                let corners: Vec<Vector> = lower.chain(upper).map(turned).collect();
                let (normals, edges) = faces(&corners, turned([0.0, 1.0, 0.0]));
                (Shape::Corners(corners), normals, edges)
            }
            Primitive::Ellipsoid { half_m } => {
                (Shape::Ellipsoid(half_m, part.rotation), vec![], vec![])
            }
        };
        Self { centre_m: part.centre_m, shape, normals, edges, aabb: part.aabb() }
    }

    /// Create a thin upright column through a ground point that reaches far above and below all
    /// houses.
    pub(super) fn column([x, z]: Vec2) -> Self {
        const HALF_M: Vec3 = [COLUMN_M, 100.0, COLUMN_M];
        Self::of(&Part {
            primitive: Primitive::Cuboid { half_m: HALF_M },
            centre_m: [x, 0.0, z],
            rotation: IDENTITY,
            colour: [0; 3],
            material: Default::default(),
        })
    }

    pub(super) fn lowered(&self, by_m: f64) -> Self {
        let down = [0.0, -by_m, 0.0];
        let aabb = Aabb { min_m: add(self.aabb.min_m, down), max_m: add(self.aabb.max_m, down) };
        Self { centre_m: add(self.centre_m, down), aabb, ..self.clone() }
    }

    pub(super) fn meets(&self, other: &Self) -> bool {
        let between = Pose::from_translation(vector(sub(other.centre_m, self.centre_m)));
        self.aabb.intersects(&other.aabb)
            && intersection_test_support_map_support_map(&between, self, other)
    }

    /// Return the depth of penetration into another solid, 0 if they do not meet. It is exact for
    /// flat-sided solids; for ellipsoids it is EPA's, which may be too small.
    pub(super) fn depth_m(&self, other: &Self) -> f64 {
        if !self.meets(other) {
            return 0.0;
        }
        let offset = vector(sub(other.centre_m, self.centre_m));
        let (Shape::Corners(one), Shape::Corners(another)) = (&self.shape, &other.shape) else {
            let between = Pose::from_translation(offset);
            let contact = contact_support_map_support_map(&between, self, other, 0.0);
            return contact.map_or(0.0, |contact| (-contact.dist).max(0.0));
        };
        // The shortest way out is along a face's normal, or perpendicular to an edge of each.
        let crossed = self.edges.iter().flat_map(|a| other.edges.iter().map(|b| a.cross(*b)));
        let axes = self.normals.iter().chain(&other.normals).copied().chain(crossed);
        let depths_m = axes.filter_map(|axis| {
            let axis = (axis.length() > MIN_AXIS).then(|| axis.normalize())?;
            let farthest = |corners: &[Vector], sign: f64| {
                corners.iter().map(|c| sign * c.dot(axis)).fold(f64::NEG_INFINITY, f64::max)
            };
            let along_m = farthest(one, 1.0) + farthest(another, -1.0) - offset.dot(axis);
            let against_m = farthest(one, -1.0) + farthest(another, 1.0) + offset.dot(axis);
            Some(along_m.min(against_m))
        });
        depths_m.fold(f64::INFINITY, f64::min).max(0.0)
    }

    /// Return the ground points that span the solid, seen from above.
    pub(super) fn points(&self) -> impl Iterator<Item = Vec2> + '_ {
        let centre = [self.centre_m[0], self.centre_m[2]];
        let offsets: Vec<Vector> = match &self.shape {
            Shape::Corners(corners) => corners.clone(),
            Shape::Ellipsoid(..) => (0..16)
                .map(|k| (f64::from(k) * std::f64::consts::TAU / 16.0).sin_cos())
                .map(|(sin, cos)| self.local_support_point(Vector::new(cos, 0.0, sin)))
                .collect(),
        };
        offsets.into_iter().map(move |p| [centre[0] + p.x, centre[1] + p.z])
    }
}

impl SupportMap for Solid {
    fn local_support_point(&self, dir: Vector) -> Vector {
        match &self.shape {
            Shape::Corners(corners) => {
                let mut best = (f64::NEG_INFINITY, Vector::ZERO);
                for &corner in corners {
                    let along = corner.dot(dir);
                    if along > best.0 {
                        best = (along, corner);
                    }
                }
                best.1
            }
            Shape::Ellipsoid(half_m, rotation) => {
                let own = rotate(&transposed(rotation), [dir.x, dir.y, dir.z]);
                let scaled: Vec3 = std::array::from_fn(|i| half_m[i] * own[i]);
                let length = scaled.iter().map(|value| value * value).sum::<f64>().sqrt();
                let point =
                    std::array::from_fn(|i| half_m[i] * scaled[i] / length.max(f64::MIN_POSITIVE));
                vector(rotate(rotation, point))
            }
        }
    }
}

/// Return the face normals and edges of a frustum with these corners, the lower ring first. Sides
/// that are not flat fold along either diagonal; using both costs time and does not change the
/// smallest depth.
fn faces(corners: &[Vector], up: Vector) -> (Vec<Vector>, Vec<Vector>) {
    let (lower, upper) = corners.split_at(corners.len() / 2);
    let (mut normals, mut edges) = (vec![up], vec![]);
    for i in 0..lower.len() {
        let next = (i + 1) % lower.len();
        let [a, b, c, d] = [lower[i], lower[next], upper[next], upper[i]];
        edges.extend([b - a, c - d, d - a]);
        normals.extend([(b - a).cross(d - a), (c - d).cross(d - a)]);
        let is_flat = (b - a).cross(d - a).dot(c - a).abs() < 1e-12;
        if !is_flat {
            edges.extend([c - a, d - b]);
            normals.extend([(b - a).cross(c - a), (d - a).cross(c - a), (c - b).cross(d - b)]);
        }
    }
    (normals, edges)
}

fn vector([x, y, z]: Vec3) -> Vector {
    Vector::new(x, y, z)
}
