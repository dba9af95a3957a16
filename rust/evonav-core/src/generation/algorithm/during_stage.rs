//! Sample a change during a stage (an extension): whether and when the house changes, and how.

use std::cell::RefCell;

use crate::{
    Error,
    assets::UnknownAssets,
    generation::{
        algorithm::scene_evolution::sample_scene_evolution,
        extensions::transition::Transition,
        record::DuringRecord,
        stage::{
            generation_state::State,
            generator::{During, Generator},
            stage_world::StageWorld,
        },
    },
};

/// Sample the change during a stage: the same processes as between stages, with draws of their own.
///
/// # Arguments
/// * `world` - house of the stage.
/// * `state` - S after the stage: the reference trajectory ends at the target.
/// * `target` - index of the target.
///
/// # Returns
/// The record and the world after the change; `None` if the extension is off, the draw decides
/// against a change, nothing can change, or the target would have no reference view afterwards.
pub(crate) fn change_during_stage(
    generator: &Generator<'_>,
    unknown: UnknownAssets,
    world: &StageWorld,
    state: &State,
    stage: usize,
    target: usize,
) -> Result<Option<(DuringRecord, StageWorld)>, Error> {
    let Some(how) = generator.parameters.extensions.during_stage else { return Ok(None) };
    let target = &world.house.objects[target];
    let Some(target_room) = target.room else { return Ok(None) };
    let generator = Generator {
        frame: RefCell::default(),
        during: Some(During { target_id: &target.id, target_room }),
        ..*generator
    };
    let mut stream = generator.stream(stage, "trigger");
    let is_drawn = stream.uniform() < how.probability;
    let [first, last] = how.rounds;
    let round = first + stream.below(last - first + 1);
    if !is_drawn {
        return Ok(None);
    }
    let (mut evolution, delta) = sample_scene_evolution(&generator, world, state, stage)?;
    let transition = Transition { generator: &generator, unknown, state, stage };
    let evolved = transition.rebuild(world.house.apply(&delta)?)?;
    transition.extend(evolved, &mut evolution)?;
    let delta = evolution.delta();
    if delta.is_empty() {
        return Ok(None);
    }
    // The house after it is the recorded change of the house before, in one step: what evaluators do.
    let next = transition.rebuild(world.house.apply(&delta)?)?;
    let Some(index) = next.house.object_index(&target.id) else { return Ok(None) };
    let start_m = state.position_m();
    let reachable = next.reachable(&next.navigation, start_m)?;
    let drawn = next.sample_reference(
        index,
        start_m,
        &reachable,
        generator.parameters,
        &mut generator.stream(stage, "reference"),
        &mut generator.frame.borrow_mut(),
    )?;
    let Ok(reference) = drawn else { return Ok(None) };
    let moved = &next.house.objects[index];
    let record = DuringRecord {
        round,
        target_position_m: moved.position_m,
        target_support_id: moved.parent.map(|parent| next.house.objects[parent].id.clone()),
        is_target_relocated: evolution
            .changes
            .iter()
            .any(|change| change.is_relocated && change.id == target.id),
        evolution,
        reference_pose: reference.pose,
        reference_visible_px: reference.visible_px,
    };
    Ok(Some((record, next)))
}
