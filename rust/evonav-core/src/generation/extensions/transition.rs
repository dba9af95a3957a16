//! What the extensions change at a transition, after the paper's evolution: small things that
//! vanish and appear. Every process draws from a stream of its own, so that it changes nothing of
//! the others, and leaves the room alone in which the reference trajectory stands.

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
    /// Of the stage that it leads to.
    pub(crate) stage: usize,
}

impl Transition<'_> {
    /// The random stream of one process.
    pub(crate) fn stream(&self, cause: &str) -> Stream {
        self.generator.stream(self.stage, cause)
    }

    /// Whether something may change in a room: the one in which the reference trajectory stands
    /// would change before the agent's eyes.
    pub(crate) fn is_free(&self, house: &House, room: Option<usize>) -> bool {
        room.is_some() && room != self.state.transition_room(house)
    }

    pub(crate) fn rebuilt(&self, house: House) -> Result<StageWorld, Error> {
        StageWorld::build(house, self.generator.catalogue, self.unknown)
    }

    /// Whether all rooms and objects that could be reached in `before` still can.
    pub(crate) fn reaches_as_much(
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
        let rooms = then.rooms.iter().zip(&now.rooms).all(|(then, now)| *now || !*then);
        let objects = then.objects.iter().enumerate().filter(|(_, was_reached)| **was_reached);
        let is_reached = |(index, _): (usize, &bool)| {
            let index = after.house.object_index(&before.house.objects[index].id);
            index.is_none_or(|index| now.objects[index])
        };
        Ok(rooms && objects.into_iter().all(is_reached))
    }
}
