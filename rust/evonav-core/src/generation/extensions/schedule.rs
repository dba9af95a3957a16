//! Changes by people who live in the house: they carry objects to the places where they use them,
//! and some of them back. This replaces the paper's independent draws of rooms and modifications.

use std::collections::BTreeMap;

use crate::{
    Error,
    generation::{
        Schedule,
        extensions::{
            activities::{Activity, DAY_MIN, Habit, PlannedActivity, activities, day, habits},
            clearance::has_clearance,
            transition::Transition,
        },
        record::{ActivityRecord, ChangeRecord, EvolutionOutcome, EvolutionRecord},
        stage::{
            changes::changes_of,
            stage_world::{Access, StageWorld},
        },
    },
    house::{House, HouseDelta},
    rng::Stream,
    world::layout::{Layout, Placement, surfaces::sample_surface_place},
};

/// The people of a house, and the objects that they use.
pub(crate) struct Household {
    schedule: Schedule,
    people: Vec<Vec<Habit>>,
    /// Time of day of stage 1.
    first_min: usize,
    /// Place of each object when it was first taken, by id.
    original_places: BTreeMap<String, OriginalPlace>,
    /// Ids of the objects in use, by person and start of the activity.
    in_use: BTreeMap<(usize, usize), Vec<String>>,
}

/// A place with the id of its parent, since indices change from stage to stage.
#[derive(Clone)]
struct OriginalPlace {
    placement: Placement,
    parent: Option<String>,
}

/// The start or end of an activity.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct ScheduleEvent {
    minute: usize,
    is_begin: bool,
    person: usize,
    habit: usize,
    start_min: usize,
    end_min: usize,
}

impl Household {
    /// Draw the people of a house; `stream_of` returns the stream of a name.
    pub(crate) fn new(
        schedule: Schedule,
        house: &House,
        stream_of: impl Fn(&str) -> Stream,
    ) -> Self {
        let person = |index: usize| habits(house, &mut stream_of(&format!("person {index}")));
        Self {
            schedule,
            people: (0..schedule.num_persons).map(person).collect(),
            first_min: stream_of("clock").below(DAY_MIN),
            original_places: BTreeMap::new(),
            in_use: BTreeMap::new(),
        }
    }

    /// Return the time of day of a stage, minutes after midnight.
    pub(crate) fn time_of_day_min(&self, stage: usize) -> usize {
        self.minute_of(stage) % DAY_MIN
    }

    /// Return the minutes after the first midnight at a stage.
    fn minute_of(&self, stage: usize) -> usize {
        self.first_min + (stage - 1) * self.schedule.minutes_between_stages
    }

    /// Return the events after the previous stage and until this one, in order.
    fn events(&self, stage: usize, stream_of: impl Fn(&str) -> Stream) -> Vec<ScheduleEvent> {
        let (from, to) = (self.minute_of(stage - 1), self.minute_of(stage));
        let mut events = Vec::new();
        // An activity that started late on the day before may end today.
        let days = (from / DAY_MIN).saturating_sub(1)..=to / DAY_MIN;
        for (number, person) in days.flat_map(|n| (0..self.people.len()).map(move |p| (n, p))) {
            let mut stream = stream_of(&format!("person {person} day {number}"));
            for PlannedActivity { habit, start_min, end_min } in
                day(&self.people[person], number, &mut stream)
            {
                for (minute, is_begin) in [(start_min, true), (end_min, false)] {
                    if from < minute && minute <= to {
                        events.push(ScheduleEvent {
                            minute,
                            is_begin,
                            person,
                            habit,
                            start_min,
                            end_min,
                        });
                    }
                }
            }
        }
        events.sort_unstable();
        events
    }
}

/// A house while people change it.
struct HouseInUse<'a, 'b> {
    transition: &'a Transition<'b>,
    world: &'a StageWorld,
    layout: Layout,
    /// Cause of the last move of each object.
    causes: BTreeMap<usize, String>,
}

