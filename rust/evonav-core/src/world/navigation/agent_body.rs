//! The body that moves through a house.

/// An agent's body: an upright capsule standing on the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AgentBody {
    /// Radius of the cylinder and of both rounded ends.
    pub radius_m: f64,
    /// Height from the floor to the top, at least `2 * radius_m`.
    pub height_m: f64,
}

impl AgentBody {
    /// AI2-THOR's default agent (`PhysicsRemoteFPSAgentController`: radius 0.2, height 1.8).
    pub const DEFAULT: Self = Self { radius_m: 0.2, height_m: 1.8 };

    /// Return the largest radius of the capsule between two heights above the floor, 0 outside it.
    pub fn radius_between_m(&self, bottom_m: f64, top_m: f64) -> f64 {
        // Distance by which the interval lies beyond the cylinder, in one of the rounded ends.
        let beyond_m =
            (self.radius_m - top_m).max(bottom_m - (self.height_m - self.radius_m)).max(0.0);
        (self.radius_m * self.radius_m - beyond_m * beyond_m).max(0.0).sqrt()
    }
}
