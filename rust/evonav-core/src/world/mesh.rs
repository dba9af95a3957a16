//! Surfaces of a scene as convex planar faces, for rendering and ray casting.

use std::ops::Range;

use crate::{
    assets::{
        material::MaterialKind,
        part::{Part, Primitive},
    },
    geometry::{Aabb, Vec3, add, rotate, sub},
    world::{
        scene::{BodyKind, Scene},
        skin::{Skin, Tailor},
    },
};

/// Meridians of an ellipsoid; a multiple of 4, so that its box is exact.
const ELLIPSOID_MERIDIANS: usize = 12;
/// Bands of an ellipsoid from pole to pole; even, so that its box is exact.
const ELLIPSOID_BANDS: usize = 6;
/// Corners of a pad's outline.
const PAD_SIDES: usize = 8;
/// Faces smaller than this (twice the area, in square metres) are left out.
const LEAST_AREA_M2: f64 = 1e-12;

/// A convex, planar, one-sided polygon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Outward unit normal, world frame.
    pub normal: Vec3,
    /// Offset of its plane: `normal . p` of its points `p`.
    pub offset_m: f64,
    /// Index in [`SceneMesh::corners`] of its first corner.
    first_corner: u32,
    /// Number of corners, 3 or more.
    num_corners: u32,
    /// Index of its body in the scene.
    pub body: u32,
    /// Surface colour, sRGB.
    pub colour: [u8; 3],
}

impl Face {
    /// Return the face as it is seen from behind; its corners run the other way round.
    pub(crate) fn reversed(&self) -> Self {
        Self { normal: self.normal.map(|n| -n), offset_m: -self.offset_m, ..*self }
    }
}

/// One convex part: its vertices and faces are consecutive.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PartMesh {
    pub vertices: Range<usize>,
    pub faces: Range<usize>,
    pub body: u32,
    pub aabb: Aabb,
    /// Whether it is glass that is seen through.
    pub is_pane: bool,
}

/// The parts of a body, which are consecutive, and the box around them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BodyParts {
    pub parts: Range<usize>,
    pub aabb: Aabb,
}

/// Parts that are drawn together: the solid ones, or those that only colours show.
#[derive(Clone, Copy)]
pub(crate) struct Layer<'a> {
    pub parts: &'a [PartMesh],
    pub bodies: &'a [BodyParts],
}

/// All surfaces of a scene, in the order of its bodies and their parts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SceneMesh {
    pub(crate) vertices_m: Vec<Vec3>,
    /// Vertex indices, counted from the part's first vertex, clockwise seen from outside.
    pub(crate) corners: Vec<u32>,
    pub(crate) faces: Vec<Face>,
    /// The material on each face.
    pub(crate) skins: Vec<Skin>,
    pub(crate) parts: Vec<PartMesh>,
    /// The parts that only colours show; their faces come after all others.
    pub(crate) trim: Vec<PartMesh>,
    solid_bodies: Vec<BodyParts>,
    trim_bodies: Vec<BodyParts>,
    num_solid_faces: usize,
    num_bodies: usize,
}

/// A triangle in the world frame, for consumers that cannot use polygons.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// Corners, world frame, clockwise seen from outside.
    pub vertices_m: [Vec3; 3],
    /// Index of its body in the scene.
    pub body: u32,
    /// Surface colour, sRGB.
    pub colour: [u8; 3],
}

