//! Record of a change during a stage.

use serde::Serialize;

use crate::{
    generation::record::{EvolutionRecord, PoseRecord},
    geometry::Vec3,
    house::{AddedObject, HouseDelta, ObjectMove, StateChange},
};

/// A change of the house during a stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DuringRecord {
    /// Decision round, from 0, before whose views the house changes.
    pub round: usize,
    /// The change.
    pub evolution: EvolutionRecord,
    /// Centre of the target's box after it.
    pub target_position_m: Vec3,
    /// Object that the target stands on after it.
    pub target_support_id: Option<String>,
    /// Whether it relocated the target.
    pub is_target_relocated: bool,
    /// Pose at the reference distance from which the target is visible after it.
    pub reference_pose: PoseRecord,
    /// Number of pixels of the target from there.
    pub reference_visible_px: usize,
}

impl EvolutionRecord {
    /// Return the change that leads from the house before to the house after.
    pub fn delta(&self) -> HouseDelta {
        let moves = self.changes.iter().map(|change| ObjectMove {
            id: change.id.clone(),
            position_m: change.to_position_m,
            rotation_deg: change.to_rotation_deg,
            parent: change.to_support_id.clone(),
        });
        let added = self.additions.iter().map(|object| AddedObject {
            id: object.id.clone(),
            asset_id: object.asset_id.clone(),
            position_m: object.position_m,
            rotation_deg: object.rotation_deg,
            parent: object.support_id.clone(),
        });
        let states = self.states.iter().map(|state| StateChange {
            id: state.id.clone(),
            openness: (state.field == "openness").then_some(state.after),
            is_on: (state.field == "isOn").then_some(state.after > 0.5),
        });
        HouseDelta {
            moves: moves.collect(),
            removed: self.removals.iter().map(|object| object.id.clone()).collect(),
            added: added.collect(),
            states: states.collect(),
        }
    }
}
