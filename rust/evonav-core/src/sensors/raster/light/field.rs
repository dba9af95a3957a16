//! Smooth light, at a grid of points on each face.

use std::sync::{Arc, OnceLock};

use crate::{
    sensors::raster::light::{
        baker::{Around, Baker, FaceLight},
        contact::Contact,
        sources::Sources,
        sun::Sun,
    },
    world::{
        mesh::{PartMesh, SceneMesh},
        scene::Scene,
    },
};

/// The light on the faces of a part. A point has the light without the sun, by channel, and the
/// share of sunlight that the surface's slope takes up.
#[derive(Debug, Clone)]
struct PartLight {
    first_face: usize,
    faces: Vec<FaceLight>,
    points: Vec<[f32; 4]>,
}

impl PartLight {
    /// Return the light times factors, by channel, of each space.
    fn tinted(&self, tints: &[[f32; 3]]) -> Self {
        let mut light = self.clone();
        for face in &self.faces {
            let Some(space) = face.space else { continue };
            let [red, green, blue] = tints[space as usize];
            let num_points = usize::from(face.size[0]) * usize::from(face.size[1]);
            for point in &mut light.points[face.first as usize..][..num_points] {
                let [r, g, b, slope] = *point;
                *point = [r * red, g * green, b * blue, slope];
            }
        }
        light
    }
}

/// The light on all faces of a mesh. It is computed part by part, when a part is first seen: a
/// picture shows a small share of a house.
#[derive(Debug, Clone)]
pub(in crate::sensors::raster) struct Field {
    own: Arc<Own>,
    /// Factors of the light of each space, by channel, and the parts with them; empty for the
    /// house's own light.
    tints: Vec<[f32; 3]>,
    tinted: Vec<OnceLock<PartLight>>,
}

/// The house's own light, which all its tints share.
#[derive(Debug)]
struct Own {
    baker: Baker,
    /// Number of each face's part in `parts`.
    part_of: Vec<u32>,
    /// The parts of the mesh, then its trim.
    parts: Vec<OnceLock<PartLight>>,
}

impl Field {
    pub fn new(
        scene: &Scene,
        mesh: &SceneMesh,
        sources: Sources,
        contact: Contact,
        sun: Arc<Sun>,
    ) -> Self {
        let kinds = scene.bodies.iter().map(|body| body.kind).collect();
        let mut part_of = vec![0; mesh.faces.len()];
        for (index, part) in (0..).zip(parts_of(mesh)) {
            part_of[part.faces.clone()].fill(index);
        }
        let parts = vec![OnceLock::new(); parts_of(mesh).count()];
        let own = Own { baker: Baker { kinds, sources, contact, sun }, part_of, parts };
        Self { own: Arc::new(own), tints: Vec::new(), tinted: Vec::new() }
    }

    /// Return the house's own light times factors, by channel, of each space.
    pub fn tinted(&self, tint: impl Fn(usize) -> [f32; 3]) -> Self {
        Self {
            own: Arc::clone(&self.own),
            tints: (0..self.own.baker.sources.num_spaces()).map(tint).collect(),
            tinted: vec![OnceLock::new(); self.own.parts.len()],
        }
    }

    /// Return the light on a face; `None` if there is no such face.
    ///
    /// # Arguments
    /// * `mesh` - the mesh of the light.
    #[inline(always)]
    pub fn of_face(&self, mesh: &SceneMesh, index: usize) -> Option<FaceField<'_>> {
        let number = *self.own.part_of.get(index)? as usize;
        let own = || self.own.parts[number].get_or_init(|| self.own.bake(mesh, number));
        let part = match self.tinted.get(number) {
            Some(part) => part.get_or_init(|| own().tinted(&self.tints)),
            None => own(),
        };
        let face = &part.faces[index - part.first_face];
        Some(FaceField { face, points: &part.points[face.first as usize..] })
    }
}

impl Own {
    #[cold]
    fn bake(&self, mesh: &SceneMesh, number: usize) -> PartLight {
        let (solid, trim) = (&mesh.parts, &mesh.trim);
        let part = solid.get(number).unwrap_or_else(|| &trim[number - solid.len()]);
        let around = Around::of(mesh, part);
        let mut points = Vec::new();
        let bake = |index| self.baker.bake(mesh, part, &around, index, &mut points);
        let faces = part.faces.clone().map(bake).collect();
        PartLight { first_face: part.faces.start, faces, points }
    }
}

fn parts_of(mesh: &SceneMesh) -> impl Iterator<Item = &PartMesh> {
    mesh.parts.iter().chain(&mesh.trim)
}

/// The light on a face.
#[derive(Debug, Clone, Copy)]
pub(in crate::sensors::raster) struct FaceField<'a> {
    face: &'a FaceLight,
    /// Points from the face's first one on.
    points: &'a [[f32; 4]],
}

impl FaceField<'_> {
    /// Return the rows that give column and row of a world point: `axes . [x, y, z, 1]`.
    pub fn axes(&self) -> [[f32; 4]; 2] {
        self.face.axes
    }

    /// Return the light at a place, interpolated.
    ///
    /// # Arguments
    /// * `place` - column and row of the face's grid.
    #[inline(always)]
    pub fn at(&self, [column, row]: [f32; 2]) -> [f32; 4] {
        let [columns, rows] = self.face.size;
        // The whole number below a place and the rest, by the mantissa of a sum with 1.5 times 2^23:
        // unlike a conversion it needs no treatment of numbers out of range.
        let split = |place: f32, size: u16| {
            let most = f32::from(size - 1) - 1e-3;
            let place = if place > 0.0 { place } else { 0.0 };
            let place = if place < most { place } else { most };
            let sum = place - 0.5 + 12_582_912.0;
            (sum.to_bits() & 0xffff, place - (sum - 12_582_912.0))
        };
        let ((column, right), (row, down)) = (split(column, columns), split(row, rows));
        let at = (row * u32::from(columns) + column) as usize;
        let below = usize::from(columns);
        let near = &self.points[at..at + below + 2];
        let corners = [near[0], near[1], near[below], near[below + 1]];
        let mut light = [0.0; 4];
        for (i, light) in light.iter_mut().enumerate() {
            let above = corners[0][i] + right * (corners[1][i] - corners[0][i]);
            let below = corners[2][i] + right * (corners[3][i] - corners[2][i]);
            *light = above + down * (below - above);
        }
        light
    }
}