impl SceneMesh {
    /// Tessellate every part of every body.
    ///
    /// Cuboids become 6 quads, frusta two polygons and a ring of quads, ellipsoids a globe of
    /// quads and triangles inscribed in them. Faces without an area are left out.
    ///
    /// # Complexity
    /// O(parts); about 0.6 ms for a house of a hundred objects.
    pub fn build(scene: &Scene) -> Self {
        let mut mesh = Self { num_bodies: scene.bodies.len(), ..Self::default() };
        for (index, body) in scene.bodies.iter().enumerate() {
            // Ceilings have one side, as AI2-THOR's: from above one looks into the house.
            let is_shown = |normal: Vec3| body.kind != BodyKind::Ceiling || normal[1] < 0.0;
            let is_structure =
                matches!(body.kind, BodyKind::Wall | BodyKind::Floor | BodyKind::Ceiling);
            for (number, part) in body.parts.iter().enumerate() {
                let tailor = Tailor::new(part, is_structure, number);
                let part = mesh.tessellate(part, index as u32, &tailor, is_shown);
                mesh.parts.extend(part);
            }
        }
        mesh.num_solid_faces = mesh.faces.len();
        for (index, body) in scene.bodies.iter().enumerate() {
            for (number, part) in body.trim.iter().enumerate() {
                let tailor = Tailor::new(part, false, body.parts.len() + number);
                let part = mesh.tessellate(part, index as u32, &tailor, |_| true);
                mesh.trim.extend(part);
            }
        }
        mesh.solid_bodies = by_body(&mesh.parts);
        mesh.trim_bodies = by_body(&mesh.trim);
        mesh
    }

    /// Return the solid parts.
    pub(crate) fn solid_layer(&self) -> Layer<'_> {
        Layer { parts: &self.parts, bodies: &self.solid_bodies }
    }

    /// Return the parts that only colours show.
    pub(crate) fn trim_layer(&self) -> Layer<'_> {
        Layer { parts: &self.trim, bodies: &self.trim_bodies }
    }

    /// Return the number of bodies of the scene from which the mesh was built.
    pub fn num_bodies(&self) -> usize {
        self.num_bodies
    }

    /// Return the faces of the solid parts, grouped by body in ascending order.
    pub fn faces(&self) -> &[Face] {
        &self.faces[..self.num_solid_faces]
    }

    /// Return the material on each of the [`faces`](Self::faces).
    pub fn skins(&self) -> &[Skin] {
        &self.skins[..self.num_solid_faces]
    }

    /// Return the faces of the solid parts cut into triangles, in their order.
    pub fn triangles(&self) -> impl Iterator<Item = Triangle> + '_ {
        self.parts.iter().flat_map(move |part| {
            let vertices_m = &self.vertices_m[part.vertices.clone()];
            self.faces[part.faces.clone()].iter().flat_map(move |face| {
                let corners = self.corners_of(face);
                corners[1..].windows(2).map(move |pair| Triangle {
                    vertices_m: [corners[0], pair[0], pair[1]].map(|i| vertices_m[i as usize]),
                    body: face.body,
                    colour: face.colour,
                })
            })
        })
    }

    /// Return whether a face is glass that is seen through.
    pub(crate) fn is_pane(&self, face: usize) -> bool {
        self.skins[face].material.kind == MaterialKind::Pane
    }

    /// Return a face's vertex indices, counted from its part's first vertex.
    pub(crate) fn corners_of(&self, face: &Face) -> &[u32] {
        let first = face.first_corner as usize;
        &self.corners[first..first + face.num_corners as usize]
    }

    /// Add the vertices and faces of a part; `None` if it has no face.
    fn tessellate(
        &mut self,
        part: &Part,
        body: u32,
        tailor: &Tailor<'_>,
        is_shown: impl Fn(Vec3) -> bool,
    ) -> Option<PartMesh> {
        let (first_vertex, first_face) = (self.vertices_m.len(), self.faces.len());
        let vertices_m = vertices_of(&part.primitive);
        let to_world = |v: &Vec3| add(part.centre_m, rotate(&part.rotation, *v));
        self.vertices_m.extend(vertices_m.iter().map(to_world));
        let mut number = 0;
        each_polygon(&part.primitive, &vertices_m, |polygon| {
            self.push_polygon(polygon, first_vertex, body, part.colour, &is_shown);
            for face in &self.faces[self.skins.len()..] {
                self.skins.push(tailor.skin(face.normal, number));
            }
            number += 1;
        });
        if self.faces.len() == first_face {
            self.vertices_m.truncate(first_vertex);
            return None;
        }
        Some(PartMesh {
            vertices: first_vertex..self.vertices_m.len(),
            faces: first_face..self.faces.len(),
            body,
            aabb: Aabb::of_points(self.vertices_m[first_vertex..].iter().copied()),
            is_pane: part.material.kind == MaterialKind::Pane,
        })
    }

    /// Add a polygon. Four corners that do not lie in a plane (the sides of a frustum whose ends
    /// are ellipses of different shapes) become two triangles.
    fn push_polygon(
        &mut self,
        polygon: &[u32],
        first_vertex: usize,
        body: u32,
        colour: [u8; 3],
        is_shown: &impl Fn(Vec3) -> bool,
    ) {
        let at = |i: u32| self.vertices_m[first_vertex + i as usize];
        let (normal, area_m2) = newell(polygon.iter().map(|&i| at(i)));
        if !area_m2.is_finite() || area_m2 <= LEAST_AREA_M2 || !is_shown(normal) {
            return;
        }
        let offset_m =
            polygon.iter().map(|&i| dot(normal, at(i))).sum::<f64>() / polygon.len() as f64;
        let is_planar = polygon.iter().all(|&i| (dot(normal, at(i)) - offset_m).abs() < 1e-7);
        if let (&[a, b, c, d], false) = (polygon, is_planar) {
            // Of the two diagonals, the one that bulges outwards keeps the solid convex.
            let (half, _) = newell([at(a), at(b), at(c)].into_iter());
            let bulges = dot(half, sub(at(d), at(a))) <= 0.0;
            let halves = if bulges { [[a, b, c], [a, c, d]] } else { [[b, c, d], [b, d, a]] };
            for half in &halves {
                self.push_polygon(half, first_vertex, body, colour, is_shown);
            }
            return;
        }
        self.faces.push(Face {
            normal,
            offset_m,
            first_corner: self.corners.len() as u32,
            num_corners: polygon.len() as u32,
            body,
            colour,
        });
        self.corners.extend_from_slice(polygon);
    }
}

