//! One agent of a batch.

use std::sync::Arc;

use crate::{
    Error,
    geometry::{Pose, Vec2, distance_2d_m},
    simulator::{EmbeddedSimulator, geodesic_field::GeodesicField},
};

/// Distance from every target of a task within which there is a reachable free place.
const FULL_REACH_M: f64 = 1.5;

/// Number of free cells that are tried for an agent from which no path leads.
const MAX_TRIES: usize = 16;

/// Cell size of the occupancy whose free cells are tried: the simulators' default.
const OCCUPANCY_CELL_M: f64 = 0.1;

/// An agent and its house.
#[derive(Debug, Clone)]
pub struct Slot {
    /// House of the agent.
    pub world: Arc<EmbeddedSimulator>,
    pub(super) pose: Pose,
    /// Label of each body in images of labels; 0 for none.
    pub labels: Arc<[u8]>,
    /// Distances to the agent's goal; see [`Batch::aim`](crate::simulator::batch::Batch::aim).
    pub(super) field: Option<Arc<GeodesicField>>,
    /// Distance to the goal from the present position, if it was computed.
    pub(super) known_m: Option<f64>,
    /// Positions that could be reached when a target first could not; see
    /// [`Batch::plan`](crate::simulator::batch::Batch::plan).
    reachable_m: Option<Vec<Vec2>>,
}

impl Slot {
    /// Create an agent in a house, without a goal.
    pub fn new(world: Arc<EmbeddedSimulator>, pose: Pose, labels: Arc<[u8]>) -> Self {
        Self { world, pose, labels, field: None, known_m: None, reachable_m: None }
    }

    /// Return the agent's pose.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    pub(super) fn point_m(&self) -> Vec2 {
        let [x_m, _, z_m] = self.pose.position_m;
        [x_m, z_m]
    }

    /// Return the length of the shortest path to the goal, infinite if there is none or no field.
    pub fn distance_m(&self) -> f64 {
        if let Some(known_m) = self.known_m {
            return known_m;
        }
        self.field.as_ref().map_or(f64::INFINITY, |field| field.distance_m(self.point_m()))
    }

    /// Move the agent.
    pub(super) fn go(&mut self, pose: Pose) {
        if pose.position_m != self.pose.position_m {
            self.known_m = None;
        }
        self.pose = pose;
    }

    /// Return the corners of the shortest path to a point, or to the nearest reachable position if
    /// the point cannot be reached; empty if there is none. If steps along the grid reach nothing
    /// near, free cells of the house's occupancy are tried, nearest first.
    pub(super) fn plan(&mut self, target_m: Vec2, grid_m: f64) -> Result<Vec<Vec2>, Error> {
        let (navigation, here_m) = (self.world.navigation(), self.point_m());
        if let Some(path_m) = navigation.shortest_path(here_m, target_m) {
            return Ok(path_m);
        }
        let reachable_m = match self.reachable_m.take() {
            Some(known) => known,
            None => navigation.reachable_positions(here_m, grid_m)?,
        };
        let reachable_m = self.reachable_m.insert(reachable_m);
        let gap_m = |place_m: &Vec2| distance_2d_m(*place_m, target_m);
        let nearest = navigation.nearest_reachable(target_m, reachable_m);
        let nearest_gap_m = nearest.as_ref().map_or(f64::INFINITY, gap_m);
        if nearest_gap_m > FULL_REACH_M {
            let mut free_m = self.free_centres_m()?;
            free_m.sort_by(|a, b| gap_m(a).total_cmp(&gap_m(b)));
            let tried =
                free_m.iter().take(MAX_TRIES).filter(|place_m| gap_m(place_m) < nearest_gap_m);
            let found =
                tried.copied().find_map(|place_m| navigation.shortest_path(here_m, place_m));
            if let Some(path_m) = found {
                return Ok(path_m);
            }
        }
        let path_m = nearest.and_then(|nearest_m| navigation.shortest_path(here_m, nearest_m));
        Ok(path_m.unwrap_or_default())
    }

    /// Return the centres of the cells that the agent's body reaches from the house's start,
    /// row-major.
    fn free_centres_m(&self) -> Result<Vec<Vec2>, Error> {
        let (spec, cells) = self.world.occupancy(OCCUPANCY_CELL_M)?;
        let middle_m = |index: usize, axis: usize| {
            index as f64 * spec.cell_m + spec.cell_m / 2.0 + spec.corner_m[axis]
        };
        let free = cells.iter().enumerate().filter(|&(_, &cell)| cell == 0);
        Ok(free.map(|(i, _)| [middle_m(i % spec.cols, 0), middle_m(i / spec.cols, 1)]).collect())
    }
}
