//! The light in a house: what falls on each surface, computed once for a house and its state.
//!
//! Sunlight comes through windows and open doors and is looked up pixel by pixel in a map of
//! shadows. All other light is smooth: it is computed at a few points of each face and interpolated.

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
    /// Compute the light in a house.
    ///
    /// # Arguments
    /// * `scene`, `mesh` - of the house.
    ///
    /// # Complexity
    /// O(area of all surfaces); about 13 ms for a house of a hundred objects.
    pub fn build(house: &House, scene: &Scene, mesh: &SceneMesh) -> Self {
        let sources = sources::Sources::of(house, scene);
        let bounds = mesh.parts.iter().fold(Aabb::EMPTY, |all, part| all.union(part.aabb));
        let contact = contact::Contact::of(scene, mesh, &bounds);
        let sun = Sun::build(sources.sun_direction(), mesh, &bounds);
        let field = Field::build(scene, mesh, &sources, &contact, &sun);
        Self { field, sun: Arc::new(sun), sunlight: SUNLIGHT }
    }

    /// Return the light with random factors, which are drawn for each group of connected rooms.
    ///
    /// # Complexity
    /// O(points of the light): a small part of what [`Self::build`] takes.
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
    /// * `face` - index in [`SceneMesh::faces`].
    pub fn on_face(&self, face: usize, point_m: Vec3) -> Option<[f32; 4]> {
        let face = self.field.faces.get(face)?;
        let [x, y, z] = point_m.map(|coordinate| coordinate as f32);
        Some(self.field.at(face, face.axes.map(|[a, b, c, d]| a * x + b * y + c * z + d)))
    }

    /// Return the direction towards the sun, in the world frame.
    pub fn towards_sun(&self) -> Vec3 {
        self.sun.towards.map(f64::from)
    }

    /// Return the share of the sun, 0 to 1, that reaches a point of a surface that faces it.
    pub fn sun_at(&self, point_m: Vec3) -> f32 {
        self.sun.reaches(&point_m.map(|x| [x as f32; LANES]))[0]
    }
}