impl Transition<'_> {
    /// Apply the activities of people since the previous stage.
    ///
    /// # Errors
    /// Those of navigation.
    pub(crate) fn follow_schedule(
        &self,
        world: &StageWorld,
        household: &mut Household,
    ) -> Result<(EvolutionRecord, HouseDelta), Error> {
        let house = &world.house;
        let layout = world.layout.clone();
        let mut work = HouseInUse { transition: self, world, layout, causes: BTreeMap::new() };
        let mut record = EvolutionRecord::unchanged(EvolutionOutcome::NotTriggered);
        let task_stream = |name: &str| self.generator.stream(0, &format!("schedule {name}"));
        for event in household.events(self.stage, task_stream) {
            let ScheduleEvent { minute, is_begin, person, habit, start_min, end_min } = event;
            let Habit { activity, room, .. } = household.people[person][habit];
            let one = &activities()[activity];
            let name = format!("schedule {} of {person} at {minute}", one.name);
            let stream = &mut self.generator.stream(self.stage, &name);
            let cause = format!("ACTIVITY:{}", one.name);
            let (before, mut moved) = (work.layout.clone(), Vec::new());
            if is_begin {
                // No activity starts in the room where the agent would see it.
                if !self.may_change(house, Some(room)) {
                    continue;
                }
                record.activities.push(ActivityRecord {
                    person,
                    name: one.name.clone(),
                    room_id: Some(house.rooms[room].id.clone()),
                    start_min,
                    end_min,
                });
                let preference = |id: &str| {
                    task_stream(&format!("liking of person {person} for {id}")).uniform()
                };
                moved = work.begin(one, room, &preference, stream, household);
                if one.tidies {
                    let lost: Vec<String> = household.original_places.keys().cloned().collect();
                    moved.extend(work.bring_back(&lost, household, stream));
                }
            } else if let Some(used) = household.in_use.remove(&(person, start_min))
                && one.returns
            {
                moved = work.bring_back(&used, household, stream);
            }
            if !moved.is_empty() && !work.preserves_access()? {
                // Objects overhang their support a little, where an agent may have to pass.
                work.layout = before;
                moved.clear();
            }
            if is_begin {
                let ids = moved.iter().map(|&index| house.objects[index].id.clone()).collect();
                household.in_use.insert((person, start_min), ids);
            }
            for index in moved {
                work.causes.insert(index, cause.clone());
            }
        }
        let delta = work.valid_delta()?;
        let least_m = self.generator.parameters.relocated_min_m;
        let cause_of = |index: usize| work.causes.get(&index).cloned().unwrap_or_default();
        record.changes = changes_of(house, &work.layout, least_m, cause_of);
        if !record.changes.is_empty() {
            record.outcome = EvolutionOutcome::Evolved;
            record.room_id = most_changed_room(house, &work.layout, &record.changes);
        }
        Ok((record, delta))
    }
}

impl HouseInUse<'_, '_> {
    /// Return the room in which an object is now: that of the object that bears it.
    fn room_of(&self, index: usize) -> Option<usize> {
        let mut root = index;
        while let Some(parent) = self.layout.items[root].placement.parent {
            root = parent;
        }
        self.world.house.objects[root].room
    }

    fn is_in_free_room(&self, index: usize) -> bool {
        self.transition.may_change(&self.world.house, self.room_of(index))
    }

    /// Bring the objects that an activity needs to its room.
    ///
    /// # Arguments
    /// * `preference` - value of an object by its id; the smallest wins, so that a person uses the
    ///   same mug again if it is available.
    fn begin(
        &mut self,
        one: &Activity,
        room: usize,
        preference: &impl Fn(&str) -> f64,
        stream: &mut Stream,
        household: &mut Household,
    ) -> Vec<usize> {
        let mut taken: Vec<usize> = Vec::new();
        for wanted in &one.uses {
            let in_use: Vec<&String> = household.in_use.values().flatten().collect();
            let can_be_had = |&index: &usize| {
                let (item, id) = (&self.layout.items[index], &self.world.house.objects[index].id);
                wanted.contains(&item.asset.category)
                    && item.asset.is_pickupable
                    && item.placement.parent.is_some()
                    && !taken.contains(&index)
                    && !in_use.contains(&id)
                    && self.is_in_free_room(index)
                    && self.layout.with_supported(index).len() == 1
            };
            let choices = (0..self.layout.items.len()).filter(can_be_had);
            let choices = choices.map(|i| (preference(&self.world.house.objects[i].id), i));
            let Some((_, index)) = choices.min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
            if self.bring(index, one, room, stream, household) {
                taken.push(index);
            }
        }
        taken
    }

    /// Bring one object to the best furniture of the room that has a place for it.
    fn bring(
        &mut self,
        index: usize,
        one: &Activity,
        room: usize,
        stream: &mut Stream,
        household: &mut Household,
    ) -> bool {
        let parent = self.layout.items[index].placement.parent;
        for category in &one.at {
            let bears = |&other: &usize| {
                let item = &self.layout.items[other];
                item.asset.category == *category
                    && item.is_on_floor
                    && !item.asset.surfaces_m.is_empty()
                    && self.world.house.objects[other].room == Some(room)
            };
            let supports: Vec<usize> = (0..self.layout.items.len()).filter(bears).collect();
            // An object that is already on such furniture stays where it is.
            if parent.is_some_and(|parent| supports.contains(&parent)) {
                return true;
            }
            if let Some(place) = self.sample(index, &supports, stream) {
                let id = self.world.house.objects[index].id.clone();
                let old = self.layout.items[index].placement;
                let above = old.parent.map(|above| self.world.house.objects[above].id.clone());
                household
                    .original_places
                    .entry(id)
                    .or_insert(OriginalPlace { placement: old, parent: above });
                self.layout.put(index, place);
                return true;
            }
        }
        false
    }

