//! Parameters of the extensions beyond the paper: objects that appear and vanish, doors and
//! furniture that open and close, lights, people with daily schedules, and changes during a stage.
//! All are off by default.

use serde::{Deserialize, Serialize};

use crate::Error;

/// The extensions' part of Θ; an extension that is `None` is off.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Extensions {
    /// Small objects that appear.
    pub insertion: Option<Occurrence>,
    /// Small objects that vanish.
    pub removal: Option<Occurrence>,
    /// Doors that open or close.
    pub doors: Option<Occurrence>,
    /// Furniture and other objects that open or close.
    pub openables: Option<Occurrence>,
    /// Lamps and screens that are switched on or off.
    pub switches: Option<Occurrence>,
    /// People who use objects; they replace the paper's independent draws of rooms.
    pub schedule: Option<Schedule>,
    /// Changes during a stage. The key is absent from files of tasks without them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub during_stage: Option<DuringStage>,
}

/// The frequency and extent of a process at transitions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Occurrence {
    /// Probability that it happens at a transition.
    pub probability: f64,
    /// Largest number of objects that it changes; the number is uniform from 1 to this.
    pub max_count: usize,
}

/// The people who live in the house, and the time between stages.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// Number of people.
    pub num_persons: usize,
    /// Minutes from one stage to the next.
    pub minutes_between_stages: usize,
    /// Probability that a used object is brought back when its activity ends.
    pub tidiness: f64,
}

/// Frequency of changes during a stage, and their rounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DuringStage {
    /// Probability that the house changes during a stage.
    pub probability: f64,
    /// First and last decision round, from 0, in which it may change; the round is uniform.
    pub rounds: [usize; 2],
}

/// Number of decision rounds of a stage (paper, Sec. C.1).
const MAX_ROUNDS: usize = 50;

impl Extensions {
    /// Check every value.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the field.
    pub fn check(&self) -> Result<(), Error> {
        let is_probability = |value: f64| (0.0..=1.0).contains(&value);
        let is_count = |value: usize| (1..=64).contains(&value);
        let Self { insertion, removal, doors, openables, switches, schedule, during_stage } = self;
        for (names, occurrence) in [
            (["extensions.insertion.probability", "extensions.insertion.max_count"], insertion),
            (["extensions.removal.probability", "extensions.removal.max_count"], removal),
            (["extensions.doors.probability", "extensions.doors.max_count"], doors),
            (["extensions.openables.probability", "extensions.openables.max_count"], openables),
            (["extensions.switches.probability", "extensions.switches.max_count"], switches),
        ] {
            if let Some(Occurrence { probability, max_count }) = *occurrence {
                Error::require(names[0], probability, "in 0..=1", is_probability)?;
                Error::require(names[1], max_count, "in 1..=64", is_count)?;
            }
        }
        if let Some(Schedule { num_persons, minutes_between_stages, tidiness }) = *schedule {
            let name = "extensions.schedule.num_persons";
            Error::require(name, num_persons, "in 1..=16", |v| (1..=16).contains(&v))?;
            let name = "extensions.schedule.minutes_between_stages";
            let is_time = |v| (1..=10_080).contains(&v);
            Error::require(name, minutes_between_stages, "in 1..=10080", is_time)?;
            Error::require("extensions.schedule.tidiness", tidiness, "in 0..=1", is_probability)?;
        }
        if let Some(DuringStage { probability, rounds: [first, last] }) = *during_stage {
            let name = "extensions.during_stage.probability";
            Error::require(name, probability, "in 0..=1", is_probability)?;
            let name = "extensions.during_stage.rounds[0]";
            Error::require(name, first, "in 1..=49", |v| (1..MAX_ROUNDS).contains(&v))?;
            let name = "extensions.during_stage.rounds[1]";
            let is_later = |v| (first..MAX_ROUNDS).contains(&v);
            Error::require(name, last, "in rounds[0]..=49", is_later)?;
            if schedule.is_some() {
                let expected = "no schedule beside it: a schedule has no times within a stage";
                return Err(Error::invalid("extensions.during_stage", "on", expected));
            }
        }
        Ok(())
    }
}
