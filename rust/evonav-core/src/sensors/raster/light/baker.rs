//! Compute what lamps, windows and the sun give to the points of a face.

use std::sync::Arc;

use crate::{
    geometry::{Vec2, Vec3, sub},
    sensors::raster::{
        canvas::LANES,
        light::{coarse::Coarse, contact::Contact, sources::Sources, sun::Sun},
    },
    world::{
        mesh::{Face, PartMesh, SceneMesh, dot},
        scene::BodyKind,
    },
};

/// Cosine between two faces of a part above which their edge is a rounding.
const SMOOTH: f64 = 0.69;
/// Height over the floor up to which things on the floor take light away.
const CONTACT_M: f64 = 0.7;
/// Distance from a surface at which the space before it is looked up.
const AHEAD_M: f64 = 0.12;
/// Points of the floor's grid, which follows contact, from one to the next at which lamps and windows
/// are looked at.
const FLOOR_STEP: usize = 3;
/// Spacing of the places at which the sun is looked for.
const PROBE_M: f64 = 0.09;
/// Brightness of what shines by itself: screens, and the world behind panes.
const GLOW: f32 = 1.35;

/// The light on one face: a grid of points over the rectangle around it.
#[derive(Debug, Clone, Copy)]
pub(super) struct FaceLight {
    /// Column and row of a world point: `axes . [x, y, z, 1]`.
    pub axes: [[f32; 4]; 2],
    /// Columns and rows, 2 or more.
    pub size: [u16; 2],
    pub first: u32,
    /// Index of the space before the face, if its light is that of a space.
    pub space: Option<u32>,
}

/// All that decides the light on a face, besides the mesh.
#[derive(Debug)]
pub(super) struct Baker {
    /// Kinds of the bodies.
    pub kinds: Vec<BodyKind>,
    pub sources: Sources,
    pub contact: Contact,
    pub sun: Arc<Sun>,
}

impl Baker {
    /// Compute the light on a face, whose points are added to those of its part.
    pub fn bake(
        &self,
        mesh: &SceneMesh,
        part: &PartMesh,
        around: &Around,
        index: usize,
        points: &mut Vec<[f32; 4]>,
    ) -> FaceLight {
        let face = &mesh.faces[index];
        let vertices_m = &mesh.vertices_m[part.vertices.clone()];
        let corners = mesh.corners_of(face);
        let (origin_m, axes, size_m) = frame(face, corners, vertices_m);
        let kind = self.kinds[part.body as usize];
        let pitch_m = match kind {
            BodyKind::Floor => 0.1,
            BodyKind::Wall => 0.3,
            BodyKind::Ceiling => 0.5,
            _ => 0.35,
        };
        let normals: Vec<Vec3> = corners.iter().map(|&i| around.rounded(mesh, face, i)).collect();
        let is_round = normals.iter().any(|normal| dot(*normal, face.normal) < 0.999);
        let cells =
            |edge_m: f64| if is_round { 1 } else { ((edge_m / pitch_m) as usize + 1).min(400) };
        let [columns, rows] = size_m.map(|edge_m| cells(edge_m) + 1);
        let scale =
            [(columns - 1) as f64 / size_m[0].max(1e-6), (rows - 1) as f64 / size_m[1].max(1e-6)];
        let row_of = |axis: usize| {
            let [x, y, z] = axes[axis].map(|a| a * scale[axis]);
            let offset = -scale[axis] * dot(axes[axis], origin_m);
            [x, y, z, offset].map(|term| term as f32)
        };
        let first = points.len() as u32;
        let middle_m = at(origin_m, axes, size_m.map(|edge_m| 0.5 * edge_m));
        let ahead = |point_m: Vec3| -> Vec2 {
            [0, 2].map(|axis| point_m[axis] + AHEAD_M * face.normal[axis])
        };
        let space = self.sources.space_at(ahead(middle_m));
        if mesh.skins[index].material.kind.glows() {
            points.extend([[GLOW, GLOW, GLOW, 0.0]; 4]);
            return FaceLight { axes: [row_of(0), row_of(1)], size: [2, 2], first, space: None };
        }
        if is_round {
            let lights = corners.iter().zip(&normals).map(|(&i, &normal)| {
                let point_m = vertices_m[i as usize];
                let smooth = self.sources.on(space, point_m, normal);
                (point_m, self.light(smooth, point_m, normal, ahead(point_m)))
            });
            points.extend(fitted(lights.collect(), origin_m, axes, size_m));
        } else {
            let point = |column: usize, row: usize| {
                at(origin_m, axes, [column as f64 / scale[0], row as f64 / scale[1]])
            };
            let step = if kind == BodyKind::Floor { FLOOR_STEP } else { 1 };
            let smooth = Coarse::of([columns, rows], step, |column, row| {
                self.sources.on(space, point(column, row), face.normal)
            });
            for row in 0..rows {
                for column in 0..columns {
                    let point_m = point(column, row);
                    let smooth = smooth.at(column, row);
                    points.push(self.light(smooth, point_m, face.normal, ahead(point_m)));
                }
            }
        }
        let size = [columns, rows];
        // Out of doors, the sun is looked up everywhere.
        if space.is_some() {
            self.keep_sunny(mesh, &mut points[first as usize..], size, origin_m, axes, size_m);
        }
        let size = size.map(|num| num as u16);
        let space = space.map(|index| index as u32);
        FaceLight { axes: [row_of(0), row_of(1)], size, first, space }
    }

