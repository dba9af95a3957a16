//! Algorithm 1 of the paper (Sec. A.1): a task from a house, stage by stage.

use serde::Serialize;

use super::{
    Candidate, GoalBias, Mode, Parameters, RoomHistory,
    layout::Layout,
    modify::{Modification, Modifier},
    record::{
        ChangeRecord, EvolutionOutcome, EvolutionRecord, GeneratedStage, GeneratedTask,
        RejectReason, Rejected, RejectionRecord, RoomWeightRecord, TargetRecord,
    },
    relations::relations_of,
    sample_evolved_room, sample_goal,
    stage::{Reference, StageWorld},
    state::State,
    target_scores,
};
use crate::{
    Error,
    assets::catalogue::{Catalogue, UnknownAssets},
    geometry::{Vec2, distance_2d_m},
    house::{House, HouseDelta},
    rng::Stream,
};

/// What became of a house.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Generation {
    /// A task.
    Task(GeneratedTask),
    /// No task, and why.
    Rejected(Rejected),
}

impl Generation {
    /// `{"task": ...}` without houses and images, or `{"rejected": ...}`.
    pub fn to_json(&self) -> String {
        // Only maps with keys that are no strings can fail, and there are none.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// Makes a task of a house.
///
/// # Arguments
/// * `seed`, `label` - name the random streams; `label` should tell houses apart, so that one
///   seed does not draw alike in all of them.
/// * `parameters` - Θ.
///
/// # Returns
/// The same for the same arguments, on any number of threads.
///
/// # Errors
/// [`Error::InvalidArgument`] for bad parameters; [`Error::House`] for unknown assets, if
/// `unknown` says so; [`Error::Simulation`] for houses whose geometry makes no scene.
pub fn generate_task(
    house: &House,
    catalogue: &Catalogue,
    unknown: UnknownAssets,
    seed: u64,
    label: &str,
    parameters: &Parameters,
) -> Result<Generation, Error> {
    parameters.check()?;
    let num_rooms = house.rooms.len();
    if num_rooms < 2 {
        let detail = format!("{num_rooms} room(s)");
        return Ok(reject(RejectReason::TooFewRooms, 0, detail));
    }
    let generator = Generator { catalogue, seed, label, parameters };
    let choices = &parameters.num_stages;
    let drawn = generator.stream(0, "num_stages").below(choices.len());
    let num_stages = choices.get(drawn).copied().unwrap_or(1);
    let mut world = StageWorld::build(house.clone(), catalogue, unknown)?;
    let mut state = match State::at_start(&world) {
        Ok(state) => state,
        Err(rejected) => return Ok(Generation::Rejected(rejected)),
    };
    let mut task = GeneratedTask { stages: vec![], houses: vec![], images: vec![] };
    for stage in 1..=num_stages {
        let (evolution, delta) = if stage == 1 {
            (no_evolution(EvolutionOutcome::FirstStage), HouseDelta::default())
        } else {
            generator.sample_scene_evolution(&world, &state, stage)?
        };
        if !delta.moves.is_empty() {
            world = StageWorld::build(world.house.apply(&delta)?, catalogue, unknown)?;
        }
        state.note_evolution(&evolution, &world.house, stage);
        let made = match generator.sample_stage_task(&world, &state, &evolution, stage)? {
            Ok(made) => made,
            Err(rejected) => return Ok(Generation::Rejected(rejected)),
        };
        let (target, reference, rejections) = made;
        task.images.push(reference.image.clone());
        task.houses.push(world.house.to_json());
        task.stages.push(GeneratedStage {
            relations: relations_of(&world.house, &world.layout, target.index),
            target: target.record,
            evolution,
            delta,
            state: state.record(&world.house),
            start_pose: state.pose,
            rejections,
            reference_pose: reference.pose,
            reference_visible_px: reference.visible_px,
            reference_colour: reference.colour,
            reference_path_length_m: length_m(&reference.path_m),
            reference_path_m: reference.path_m.clone(),
            ever_relocated_ids: state.relocated.iter().cloned().collect(),
        });
        state.note_stage(&world, &reference, target.room);
    }
    Ok(Generation::Task(task))
}

/// A sampled target.
struct Goal {
    index: usize,
    room: usize,
    record: TargetRecord,
}

struct Generator<'a> {
    catalogue: &'a Catalogue,
    seed: u64,
    label: &'a str,
    parameters: &'a Parameters,
}

impl Generator<'_> {
    fn stream(&self, stage: usize, what: &str) -> Stream {
        Stream::new(self.seed, &[self.label, &format!("stage {stage}"), what])
    }

