//! The hidden change between two stages: whether, where, how (paper, Sec. 3.2).

use crate::{
    Error,
    evolution::{
        Mode, RoomHistory,
        generate::Generator,
        layout::Layout,
        modify::{Blocked, Modification, Modifier},
        reach::Reach,
        record::{
            ChangeRecord, EvolutionOutcome, EvolutionRecord, ModificationFailure, RoomWeightRecord,
        },
        sample_evolved_room,
        stage::StageWorld,
        state::State,
    },
    house::{House, HouseDelta},
};

impl Generator<'_> {
    /// `SampleSceneEvolution`: which room changes, how, and what that moves.
    pub(super) fn sample_scene_evolution(
        &self,
        world: &StageWorld,
        state: &State,
        stage: usize,
    ) -> Result<(EvolutionRecord, HouseDelta), Error> {
        let parameters = self.parameters;
        let is_drawn = || self.stream(stage, "trigger").uniform() < parameters.evolve_probability;
        if !self.given.is_evolved(stage).unwrap_or_else(is_drawn) {
            return Ok((no_evolution(EvolutionOutcome::NotTriggered), HouseDelta::default()));
        }
        let house = &world.house;
        let window = state.changed.len().saturating_sub(parameters.changed_room_window);
        let rooms: Vec<RoomHistory> = (0..house.rooms.len())
            .map(|room| RoomHistory {
                num_assets: house.objects.iter().filter(|o| o.room == Some(room)).count(),
                is_visited: state.visited[room],
                is_transition_room: state.transition_room(house) == Some(room),
                was_changed_recently: state.changed[window..].contains(&Some(room)),
            })
            .collect();
        let (room, weights) =
            sample_evolved_room(&rooms, parameters, &mut self.stream(stage, "room"));
        let weighed = |((room, history), weight): ((usize, &RoomHistory), &f64)| RoomWeightRecord {
            room_id: house.rooms[room].id.clone(),
            num_assets: history.num_assets,
            is_visited: history.is_visited,
            is_transition_room: history.is_transition_room,
            was_changed_recently: history.was_changed_recently,
            weight: *weight,
        };
        let mut record = no_evolution(EvolutionOutcome::NoRoom);
        record.room_weights = rooms.iter().enumerate().zip(&weights).map(weighed).collect();
        let Some(room) = room else { return Ok((record, HouseDelta::default())) };
        record.room_id = Some(house.rooms[room].id.clone());
        record.mode = Mode::sample(parameters, &mut self.stream(stage, "mode"));
        record.outcome = EvolutionOutcome::NoPlacement;
        let Some(mode) = record.mode else { return Ok((record, HouseDelta::default())) };
        let modified = self.modify(world, state, stage, room, mode)?;
        let Modification { layout, salient, unmoved, crowded, rearranged } = match modified {
            Ok(modification) => modification,
            Err(failure) => {
                record.failure = Some(failure);
                return Ok((record, HouseDelta::default()));
            }
        };
        let delta = layout.delta_from(house);
        record.changes =
            changes_of(house, &layout, parameters.relocated_min_m, |_| mode.name().to_owned());
        record.outcome = EvolutionOutcome::Evolved;
        let id_of = |index: usize| house.objects[index].id.clone();
        record.salient_id = salient.map(id_of);
        let has_moved = |id: &String| record.changes.iter().any(|c| c.is_relocated && c.id == *id);
        let stays = |&&(index, _): &&(usize, Blocked)| !has_moved(&id_of(index));
        let unmoved: Vec<_> = unmoved.iter().filter(stays).collect();
        let is_blocking = |&&&(_, why): &&&(usize, Blocked)| why == Blocked::CutsOff;
        record.unmoved_ids = unmoved.iter().map(|(index, _)| id_of(*index)).collect();
        record.blocking_ids =
            unmoved.iter().filter(is_blocking).map(|(index, _)| id_of(*index)).collect();
        record.crowded_ids = crowded.into_iter().map(id_of).collect();
        record.rearranged_ids = rearranged.into_iter().map(id_of).collect();
        Ok((record, delta))
    }

    /// Modifies a room; with fresh places, but the same room and mode, where nothing could move.
    fn modify(
        &self,
        world: &StageWorld,
        state: &State,
        stage: usize,
        room: usize,
        mode: Mode,
    ) -> Result<Result<Modification, ModificationFailure>, Error> {
        let reach = Reach::new(
            &world.house,
            &world.layout,
            &world.navigation,
            state.position_m(),
            self.parameters,
        );
        // Every stage starts at a free pose: there is nothing to reach from one that is not.
        let Some(reach) = reach else { return Ok(Err(ModificationFailure::CutsOff)) };
        let mut modifier = Modifier {
            house: &world.house,
            catalogue: self.catalogue,
            parameters: self.parameters,
            stream: self.stream(stage, "placement"),
            reach,
        };
        let mut made = modifier.modify(&world.layout, room, mode);
        for retry in 1..self.parameters.modification_tries {
            if matches!(made, Ok(_) | Err(ModificationFailure::NothingMovable)) {
                break;
            }
            modifier.stream = self.stream(stage, &format!("placement, retry {retry}"));
            made = modifier.modify(&world.layout, room, mode);
        }
        Ok(made)
    }
}

/// Every object whose pose or support differs between house and layout.
pub(super) fn changes_of(
    house: &House,
    layout: &Layout,
    relocated_min_m: f64,
    cause_of: impl Fn(usize) -> String,
) -> Vec<ChangeRecord> {
    let id_of = |index: Option<usize>| index.map(|i| house.objects[i].id.clone());
    let objects = house.objects.iter().zip(&layout.items).enumerate();
    let changed = objects.filter(|(_, (object, item))| {
        let now = item.placement;
        (object.position_m, object.rotation_deg, object.parent)
            != (now.position_m, now.rotation_deg, now.parent)
    });
    changed
        .map(|(index, (object, item))| {
            let now = item.placement;
            let squares =
                (0..3).map(|axis| (now.position_m[axis] - object.position_m[axis]).powi(2));
            let displacement_m = squares.sum::<f64>().sqrt();
            ChangeRecord {
                id: object.id.clone(),
                category: item.asset.category.clone(),
                from_position_m: object.position_m,
                from_rotation_deg: object.rotation_deg,
                from_support_id: id_of(object.parent),
                to_position_m: now.position_m,
                to_rotation_deg: now.rotation_deg,
                to_support_id: id_of(now.parent),
                displacement_m,
                is_relocated: displacement_m > relocated_min_m || now.parent != object.parent,
                cause: cause_of(index),
            }
        })
        .collect()
}

/// A transition without change.
pub(super) fn no_evolution(outcome: EvolutionOutcome) -> EvolutionRecord {
    EvolutionRecord {
        outcome,
        mode: None,
        room_id: None,
        salient_id: None,
        room_weights: vec![],
        failure: None,
        changes: vec![],
        unmoved_ids: vec![],
        blocking_ids: vec![],
        crowded_ids: vec![],
        rearranged_ids: vec![],
        additions: vec![],
        removals: vec![],
        states: vec![],
        clock_min: None,
        activities: vec![],
    }
}