    /// Return the light on a point from what lamps and windows give.
    fn light(&self, smooth: [f32; 3], point_m: Vec3, normal: Vec3, ahead_m: Vec2) -> [f32; 4] {
        let [red, green, blue] = smooth;
        let height = (point_m[1] / CONTACT_M).clamp(0.0, 1.0) as f32;
        let open = self.contact.openness(ahead_m, height);
        let towards = self.sun.towards.map(f64::from);
        let slope = dot(normal, towards).max(0.0) as f32;
        [red * open, green * open, blue * open, slope]
    }

    /// Clear the slope of points around which the sun does not reach the face, so that it is not
    /// looked up there.
    fn keep_sunny(
        &self,
        mesh: &SceneMesh,
        lit: &mut [[f32; 4]],
        [columns, rows]: [usize; 2],
        origin_m: Vec3,
        axes: [Vec3; 2],
        size_m: Vec2,
    ) {
        if lit.iter().all(|point| point[3] <= 0.0) {
            return;
        }
        let mut is_sunny = vec![false; lit.len()];
        let samples = size_m.map(|edge_m| ((edge_m / PROBE_M) as usize + 2).min(600));
        for row in 0..samples[1] {
            for first in (0..samples[0]).step_by(LANES) {
                let share = |i: usize, n: usize| (i.min(n - 1) as f64 + 0.5) / n as f64;
                let t = share(row, samples[1]);
                let points_m: [Vec3; LANES] = std::array::from_fn(|lane| {
                    let along = size_m[0] * share(first + lane, samples[0]);
                    at(origin_m, axes, [along, size_m[1] * t])
                });
                let lanes: [[f32; LANES]; 3] =
                    std::array::from_fn(|axis| points_m.map(|point_m| point_m[axis] as f32));
                for (lane, is_met) in self.sun.meets(mesh, &lanes).into_iter().enumerate() {
                    if is_met {
                        let column =
                            (share(first + lane, samples[0]) * (columns - 1) as f64) as usize;
                        let row = (t * (rows - 1) as f64) as usize;
                        // The corners of the cell and of its neighbours.
                        for row in row.saturating_sub(1)..(row + 3).min(rows) {
                            let near = column.saturating_sub(1)..(column + 3).min(columns);
                            near.for_each(|column| is_sunny[row * columns + column] = true);
                        }
                    }
                }
            }
        }
        for (point, is_sunny) in lit.iter_mut().zip(is_sunny) {
            point[3] = if is_sunny { point[3] } else { 0.0 };
        }
    }
}

/// The faces around each corner of a rounded part.
pub(super) struct Around {
    /// Corner and face, in order; empty if the part is not rounded.
    pairs: Vec<(u32, usize)>,
}

impl Around {
    pub fn of(mesh: &SceneMesh, part: &PartMesh) -> Self {
        let is_rounded = part.faces.len() > 6;
        let faces = if is_rounded { part.faces.clone() } else { 0..0 };
        let corners = |index: usize| mesh.corners_of(&mesh.faces[index]).iter();
        let mut pairs: Vec<_> =
            faces.flat_map(|index| corners(index).map(move |&corner| (corner, index))).collect();
        pairs.sort_unstable();
        Self { pairs }
    }

