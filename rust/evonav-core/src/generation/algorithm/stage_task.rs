//! Sample the goal of a stage and its reference view (paper, Sec. 3.2 and A.4).

use crate::{
    Error,
    generation::{
        Candidate, GoalBias,
        record::{EvolutionRecord, RejectReason, Rejected, RejectionRecord, TargetRecord},
        sample_goal,
        stage::{
            generation_state::State,
            generator::Generator,
            stage_world::{Reference, StageWorld},
        },
        target_scores,
    },
    house::House,
};

/// A sampled target.
pub(crate) struct Goal {
    pub(crate) index: usize,
    pub(crate) room: usize,
    pub(crate) record: TargetRecord,
}

/// Sample the task of a stage (`SampleStageTask`): the target and its reference view.
#[allow(clippy::type_complexity, reason = "one caller, which takes it apart at once")]
pub(crate) fn sample_stage_task(
    generator: &Generator<'_>,
    world: &StageWorld,
    state: &State,
    evolution: &EvolutionRecord,
    stage: usize,
) -> Result<Result<(Goal, Reference, Vec<RejectionRecord>), Rejected>, Error> {
    let rejected = |reason, detail| Ok(Err(Rejected { reason, stage, detail }));
    let start_m = state.position_m();
    let reachable = world.reachable(&world.navigation, start_m)?;
    let access = world.access(&world.layout, &reachable, generator.parameters);
    let num_reached = access.rooms.iter().filter(|&&is_reached| is_reached).count();
    if num_reached < 2 {
        let detail = format!("{num_reached} of {} rooms", access.rooms.len());
        return rejected(RejectReason::Disconnected, detail);
    }
    let house = &world.house;
    let (indices, candidates): (Vec<usize>, Vec<Candidate<'_>>) = house
        .objects
        .iter()
        .enumerate()
        .filter_map(|(index, object)| {
            let item = &world.layout.items[index];
            let is_allowed = !item.is_hung() || generator.parameters.goals_on_walls;
            let category = item.asset.category.as_str();
            let room = object.room.filter(|_| is_allowed)?;
            Some((index, Candidate { category, room }))
        })
        .unzip();
    let moved_children = moved_with_salient(house, &indices, evolution);
    let window = generator.parameters.goal_room_window;
    let bias = GoalBias {
        moved_children: &moved_children,
        changed_room: state.changed.last().copied().flatten(),
        previous_goal_rooms: &state.goals[state.goals.len().saturating_sub(window)..],
        moved_object: indices
            .iter()
            .position(|&i| Some(&house.objects[i].id) == evolution.salient_id.as_ref()),
    };
    let mut rejections = Vec::new();
    let mut failure = None;
    let mut stream = generator.stream(stage, "goal");
    let mut frame = generator.frame.borrow_mut();
    let mut draw_reference = |candidate: usize| {
        let index = indices[candidate];
        let id = house.objects[index].id.clone();
        let mut stream = generator.stream(stage, &format!("reference {id}"));
        let drawn = world.sample_reference(
            index,
            start_m,
            &reachable,
            generator.parameters,
            &mut stream,
            &mut frame,
        );
        match drawn {
            Ok(Ok(reference)) => return Some(reference),
            Ok(Err(reason)) => rejections.push(RejectionRecord { id, reason }),
            Err(error) => failure = Some(error),
        }
        None
    };
    let drawn = match generator.overrides.goal(stage) {
        Some(id) => indices
            .iter()
            .position(|&index| house.objects[index].id == id)
            .and_then(|candidate| draw_reference(candidate).map(|made| (candidate, made))),
        None => sample_goal(
            &candidates,
            house.rooms.len(),
            bias,
            generator.parameters,
            &mut stream,
            &mut draw_reference,
        ),
    };
    if let Some(error) = failure {
        return Err(error);
    }
    let Some((candidate, reference)) = drawn else {
        let detail = match generator.overrides.goal(stage) {
            Some(id) => format!("the given goal {id} is no goal: {rejections:?}"),
            None => format!("{} objects drawn and refused", rejections.len()),
        };
        return rejected(RejectReason::NoValidGoal, detail);
    };
    let (index, room) = (indices[candidate], candidates[candidate].room);
    let score = target_scores(&candidates)[candidate];
    let record = target_record(world, state, evolution, index, room, score);
    Ok(Ok((Goal { index, room, record }, reference, rejections)))
}

/// Return the candidates that stood on the salient object and moved with it, or that people moved.
fn moved_with_salient(house: &House, indices: &[usize], evolution: &EvolutionRecord) -> Vec<usize> {
    let salient = evolution.salient_id.as_ref();
    if salient.is_none() && evolution.clock_min.is_none() {
        return vec![];
    }
    let is_moved = |id: &String| {
        Some(id) != salient && evolution.changes.iter().any(|c| c.is_relocated && c.id == *id)
    };
    (0..indices.len()).filter(|&i| is_moved(&house.objects[indices[i]].id)).collect()
}

fn target_record(
    world: &StageWorld,
    state: &State,
    evolution: &EvolutionRecord,
    index: usize,
    room: usize,
    score: f64,
) -> TargetRecord {
    let (house, items) = (&world.house, &world.layout.items);
    let (object, item) = (&house.objects[index], &items[index]);
    let is_alike = |&i: &usize| i != index && items[i].asset.category == item.asset.category;
    TargetRecord {
        id: object.id.clone(),
        category: item.asset.category.clone(),
        room_id: house.rooms[room].id.clone(),
        position_m: object.position_m,
        size_m: item.asset.size_m,
        support_id: object.parent.map(|parent| house.objects[parent].id.clone()),
        score,
        same_category_ids: (0..items.len())
            .filter(is_alike)
            .map(|i| house.objects[i].id.clone())
            .collect(),
        is_relocated_now: evolution.changes.iter().any(|c| c.is_relocated && c.id == object.id),
        is_relocated_ever: state.relocated.contains(&object.id),
    }
}
