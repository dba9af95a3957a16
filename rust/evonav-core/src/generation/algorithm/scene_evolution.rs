//! Sample the hidden change between two stages: whether, where and how the house changes (paper,
//! Sec. 3.2).

use crate::{
    Error,
    generation::{
        Mode, RoomHistory,
        algorithm::room_modification::{Modification, Modifier, UnmovedReason},
        evolved_room_weight,
        placement::reach::Reach,
        record::{EvolutionOutcome, EvolutionRecord, ModificationFailure, RoomWeightRecord},
        stage::{
            changes::changes_of, generation_state::State, generator::Generator,
            stage_world::StageWorld,
        },
    },
    house::HouseDelta,
};

/// Sample the evolution before a stage (`SampleSceneEvolution`): the room, the mode and the moves.
///
/// During a stage, any room may change, and the target's has `changed_room_multiplier` times its
/// weight.
pub(crate) fn sample_scene_evolution(
    generator: &Generator<'_>,
    world: &StageWorld,
    state: &State,
    stage: usize,
) -> Result<(EvolutionRecord, HouseDelta), Error> {
    let (parameters, during) = (generator.parameters, generator.during);
    let is_drawn = || generator.stream(stage, "trigger").uniform() < parameters.evolve_probability;
    let is_given =
        if during.is_some() { Some(true) } else { generator.overrides.is_evolved(stage) };
    if !is_given.unwrap_or_else(is_drawn) {
        return Ok((
            EvolutionRecord::unchanged(EvolutionOutcome::NotTriggered),
            HouseDelta::default(),
        ));
    }
    let house = &world.house;
    let window = state.changed.len().saturating_sub(parameters.changed_room_window);
    let rooms: Vec<RoomHistory> = (0..house.rooms.len())
        .map(|room| RoomHistory {
            num_assets: house.objects.iter().filter(|o| o.room == Some(room)).count(),
            is_visited: state.visited[room],
            // During a stage, the generator does not know in which room the agent is.
            is_transition_room: during.is_none() && state.transition_room(house) == Some(room),
            was_changed_recently: state.changed[window..].contains(&Some(room)),
        })
        .collect();
    let mut weights: Vec<f64> =
        rooms.iter().map(|&room| evolved_room_weight(room, parameters)).collect();
    if let Some(weight) = during.and_then(|during| weights.get_mut(during.target_room)) {
        *weight *= parameters.changed_room_multiplier;
    }
    let room = generator.stream(stage, "room").choose_weighted(&weights);
    let weighed = |((room, &history), &weight): ((usize, &RoomHistory), &f64)| RoomWeightRecord {
        room_id: house.rooms[room].id.clone(),
        history,
        weight,
    };
    let mut record = EvolutionRecord::unchanged(EvolutionOutcome::NoRoom);
    record.room_weights = rooms.iter().enumerate().zip(&weights).map(weighed).collect();
    let Some(room) = room else { return Ok((record, HouseDelta::default())) };
    record.room_id = Some(house.rooms[room].id.clone());
    record.mode = Mode::sample(parameters, &mut generator.stream(stage, "mode"));
    record.outcome = EvolutionOutcome::NoPlacement;
    let Some(mode) = record.mode else { return Ok((record, HouseDelta::default())) };
    let modified = modify_room(generator, world, state, stage, room, mode)?;
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
    let stays = |&&(index, _): &&(usize, UnmovedReason)| !has_moved(&id_of(index));
    let unmoved: Vec<_> = unmoved.iter().filter(stays).collect();
    let is_blocking = |&&&(_, why): &&&(usize, UnmovedReason)| why == UnmovedReason::CutsOff;
    record.unmoved_ids = unmoved.iter().map(|(index, _)| id_of(*index)).collect();
    record.blocking_ids =
        unmoved.iter().filter(is_blocking).map(|(index, _)| id_of(*index)).collect();
    record.crowded_ids = crowded.into_iter().map(id_of).collect();
    record.rearranged_ids = rearranged.into_iter().map(id_of).collect();
    Ok((record, delta))
}

/// Modify a room. If nothing could move, try again with newly drawn places in the same room and
/// mode.
fn modify_room(
    generator: &Generator<'_>,
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
        generator.parameters,
    );
    // Every stage starts at a free pose; from any other pose nothing can be reached.
    let Some(reach) = reach else { return Ok(Err(ModificationFailure::CutsOff)) };
    let mut modifier = Modifier {
        house: &world.house,
        catalogue: generator.catalogue,
        parameters: generator.parameters,
        stream: generator.stream(stage, "placement"),
        reach,
    };
    let mut made = modifier.modify(&world.layout, room, mode);
    for retry in 1..generator.parameters.modification_tries {
        if matches!(made, Ok(_) | Err(ModificationFailure::NothingMovable)) {
            break;
        }
        modifier.stream = generator.stream(stage, &format!("placement, retry {retry}"));
        made = modifier.modify(&world.layout, room, mode);
    }
    Ok(made)
}
