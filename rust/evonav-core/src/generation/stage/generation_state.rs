//! The generation state S (paper, Sec. A.1).

use std::collections::BTreeSet;

use crate::{
    generation::{
        record::{
            EvolutionOutcome, EvolutionRecord, PoseRecord, RejectReason, Rejected, StateRecord,
        },
        stage::stage_world::{Reference, StageWorld},
    },
    geometry::{Vec2, distance_2d_m},
    house::House,
};

/// Spacing of the points at which the room of a path is determined.
const PATH_STEP_M: f64 = 0.05;
/// Number of entries of the histories that are recorded (paper, Sec. A.2).
const HISTORY: usize = 2;

/// S: the reference trajectory so far, and past changes and goals.
pub struct State {
    /// Whether the reference trajectory has been in each room.
    pub visited: Vec<bool>,
    /// Index of the room that changed, by transition.
    pub changed: Vec<Option<usize>>,
    /// Index of the goal room, by stage.
    pub goals: Vec<usize>,
    /// End of the reference trajectory.
    pub pose: PoseRecord,
    /// Ids of all objects that any change has relocated.
    pub relocated: BTreeSet<String>,
}

impl State {
    /// Create the state before stage 1, at the house's own start pose.
    pub fn at_start(world: &StageWorld) -> Result<Self, Rejected> {
        let house = &world.house;
        let rejected = |reason, detail| Err(Rejected { reason, stage: 0, detail });
        let Some(start) = house.start else {
            return rejected(
                RejectReason::NoStart,
                "no metadata.agent; `--start auto` chooses a free place".to_owned(),
            );
        };
        let [x, y, z] = start.position_m;
        let Some([x, z]) = start_near(world, [x, z]) else {
            return rejected(RejectReason::StartNotFree, format!("start at x {x}, z {z}"));
        };
        let pose = PoseRecord {
            position_m: [x, y, z],
            yaw_deg: start.yaw_deg,
            horizon_deg: start.horizon_deg,
        };
        let mut visited = vec![false; house.rooms.len()];
        match house.room_of([x, z]) {
            Some(room) => visited[room] = true,
            None => {
                return rejected(RejectReason::StartOutside, format!("start at x {x}, z {z}"));
            }
        }
        let (changed, goals, relocated) = (vec![], vec![], BTreeSet::new());
        Ok(Self { visited, changed, goals, pose, relocated })
    }

    /// Return `[x, z]` of the end of the reference trajectory.
    pub fn position_m(&self) -> Vec2 {
        [self.pose.position_m[0], self.pose.position_m[2]]
    }

    /// Return the room in which the reference trajectory ends.
    pub fn transition_room(&self, house: &House) -> Option<usize> {
        house.room_of(self.position_m())
    }

    /// Record a transition, before the stage after it is generated, or a change during a stage.
    pub fn note_evolution(&mut self, evolution: &EvolutionRecord, house: &House) {
        if evolution.outcome != EvolutionOutcome::FirstStage {
            let is_evolved = evolution.outcome == EvolutionOutcome::Evolved;
            let id = evolution.room_id.as_ref().filter(|_| is_evolved);
            self.changed.push(house.rooms.iter().position(|room| Some(&room.id) == id));
        }
        let relocated = evolution.changes.iter().filter(|change| change.is_relocated);
        self.relocated.extend(relocated.map(|change| change.id.clone()));
    }

    /// Record a stage: the reference trajectory continues to its reference pose.
    pub fn note_stage(&mut self, world: &StageWorld, reference: &Reference, goal_room: usize) {
        for pair in reference.path_m.windows(2) {
            let num_steps = (distance_2d_m(pair[0], pair[1]) / PATH_STEP_M).ceil().max(1.0);
            for step in 0..=num_steps as usize {
                let t = step as f64 / num_steps;
                let point = [0, 1].map(|i| pair[0][i] + t * (pair[1][i] - pair[0][i]));
                if let Some(room) = world.house.room_of(point) {
                    self.visited[room] = true;
                }
            }
        }
        self.goals.push(goal_room);
        self.pose = reference.pose;
    }

    /// Return the record of the state.
    pub fn record(&self, house: &House) -> StateRecord {
        let id = |room: usize| house.rooms[room].id.clone();
        let last = |len: usize| len.saturating_sub(HISTORY);
        StateRecord {
            visited_room_ids: (0..self.visited.len())
                .filter(|&r| self.visited[r])
                .map(id)
                .collect(),
            changed_room_ids: self.changed[last(self.changed.len())..]
                .iter()
                .map(|room| room.map(id))
                .collect(),
            goal_room_ids: self.goals[last(self.goals.len())..].iter().map(|&r| id(r)).collect(),
            transition_room_id: self.transition_room(house).map(id),
        }
    }
}

/// Return the start itself if the agent fits there; otherwise the nearest free place from which two
/// rooms can be reached, or the nearest free place if there is no such place.
fn start_near(world: &StageWorld, start_m: Vec2) -> Option<Vec2> {
    let navigation = &world.navigation;
    if navigation.is_free(start_m) {
        return Some(start_m);
    }
    let leads_on = |from_m: Vec2| {
        let reachable = world.reachable(navigation, from_m).unwrap_or_default();
        let rooms: BTreeSet<usize> = reachable.iter().filter_map(|(_, room)| *room).collect();
        rooms.len() > 1
    };
    // One place of every pocket found so far.
    let mut pockets: Vec<Vec2> = Vec::new();
    for place_m in navigation.free_near(start_m) {
        if pockets.iter().any(|&pocket_m| navigation.is_connected(pocket_m, place_m)) {
            continue;
        }
        if leads_on(place_m) {
            return Some(place_m);
        }
        pockets.push(place_m);
    }
    pockets.first().copied()
}