    fn sample(&self, index: usize, supports: &[usize], stream: &mut Stream) -> Option<Placement> {
        if supports.is_empty() {
            return None;
        }
        let parameters = self.transition.generator.parameters;
        (0..parameters.placement_tries).find_map(|_| {
            let least_m = parameters.relocated_min_m;
            sample_surface_place(&self.layout, index, supports, least_m, stream)
        })
    }

    /// Bring objects back to their original places, each if its user is tidy.
    fn bring_back(
        &mut self,
        ids: &[String],
        household: &Household,
        stream: &mut Stream,
    ) -> Vec<usize> {
        let house = &self.world.house;
        let mut brought = Vec::new();
        for id in ids {
            let is_tidy = stream.uniform() < household.schedule.tidiness;
            let is_used = household.in_use.values().flatten().any(|used| used == id);
            let (Some(index), Some(original)) =
                (house.object_index(id), household.original_places.get(id))
            else {
                continue;
            };
            let parent = original.parent.as_ref().and_then(|parent| house.object_index(parent));
            let placement = Placement { parent, ..original.placement };
            let Some(support) = parent else { continue };
            if !is_tidy
                || is_used
                || self.layout.items[index].placement == placement
                || self.layout.with_supported(index).len() > 1
                || !self.is_in_free_room(index)
                || !self.is_in_free_room(support)
            {
                continue;
            }
            if self.layout.is_clear(&[(index, placement)]) {
                self.layout.put(index, placement);
                brought.push(index);
            } else if let Some(place) = self.sample(index, &[support], stream) {
                // Something else stands there now: use another place on the same support.
                self.layout.put(index, place);
                brought.push(index);
            }
        }
        brought
    }

    /// Return the moves that are valid in a scene of the changed house. Others are undone: an
    /// object may have been put under one that hangs in the air in the file and falls in the scene.
    fn valid_delta(&mut self) -> Result<HouseDelta, Error> {
        let (house, old) = (&self.world.house, &self.world.layout.scene);
        loop {
            let delta = self.layout.delta_from(house);
            if delta.is_empty() {
                return Ok(delta);
            }
            let next = self.transition.rebuild(house.apply(&delta)?)?;
            let new = &next.layout.scene;
            let clash = delta.moves.iter().find(|step| !has_clearance(old, new, &step.id));
            let Some(index) = clash.and_then(|step| house.object_index(&step.id)) else {
                return Ok(delta);
            };
            self.layout.put(index, self.world.layout.items[index].placement);
        }
    }

    /// Return whether all rooms that could be reached before still can.
    fn preserves_access(&self) -> Result<bool, Error> {
        let (world, parameters) = (self.world, self.transition.generator.parameters);
        let start_m = self.transition.state.position_m();
        let access = |layout: &Layout| -> Result<Option<Access>, Error> {
            let navigation = world.navigation.with_scene(&layout.scene)?;
            if !navigation.is_free(start_m) {
                return Ok(None);
            }
            let reachable = world.reachable(&navigation, start_m)?;
            Ok(Some(world.access(layout, &reachable, parameters)))
        };
        let (then, now) = (access(&world.layout)?, access(&self.layout)?);
        // Objects that are carried to another room need not be reachable: that is checked for
        // goals.
        Ok(then.zip(now).is_some_and(|(then, now)| now.includes_rooms(&then)))
    }
}

/// Return the room that contains most relocated objects now; of equals the first in house order.
fn most_changed_room(house: &House, layout: &Layout, changes: &[ChangeRecord]) -> Option<String> {
    let mut counts = vec![0_usize; house.rooms.len()];
    for change in changes.iter().filter(|change| change.is_relocated) {
        let mut root = house.object_index(&change.id)?;
        while let Some(parent) = layout.items[root].placement.parent {
            root = parent;
        }
        if let Some(room) = house.objects[root].room {
            counts[room] += 1;
        }
    }
    let most = counts.iter().copied().max().filter(|&most| most > 0)?;
    let room = counts.iter().position(|&count| count == most)?;
    Some(house.rooms[room].id.clone())
}
