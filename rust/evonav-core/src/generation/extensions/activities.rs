//! People's activities at home, and daily schedules made of them.

use std::sync::OnceLock;

use serde::Deserialize;

use crate::{house::House, rng::Stream};

/// Minutes of a day.
pub(crate) const DAY_MIN: usize = 1440;
/// Largest deviation of an activity's start from its usual time.
const JITTER_MIN: f64 = 15.0;
/// Probability that a habit is skipped on a day.
const SKIP_PROBABILITY: f64 = 0.1;
/// Longest delay of an activity by the one before; an activity with a longer delay is left out.
const PATIENCE_MIN: usize = 90;

/// An activity of people (`data/activities.json`).
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Activity {
    pub(crate) name: String,
    /// Hours of the day between which it usually starts.
    hours: [f64; 2],
    /// Shortest and longest duration, minutes.
    minutes: [f64; 2],
    /// Share of people who do it daily.
    share: f64,
    /// Types of rooms in which it is done, the most usual first.
    rooms: Vec<String>,
    /// Categories of furniture on which objects are used, best first.
    pub(crate) at: Vec<String>,
    /// Lists of categories; one object of each list is used.
    pub(crate) uses: Vec<Vec<String>>,
    /// Whether tidy people bring the objects back when it ends.
    pub(crate) returns: bool,
    /// Whether all objects are brought back to their original places.
    #[serde(default)]
    pub(crate) tidies: bool,
}

#[derive(Deserialize)]
struct Table {
    activities: Vec<Activity>,
}

/// Return all activities; they are read once.
pub(crate) fn activities() -> &'static [Activity] {
    static TABLE: OnceLock<Table> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        // The data is part of the build and read by a test: no user input can make this fail.
        #[allow(clippy::expect_used)]
        serde_json::from_str(include_str!("../../../data/activities.json")).expect("valid table")
    });
    &table.activities
}

/// An activity that one person does every day.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Habit {
    pub(crate) activity: usize,
    /// Index of the room.
    pub(crate) room: usize,
    start_min: f64,
    duration_min: f64,
}

/// Draw a person's habits for a house, from the activities for which it has rooms.
pub(crate) fn habits(house: &House, stream: &mut Stream) -> Vec<Habit> {
    let mut habits = Vec::new();
    for (activity, one) in activities().iter().enumerate() {
        // Every activity takes the same number of draws, so that one more room type does not
        // change a person's other habits.
        let [has, when, long] = [stream.uniform(), stream.uniform(), stream.uniform()];
        let rooms = one.rooms.iter().map(|room_type| {
            let alike = house.rooms.iter().enumerate().filter(|(_, r)| r.room_type == *room_type);
            alike.map(|(room, _)| room).collect::<Vec<_>>()
        });
        // Use the most usual room type that the house has.
        let rooms = rooms.into_iter().find(|rooms| !rooms.is_empty()).unwrap_or_default();
        let drawn = stream.below(rooms.len());
        let Some(&room) = rooms.get(drawn) else { continue };
        if has < one.share {
            let between = |[low, high]: [f64; 2], share: f64| low + share * (high - low);
            let start_min = 60.0 * between(one.hours, when);
            let duration_min = between(one.minutes, long);
            habits.push(Habit { activity, room, start_min, duration_min });
        }
    }
    habits
}

/// One activity on one day.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PlannedActivity {
    /// Index of the habit of its person.
    pub(crate) habit: usize,
    /// Start, minutes after the first midnight.
    pub(crate) start_min: usize,
    /// End, minutes after the first midnight.
    pub(crate) end_min: usize,
}

/// Draw the schedule of a person's day: one activity after the other, each near its usual time.
pub(crate) fn day(habits: &[Habit], day: usize, stream: &mut Stream) -> Vec<PlannedActivity> {
    let mut plan: Vec<(f64, usize)> = Vec::new();
    for (index, habit) in habits.iter().enumerate() {
        let [skip, shift] = [stream.uniform(), stream.uniform()];
        if skip >= SKIP_PROBABILITY {
            plan.push((habit.start_min + JITTER_MIN * (2.0 * shift - 1.0), index));
        }
    }
    plan.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut planned: Vec<PlannedActivity> = Vec::new();
    for (start_min, habit) in plan {
        let wanted = day * DAY_MIN + start_min.max(0.0) as usize;
        let start_min = planned.last().map_or(wanted, |before| wanted.max(before.end_min));
        if start_min - wanted <= PATIENCE_MIN {
            let end_min = start_min + habits[habit].duration_min.round() as usize;
            planned.push(PlannedActivity { habit, start_min, end_min });
        }
    }
    planned
}
