//! Change a house around an agent that stands in it: what would touch it, or shut it in, stays.

use std::collections::BTreeSet;

use crate::{
    Error,
    geometry::{Vec2, distance_2d_m},
    house::HouseDelta,
    simulator::EmbeddedSimulator,
    world::{
        footprint::{Footprint, footprint},
        layout::contact::overlap,
        scene::Body,
    },
};

/// Largest distance from a target to a place from which it counts as reachable: reference poses are
/// at most as far.
const REACH_M: f64 = 1.5;
/// Spacing of AI2-THOR's grid of reachable positions.
const GRID_M: f64 = 0.25;

impl EmbeddedSimulator {
    /// Apply a change while an agent stands in the house.
    ///
    /// An object that would touch the agent stays as it is, and so does all that this forces to
    /// stay: objects that would stand on it or overlap it, and the support that it stands on. If
    /// the agent could still not move from its place to the house's start, or what stays cuts the
    /// target off, nothing changes.
    ///
    /// # Arguments
    /// * `agent_m` - `[x, z]` of the agent.
    /// * `target_id` - object that must stay reachable.
    ///
    /// # Returns
    /// The simulator of the changed house, and the ids of what stays, in the order of the delta.
    ///
    /// # Errors
    /// Those of [`Self::apply`].
    pub fn change_around(
        &self,
        delta: &HouseDelta,
        agent_m: Vec2,
        target_id: &str,
    ) -> Result<(Self, Vec<String>), Error> {
        let mut skipped: BTreeSet<String> = BTreeSet::new();
        loop {
            self.add_dependent(delta, &mut skipped);
            let after = self.apply(&delta.without(&skipped))?;
            let found: Vec<String> = delta
                .ids()
                .filter(|&id| !skipped.contains(id) && after.is_in_the_way(id, agent_m, &skipped))
                .cloned()
                .collect();
            if !found.is_empty() {
                skipped.extend(found);
                continue;
            }
            let is_sound = after.is_reachable(agent_m)
                && (skipped.is_empty() || after.reaches(agent_m, target_id)?);
            let stays = |id: &&String| skipped.contains(*id);
            if is_sound || delta.ids().all(|id| stays(&id)) {
                let in_order = delta.ids().filter(stays).cloned().collect();
                return Ok((after, in_order));
            }
            skipped.extend(delta.ids().cloned());
        }
    }

    /// Add what has to stay because something else stays: its support, and objects that would stand on
    /// it.
    fn add_dependent(&self, delta: &HouseDelta, skipped: &mut BTreeSet<String>) {
        let house = self.house();
        let moved = delta.moves.iter().map(|change| (&change.id, &change.parent));
        let added = delta.added.iter().map(|object| (&object.id, &object.parent));
        let new_supports: Vec<(&String, &Option<String>)> = moved.chain(added).collect();
        loop {
            let bears = |id: &String| {
                let children = house.object_index(id).map(|index| &house.objects[index].children);
                children.into_iter().flatten().any(|&one| skipped.contains(&house.objects[one].id))
            };
            let stands = |(_, support): &&(&String, &Option<String>)| {
                support.as_ref().is_some_and(|support| skipped.contains(support))
            };
            let by_support = new_supports.iter().filter(stands).map(|(id, _)| *id);
            let found: Vec<String> = delta
                .ids()
                .filter(|id| bears(id))
                .chain(by_support)
                .filter(|id| !skipped.contains(*id))
                .cloned()
                .collect();
            if found.is_empty() {
                return;
            }
            skipped.extend(found);
        }
    }

    /// Return whether an object or door touches the agent or overlaps one that stays.
    fn is_in_the_way(&self, id: &str, agent_m: Vec2, staying: &BTreeSet<String>) -> bool {
        let Some(body) = body_of(self, id) else { return false };
        let touches_agent = self
            .navigation()
            .obstacles()
            .iter()
            .any(|obstacle| obstacle.blocks(agent_m) && self.bodies()[obstacle.body].id == id);
        touches_agent || {
            let own = solids(body);
            let mut others = staying.iter().filter_map(|other| body_of(self, other));
            others.any(|other| body.aabb.intersects(&other.aabb) && overlap(&own, &solids(other)))
        }
    }

    /// Return whether the agent can come near an object within the object's room.
    fn reaches(&self, agent_m: Vec2, id: &str) -> Result<bool, Error> {
        let house = self.house();
        let Some(index) = house.object_index(id) else { return Ok(false) };
        let [x, _, z] = house.objects[index].position_m;
        let room = house.room_of([x, z]);
        let reached = self.navigation().reachable_positions(agent_m, GRID_M)?;
        Ok(reached.into_iter().any(|place_m| {
            distance_2d_m(place_m, [x, z]) <= REACH_M && house.room_of(place_m) == room
        }))
    }
}

fn body_of<'a>(simulator: &'a EmbeddedSimulator, id: &str) -> Option<&'a Body> {
    simulator.bodies().iter().find(|body| body.id == id)
}

fn solids(body: &Body) -> Vec<Footprint> {
    body.parts.iter().filter_map(|part| footprint(part, f64::NEG_INFINITY, f64::INFINITY)).collect()
}
