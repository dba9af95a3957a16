//! The light in a house: what falls on each surface, computed once for a house and its state.
//!
//! Sunlight comes through windows and open doors and is looked up pixel by pixel in a map of
//! shadows, which is drawn where it is first looked at. All other light is smooth: it is computed at
//! a few points of each face when the face is first seen, and interpolated.

mod baker;
mod coarse;
mod contact;
mod field;
mod sources;
mod sun;

use std::sync::Arc;

use crate::{
    geometry::{Aabb, Vec3},
    house::House,
    sensors::raster::canvas::LANES,
    world::{appearance::Lighting, mesh::SceneMesh, scene::Scene},
};

pub(super) use field::FaceField;
use field::Field;
pub(super) use sun::Sun;

/// Sunlight, times the lamps' and the sky's.
const SUNLIGHT: [f32; 4] = [1.25, 1.18, 1.05, 0.0];

/// The light in a house.
#[derive(Debug, Clone)]
pub struct Light {
    pub(super) field: Field,
    pub(super) sun: Arc<Sun>,
    /// Strength of the sunlight, by channel; the last number is 0.
    pub(super) sunlight: [f32; 4],
}

impl Light {
    /// Find the sources of light in a house and its dark corners; the rest is computed when a face is
    /// first seen.
    ///
    /// # Arguments
    /// * `scene`, `mesh` - of the house.
    ///
    /// # Complexity
    /// O(area of the house); seeing a face for the first time takes O(its area).
    pub fn build(house: &House, scene: &Scene, mesh: &SceneMesh) -> Self {
        let sources = sources::Sources::of(house, scene);
        let bounds = mesh.parts.iter().fold(Aabb::EMPTY, |all, part| all.union(part.aabb));
        let contact = contact::Contact::of(scene, mesh, &bounds);
        let sun = Arc::new(Sun::new(sources.sun_direction(), mesh, &bounds));
        let field = Field::new(scene, mesh, sources, contact, Arc::clone(&sun));
        Self { field, sun, sunlight: SUNLIGHT }
    }

    /// Return the light with random factors, which are drawn for each group of connected rooms.
    ///
    /// # Complexity
    /// O(parts of the mesh); what this light has computed is not computed again.
    pub fn varied(&self, lighting: &Lighting) -> Self {
        let [red, green, blue] = lighting.sun();
        Self {
            field: self.field.tinted(|space| lighting.room(space)),
            sun: Arc::clone(&self.sun),
            sunlight: [red * SUNLIGHT[0], green * SUNLIGHT[1], blue * SUNLIGHT[2], 0.0],
        }
    }

    /// Return the light without the sun at a point of a face, by channel, and the share of sunlight
    /// that the face's slope takes up: 0 where the sun is not looked for. `None` if there is no such
    /// face.
    ///
    /// # Arguments
    /// * `mesh` - the mesh of the light.
    /// * `face` - index in [`SceneMesh::faces`].
    pub fn on_face(&self, mesh: &SceneMesh, face: usize, point_m: Vec3) -> Option<[f32; 4]> {
        let face = self.field.of_face(mesh, face)?;
        let [x, y, z] = point_m.map(|coordinate| coordinate as f32);
        Some(face.at(face.axes().map(|[a, b, c, d]| a * x + b * y + c * z + d)))
    }

    /// Return the direction towards the sun, in the world frame.
    pub fn towards_sun(&self) -> Vec3 {
        self.sun.towards.map(f64::from)
    }

    /// Return the share of the sun, 0 to 1, that reaches a point of a surface that faces it.
    ///
    /// # Arguments
    /// * `mesh` - the mesh of the light.
    pub fn sun_at(&self, mesh: &SceneMesh, point_m: Vec3) -> f32 {
        self.sun.reaches(mesh, &point_m.map(|x| [x as f32; LANES]))[0]
    }
}
