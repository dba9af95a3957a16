//! Changes of a house that follow from their records.

use crate::{
    generation::record::EvolutionRecord,
    house::{AddedObject, HouseDelta, ObjectMove, StateChange},
};

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
