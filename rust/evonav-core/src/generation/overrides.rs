//! Values that replace random draws, for tasks that differ in a single respect.

use serde::{Deserialize, Serialize};

use crate::Error;

/// Largest number of stages of a task.
const MAX_STAGES: usize = 64;

/// Values that replace draws of a task; by default everything is drawn.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Overrides {
    /// Overrides of each stage, from the first; their number is K. If empty, K is drawn too.
    #[serde(default)]
    pub stages: Vec<StageOverrides>,
}

/// Values that replace draws of one stage.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageOverrides {
    /// Id of the goal object.
    #[serde(default)]
    pub goal_id: Option<String>,
    /// Whether the transition before the stage evolves the house; replaces the draw against
    /// `evolve_probability`.
    #[serde(default)]
    pub is_evolved: Option<bool>,
}

impl Overrides {
    /// Read the JSON that Python writes, and check it.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the field.
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let given: Self = serde_json::from_str(json)
            .map_err(|e| Error::invalid("given", e, "given draws as JSON"))?;
        given.check()?;
        Ok(given)
    }

    /// Check the number of stages.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there are too many.
    pub fn check(&self) -> Result<(), Error> {
        let is_count = |count: usize| count <= MAX_STAGES;
        Error::require("given.stages", self.stages.len(), "at most 64 stages", is_count)
    }

    /// Return the goal of a stage, counted from 1, if it is given.
    pub(crate) fn goal(&self, stage: usize) -> Option<&str> {
        self.stages.get(stage - 1)?.goal_id.as_deref()
    }

    /// Return whether the house evolves before a stage, counted from 1, if that is given.
    pub(crate) fn is_evolved(&self, stage: usize) -> Option<bool> {
        self.stages.get(stage - 1)?.is_evolved
    }
}