fn by_body(parts: &[PartMesh]) -> Vec<BodyParts> {
    let mut first = 0;
    let of_body = |parts: &[PartMesh]| {
        let aabb = parts.iter().fold(Aabb::EMPTY, |all, part| all.union(part.aabb));
        let range = first..first + parts.len();
        first = range.end;
        BodyParts { parts: range, aabb }
    };
    parts.chunk_by(|a, b| a.body == b.body).map(of_body).collect()
}

/// Return the unit normal (towards the side from which the polygon runs clockwise) and twice the
/// area.
fn newell(points_m: impl Iterator<Item = Vec3> + Clone) -> (Vec3, f64) {
    let mut sum = [0.0; 3];
    let next = points_m.clone().cycle().skip(1);
    for (a, b) in points_m.zip(next) {
        for (axis, sum) in sum.iter_mut().enumerate() {
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            *sum += (a[j] - b[j]) * (a[k] + b[k]);
        }
    }
    // The frame is left-handed: clockwise from outside gives the outward normal by this formula.
    let area_m2 = dot(sum, sum).sqrt();
    (sum.map(|v| v / area_m2), area_m2)
}

pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Return the vertices of a primitive in its own frame.
pub(crate) fn vertices_of(primitive: &Primitive) -> Vec<Vec3> {
    match *primitive {
        Primitive::Cuboid { half_m } => {
            let corner = |i: usize, axis: usize| {
                if i >> axis & 1 == 1 { half_m[axis] } else { -half_m[axis] }
            };
            (0..8).map(|i| std::array::from_fn(|axis| corner(i, axis))).collect()
        }
        Primitive::Frustum { bottom_m, top_m, half_height_m, sides } => {
            let levels = [(bottom_m, -half_height_m), (top_m, half_height_m)];
            rings(usize::from(sides.max(3)), &levels)
        }
        Primitive::Ellipsoid { half_m: [x, y, z] } => {
            let ring = |band: usize| {
                let latitude_rad =
                    std::f64::consts::PI * (band as f64 / ELLIPSOID_BANDS as f64 - 0.5);
                // Exactly 0 at the poles, so that their corners coincide.
                let is_pole = band == 0 || band == ELLIPSOID_BANDS;
                let radius = if is_pole { 0.0 } else { latitude_rad.cos() };
                ([x * radius, z * radius], y * latitude_rad.sin())
            };
            let levels: [_; ELLIPSOID_BANDS + 1] = std::array::from_fn(ring);
            rings(ELLIPSOID_MERIDIANS, &levels)
        }
        Primitive::Pad { half_m: [x, y, z], cut_m } => {
            let cut_m = cut_m.min(x).min(y).min(z);
            let levels = [(cut_m, -y), (0.0, cut_m - y), (0.0, y - cut_m), (cut_m, y)];
            let level = |(inset_m, height_m)| {
                octagon([x - inset_m, z - inset_m], cut_m).map(|[x, z]| [x, height_m, z])
            };
            levels.map(level).into_iter().flatten().collect()
        }
    }
}