    /// `SampleSceneEvolution`: which room changes, how, and what that moves.
    fn sample_scene_evolution(
        &self,
        world: &StageWorld,
        state: &State,
        stage: usize,
    ) -> Result<(EvolutionRecord, HouseDelta), Error> {
        let parameters = self.parameters;
        if self.stream(stage, "trigger").uniform() >= parameters.evolve_probability {
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
        let Some(Modification { layout, salient, unmoved }) = modified else {
            return Ok((record, HouseDelta::default()));
        };
        let delta = layout.delta_from(house);
        record.changes = changes_of(house, &layout, parameters.relocated_min_m);
        record.outcome = EvolutionOutcome::Evolved;
        record.salient_id = salient.map(|index| house.objects[index].id.clone());
        let has_moved = |id: &String| record.changes.iter().any(|c| c.is_relocated && c.id == *id);
        record.unmoved_ids = unmoved
            .iter()
            .map(|&index| house.objects[index].id.clone())
            .filter(|id| mode != Mode::SalientObject && !has_moved(id))
            .collect();
        Ok((record, delta))
    }

    fn modify(
        &self,
        world: &StageWorld,
        state: &State,
        stage: usize,
        room: usize,
        mode: Mode,
    ) -> Result<Option<Modification>, Error> {
        let start_m = state.position_m();
        let reachable = world.reachable(&world.navigation, start_m)?;
        let before = world.access(&world.layout, &reachable, self.parameters);
        let is_navigable = |layout: &Layout| {
            let navigation = world.navigation.with_scene(&layout.scene);
            let reachable = navigation.and_then(|n| world.reachable(&n, start_m));
            // An error here is a scene without geometry: not navigable.
            reachable.is_ok_and(|r| world.access(layout, &r, self.parameters).includes(&before))
        };
        let mut modifier = Modifier {
            house: &world.house,
            catalogue: self.catalogue,
            parameters: self.parameters,
            stream: &mut self.stream(stage, "placement"),
            is_navigable,
        };
        Ok(modifier.modify(&world.layout, room, mode))
    }

    /// `SampleStageTask`: the target and its reference view.
    #[allow(clippy::type_complexity, reason = "one caller, which takes it apart at once")]
    fn sample_stage_task(
        &self,
        world: &StageWorld,
        state: &State,
        evolution: &EvolutionRecord,
        stage: usize,
    ) -> Result<Result<(Goal, Reference, Vec<RejectionRecord>), Rejected>, Error> {
        let rejected = |reason, detail| Ok(Err(Rejected { reason, stage, detail }));
        let start_m = state.position_m();
        let reachable = world.reachable(&world.navigation, start_m)?;
        let access = world.access(&world.layout, &reachable, self.parameters);
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
                let is_allowed = !item.is_hung() || self.parameters.goals_on_walls;
                let category = item.asset.category.as_str();
                let room = object.room.filter(|_| is_allowed)?;
                Some((index, Candidate { category, room }))
            })
            .unzip();
        let bias = GoalBias {
            changed_room: state.changed.last().copied().flatten(),
            previous_goal_room: state.goals.last().copied(),
            moved_object: indices
                .iter()
                .position(|&i| Some(&house.objects[i].id) == evolution.salient_id.as_ref()),
        };
        let mut rejections = Vec::new();
        let mut failure = None;
        let mut stream = self.stream(stage, "goal");
        let mut draw_reference = |candidate: usize| {
            let index = indices[candidate];
            let id = house.objects[index].id.clone();
            let mut stream = self.stream(stage, &format!("reference {id}"));
            let drawn =
                world.sample_reference(index, start_m, &reachable, self.parameters, &mut stream);
            match drawn {
                Ok(Ok(reference)) => return Some(reference),
                Ok(Err(reason)) => rejections.push(RejectionRecord { id, reason }),
                Err(error) => failure = Some(error),
            }
            None
        };
        let num_rooms = house.rooms.len();
        let drawn = sample_goal(
            &candidates,
            num_rooms,
            bias,
            self.parameters,
            &mut stream,
            &mut draw_reference,
        );
        if let Some(error) = failure {
            return Err(error);
        }
        let Some((candidate, reference)) = drawn else {
            let detail = format!("{} objects drawn and refused", rejections.len());
            return rejected(RejectReason::NoValidGoal, detail);
        };
        let (index, room) = (indices[candidate], candidates[candidate].room);
        let score = target_scores(&candidates)[candidate];
        let record = target_record(world, state, evolution, index, room, score);
        Ok(Ok((Goal { index, room, record }, reference, rejections)))
    }
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

/// Every object whose pose or support differs between house and layout.
fn changes_of(house: &House, layout: &Layout, relocated_min_m: f64) -> Vec<ChangeRecord> {
    let id_of = |index: Option<usize>| index.map(|i| house.objects[i].id.clone());
    let changed = house.objects.iter().zip(&layout.items).filter(|(object, item)| {
        let now = item.placement;
        (object.position_m, object.rotation_deg, object.parent)
            != (now.position_m, now.rotation_deg, now.parent)
    });
    changed
        .map(|(object, item)| {
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
            }
        })
        .collect()
}

fn no_evolution(outcome: EvolutionOutcome) -> EvolutionRecord {
    EvolutionRecord {
        outcome,
        mode: None,
        room_id: None,
        salient_id: None,
        room_weights: vec![],
        changes: vec![],
        unmoved_ids: vec![],
    }
}

fn reject(reason: RejectReason, stage: usize, detail: String) -> Generation {
    Generation::Rejected(Rejected { reason, stage, detail })
}

fn length_m(path_m: &[Vec2]) -> f64 {
    path_m.windows(2).map(|pair| distance_2d_m(pair[0], pair[1])).sum()
}
