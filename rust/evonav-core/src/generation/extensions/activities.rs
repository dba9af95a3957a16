//! The table of what people do at home, and the days that are made of it.

use std::sync::OnceLock;

use serde::Deserialize;

use crate::{house::House, rng::Stream};

/// Minutes of a day.
pub(crate) const DAY_MIN: usize = 1440;
/// How much earlier or later than usual something is begun, at most.
const JITTER_MIN: f64 = 15.0;
/// Chance that a habit is not kept on a day.
const SKIPPED: f64 = 0.1;
/// An activity that would have to wait longer for the one before is left out.
const PATIENCE_MIN: usize = 90;

/// Something that people do (`data/activities.json`).
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Activity {
    pub(crate) name: String,
    /// Hours of the day between which it is usually begun.
    hours: [f64; 2],
    /// Shortest and longest duration.
    minutes: [f64; 2],
    /// Part of people who do it daily.
    share: f64,
    /// Types of room in which it is done.
    rooms: Vec<String>,
    /// Categories of furniture on which things are used, best first.
    pub(crate) at: Vec<String>,
    /// Of each list one thing is taken.
    pub(crate) uses: Vec<Vec<String>>,
    /// Whether the things are brought back when it ends, by the tidy.
    pub(crate) returns: bool,
    /// Whether everything is brought back to where it was first.
    #[serde(default)]
    pub(crate) tidies: bool,
}

#[derive(Deserialize)]
struct Table {
    activities: Vec<Activity>,
}

/// All activities, read once.
pub(crate) fn activities() -> &'static [Activity] {
    static TABLE: OnceLock<Table> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        // Part of the build, and a test reads it: no input of a user can make this fail.
        #[allow(clippy::expect_used)]
        serde_json::from_str(include_str!("../../../data/activities.json")).expect("valid table")
    });
    &table.activities
}

/// What one person does every day, and when.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Habit {
    pub(crate) activity: usize,
    /// Index of the room in which it is done.
    pub(crate) room: usize,
    start_min: f64,
    duration_min: f64,
}

/// Draws a person's habits for a house: activities that it has rooms for.
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
        // The most usual type that the house has.
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
pub(crate) struct Doing {
    /// Index in the person's habits.
    pub(crate) habit: usize,
    /// Begin, minutes after the first midnight.
    pub(crate) start_min: usize,
    /// End.
    pub(crate) end_min: usize,
}

/// A person's day: one thing after the other, each about when it is usual.
pub(crate) fn day(habits: &[Habit], day: usize, stream: &mut Stream) -> Vec<Doing> {
    let mut plan: Vec<(f64, usize)> = Vec::new();
    for (index, habit) in habits.iter().enumerate() {
        let [kept, shift] = [stream.uniform(), stream.uniform()];
        if kept >= SKIPPED {
            plan.push((habit.start_min + JITTER_MIN * (2.0 * shift - 1.0), index));
        }
    }
    plan.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut doings: Vec<Doing> = Vec::new();
    for (start_min, habit) in plan {
        let wanted = day * DAY_MIN + start_min.max(0.0) as usize;
        let start_min = doings.last().map_or(wanted, |before| wanted.max(before.end_min));
        if start_min - wanted <= PATIENCE_MIN {
            let end_min = start_min + habits[habit].duration_min.round() as usize;
            doings.push(Doing { habit, start_min, end_min });
        }
    }
    doings
}