/// Return the corners of a rectangle about the origin whose own corners are cut off, in the order
/// of [`rings`].
fn octagon([x, z]: [f64; 2], cut_m: f64) -> [[f64; 2]; PAD_SIDES] {
    let [near_x, near_z] = [x, z].map(|half| (half - cut_m).max(0.0));
    let quarter = [[x, near_z], [near_x, z]];
    let turned = [[-near_x, z], [-x, near_z]];
    let back = |[x, z]: [f64; 2]| [-x, -z];
    let [[a, b], [c, d]] = [quarter, turned];
    [a, b, c, d, back(a), back(b), back(c), back(d)]
}

/// Return the solid's corners on elliptic rings `(half axes [x, z], y)`, lowest first, over a
/// regular `sides`-gon with a corner on +x.
fn rings(sides: usize, levels: &[([f64; 2], f64)]) -> Vec<Vec3> {
    let turn = |k: usize| (std::f64::consts::TAU * k as f64 / sides as f64).sin_cos();
    let turns: Vec<(f64, f64)> = (0..sides).map(turn).collect();
    let ring =
        |&([x, z], y): &([f64; 2], f64)| turns.iter().map(move |(sin, cos)| [x * cos, y, z * sin]);
    levels.iter().flat_map(ring).collect()
}

/// Faces of a cuboid.
const CUBOID: [[u32; 4]; 6] =
    [[1, 3, 7, 5], [0, 4, 6, 2], [2, 6, 7, 3], [0, 1, 5, 4], [4, 5, 7, 6], [0, 2, 3, 1]];

/// Call `visit` with each of a primitive's outward polygons, as indices of its vertices.
///
/// # Arguments
/// * `vertices_m` - [`vertices_of`] the primitive, in its own frame.
pub(crate) fn each_polygon(
    primitive: &Primitive,
    vertices_m: &[Vec3],
    mut visit: impl FnMut(&[u32]),
) {
    let num_sides = match *primitive {
        Primitive::Cuboid { .. } => return CUBOID.iter().for_each(|polygon| visit(polygon)),
        Primitive::Frustum { sides, .. } => u32::from(sides.max(3)),
        Primitive::Ellipsoid { .. } => ELLIPSOID_MERIDIANS as u32,
        Primitive::Pad { .. } => PAD_SIDES as u32,
    };
    let last = vertices_m.len() as u32 - num_sides;
    let mut polygon = Vec::new();
    let at = |i: u32| vertices_m[i as usize];
    // Rings that are shrunk to a point have coinciding corners.
    let mut visit_distinct = |corners: &mut dyn Iterator<Item = u32>| {
        polygon.clear();
        polygon.extend(corners);
        polygon.dedup_by_key(|&mut i| at(i));
        while polygon.len() > 1 && at(polygon[0]) == at(polygon[polygon.len() - 1]) {
            polygon.pop();
        }
        if polygon.len() >= 3 {
            visit(&polygon);
        }
    };
    visit_distinct(&mut (0..num_sides));
    visit_distinct(&mut (last..last + num_sides).rev());
    for low in (0..last).step_by(num_sides as usize) {
        for k in 0..num_sides {
            let next = (k + 1) % num_sides;
            let corners = [low + k, low + num_sides + k, low + num_sides + next, low + next];
            visit_distinct(&mut corners.into_iter());
        }
    }
}
