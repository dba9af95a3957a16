//! A transition between two stages to which extensions are applied. Every process draws from its
//! own random stream, so that it does not influence the others, and changes nothing in the room in
//! which the reference trajectory ends.

use crate::{
    Error,
    assets::UnknownAssets,
    generation::stage::{generation_state::State, generator::Generator, stage_world::StageWorld},
    house::House,
    rng::Stream,
};

/// A transition to which extensions are applied.
pub(crate) struct Transition<'a> {
    pub(crate) generator: &'a Generator<'a>,
    pub(crate) unknown: UnknownAssets,
    pub(crate) state: &'a State,
    /// Number of the stage to which it leads.
    pub(crate) stage: usize,
}

impl Transition<'_> {
    /// Return the random stream of one process.
    pub(crate) fn stream(&self, cause: &str) -> Stream {
        self.generator.stream(self.stage, cause)
    }

    /// Return whether objects may change in a room. Between stages they may not in the room in which
    /// the reference trajectory ends, where the agent would see the change.
    pub(crate) fn may_change(&self, house: &House, room: Option<usize>) -> bool {
        let is_during = self.generator.during.is_some();
        room.is_some() && (is_during || room != self.state.transition_room(house))
    }

    pub(crate) fn rebuild(&self, house: House) -> Result<StageWorld, Error> {
        StageWorld::build(house, self.generator.catalogue, self.unknown)
    }

    /// Return whether all rooms and objects that could be reached in `before` still can.
    pub(crate) fn preserves_access(
        &self,
        before: &StageWorld,
        after: &StageWorld,
    ) -> Result<bool, Error> {
        let parameters = self.generator.parameters;
        let start_m = self.state.position_m();
        if !after.navigation.is_free(start_m) {
            return Ok(false);
        }
        let reached = |world: &StageWorld| -> Result<_, Error> {
            let reachable = world.reachable(&world.navigation, start_m)?;
            Ok(world.access(&world.layout, &reachable, parameters))
        };
        let (then, now) = (reached(before)?, reached(after)?);
        let objects = then.objects.iter().enumerate().filter(|(_, was_reached)| **was_reached);
        let is_reached = |(index, _): (usize, &bool)| {
            let index = after.house.object_index(&before.house.objects[index].id);
            index.is_none_or(|index| now.objects[index])
        };
        Ok(now.includes_rooms(&then) && objects.into_iter().all(is_reached))
    }
}