    /// Return the normal of a rounded part at a corner of a face: the mean of the faces there that
    /// differ little in direction.
    fn rounded(&self, mesh: &SceneMesh, face: &Face, corner: u32) -> Vec3 {
        let near = self.faces(corner).map(|index| &mesh.faces[index]);
        let near = near.filter(|other| dot(other.normal, face.normal) > SMOOTH);
        let sum = near
            .fold([0.0; 3], |sum: Vec3, other| std::array::from_fn(|i| sum[i] + other.normal[i]));
        let length = dot(sum, sum).sqrt();
        if length > 1e-9 { sum.map(|x| x / length) } else { face.normal }
    }

    fn faces(&self, corner: u32) -> impl Iterator<Item = usize> {
        let first = self.pairs.partition_point(|(other, _)| *other < corner);
        let here = self.pairs[first..].iter().take_while(move |(other, _)| *other == corner);
        here.map(|(_, index)| *index)
    }
}

fn at(origin_m: Vec3, axes: [Vec3; 2], [s, t]: Vec2) -> Vec3 {
    std::array::from_fn(|i| origin_m[i] + axes[0][i] * s + axes[1][i] * t)
}

/// Return the corner, axes and size of the rectangle around a face: along its longest edge.
fn frame(face: &Face, corners: &[u32], vertices_m: &[Vec3]) -> (Vec3, [Vec3; 2], Vec2) {
    let point = |i: u32| vertices_m[i as usize];
    let next = corners.iter().cycle().skip(1);
    let edges = corners.iter().zip(next).map(|(&a, &b)| sub(point(b), point(a)));
    let longest =
        edges.max_by(|a, b| dot(*a, *a).total_cmp(&dot(*b, *b))).unwrap_or([1.0, 0.0, 0.0]);
    let length = dot(longest, longest).sqrt();
    let s = longest.map(|x| x / length);
    let n = face.normal;
    let t = [n[1] * s[2] - n[2] * s[1], n[2] * s[0] - n[0] * s[2], n[0] * s[1] - n[1] * s[0]];
    let axes = [s, t];
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for &corner in corners {
        for axis in 0..2 {
            let place = dot(axes[axis], point(corner));
            low[axis] = low[axis].min(place);
            high[axis] = high[axis].max(place);
        }
    }
    // The rectangle's first corner, in the face's plane.
    let lift = face.offset_m;
    let origin_m = std::array::from_fn(|i| s[i] * low[0] + t[i] * low[1] + n[i] * lift);
    (origin_m, axes, [high[0] - low[0], high[1] - low[1]])
}

/// Fit a plane through the light at the corners of a small face; return its four values at the
/// corners of the rectangle.
fn fitted(
    lights: Vec<(Vec3, [f32; 4])>,
    origin_m: Vec3,
    axes: [Vec3; 2],
    size_m: Vec2,
) -> [[f32; 4]; 4] {
    let num = lights.len() as f64;
    let places: Vec<Vec2> = lights
        .iter()
        .map(|(point_m, _)| axes.map(|axis| dot(axis, sub(*point_m, origin_m))))
        .collect();
    let mean = [0, 1].map(|axis| places.iter().map(|place| place[axis]).sum::<f64>() / num);
    let spread = |a: usize, b: usize| -> f64 {
        places.iter().map(|place| (place[a] - mean[a]) * (place[b] - mean[b])).sum()
    };
    let (ss, st, tt) = (spread(0, 0), spread(0, 1), spread(1, 1));
    let determinant = (ss * tt - st * st).max(1e-18);
    let mut values = [[0.0; 4]; 4];
    for channel in 0..4 {
        let of = |i: usize| f64::from(lights[i].1[channel]);
        let middle = (0..lights.len()).map(of).sum::<f64>() / num;
        let along = |axis: usize| -> f64 {
            (0..lights.len()).map(|i| (places[i][axis] - mean[axis]) * (of(i) - middle)).sum()
        };
        let (s, t) = (along(0), along(1));
        let (ds, dt) = ((s * tt - t * st) / determinant, (t * ss - s * st) / determinant);
        for (corner, value) in values.iter_mut().enumerate() {
            let place = [(corner % 2) as f64 * size_m[0], (corner / 2) as f64 * size_m[1]];
            let fit = middle + ds * (place[0] - mean[0]) + dt * (place[1] - mean[1]);
            value[channel] = fit.max(0.0) as f32;
        }
    }
    values
}
