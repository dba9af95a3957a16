//! Distances to one goal from anywhere in a house, computed in advance.

use std::sync::Arc;

use crate::{
    Error, geometry::Vec2, simulator::EmbeddedSimulator, world::navigation::DistanceField,
};

/// Shortest distances to one point of a house, with the house.
///
/// # Examples
/// ```
/// # use std::sync::Arc;
/// # use evonav_core::simulator::{EmbeddedSimulator, geodesic_field::GeodesicField};
/// # fn of(world: Arc<EmbeddedSimulator>) -> Result<(), evonav_core::Error> {
/// let start = world.start().position_m;
/// let field = GeodesicField::new(world, [start[0], start[2]])?;
/// assert_eq!(field.distance_m([start[0], start[2]]), 0.0);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct GeodesicField {
    world: Arc<EmbeddedSimulator>,
    field: DistanceField,
}

impl GeodesicField {
    /// Compute the distances to `source_m`, or to the free point nearest to it.
    ///
    /// # Errors
    /// [`Error::Simulation`] if no free point is near.
    pub fn new(world: Arc<EmbeddedSimulator>, source_m: Vec2) -> Result<Self, Error> {
        let field = world.navigation().field(source_m).ok_or_else(|| Error::Simulation {
            message: format!("no free point near ({}, {})", source_m[0], source_m[1]),
        })?;
        Ok(Self { world, field })
    }

    /// Return the length of the shortest path from a point, infinite if there is none.
    pub fn distance_m(&self, point_m: Vec2) -> f64 {
        self.world.navigation().field_distance_m(&self.field, point_m)
    }
}
