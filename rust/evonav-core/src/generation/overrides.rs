//! Draws that are given instead of made: tasks that differ in one thing alone.

use serde::{Deserialize, Serialize};

use crate::Error;

/// Most stages of a task.
const MAX_STAGES: usize = 64;

/// What is not drawn; by default everything is.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Given {
    /// Of each stage from the first; their count is K. Empty: K is drawn, too.
    #[serde(default)]
    pub stages: Vec<GivenStage>,
}

/// What is not drawn of a stage.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GivenStage {
    /// Id of the object that is the goal.
    #[serde(default)]
    pub goal_id: Option<String>,
    /// Whether the transition before it evolves the house, instead of the draw against
    /// `evolve_probability`.
    #[serde(default)]
    pub is_evolved: Option<bool>,
}

impl Given {
    /// Reads the JSON that Python writes, and checks it.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the field.
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let given: Self = serde_json::from_str(json)
            .map_err(|e| Error::invalid("given", e, "given draws as JSON"))?;
        given.check()?;
        Ok(given)
    }

    /// Checks the number of stages.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if there are too many.
    pub fn check(&self) -> Result<(), Error> {
        let is_count = |count: usize| count <= MAX_STAGES;
        Error::require("given.stages", self.stages.len(), "at most 64 stages", is_count)
    }

    /// The goal of a stage, from 1.
    pub(crate) fn goal(&self, stage: usize) -> Option<&str> {
        self.stages.get(stage - 1)?.goal_id.as_deref()
    }

    /// Whether the house evolves before a stage, from 1.
    pub(crate) fn is_evolved(&self, stage: usize) -> Option<bool> {
        self.stages.get(stage - 1)?.is_evolved
    }
}
