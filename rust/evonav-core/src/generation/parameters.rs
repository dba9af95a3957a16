//! The hyperparameters of generation.

use serde::{Deserialize, Serialize};

use crate::{Error, generation::Extensions, sensors::raster::Style};

/// Θ (paper, Sec. A.2), and the values that the paper leaves open.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Numbers of stages from which K is drawn uniformly.
    pub num_stages: Vec<usize>,
    /// Probability that a transition evolves the house.
    pub evolve_probability: f64,
    /// Factor on the weight of rooms that the reference trajectory has visited.
    pub visited_factor: f64,
    /// Factor on the weight of rooms that changed within `changed_room_window`.
    pub recently_changed_factor: f64,
    /// Number of past transitions within which a change is recent.
    pub changed_room_window: usize,
    /// Probability of [`crate::generation::Mode::SalientObject`], relative to the two others.
    pub salient_object_probability: f64,
    /// Probability of [`crate::generation::Mode::RetainGroup`], relative to the two others.
    pub retain_group_probability: f64,
    /// Probability of [`crate::generation::Mode::FullShuffle`], relative to the two others.
    pub full_shuffle_probability: f64,
    /// Factor on the goal weight of the room that just changed.
    pub changed_room_multiplier: f64,
    /// Factor on the goal weight of a goal room within `goal_room_window`.
    pub previous_goal_room_multiplier: f64,
    /// Number of past stages whose goal rooms have `previous_goal_room_multiplier`, once for each.
    pub goal_room_window: usize,
    /// Weight of the salient object that just moved; other objects of its room have weight 1.
    pub moved_object_multiplier: f64,
    /// Weight of each object that stood on the salient object and moved with it.
    pub moved_children_multiplier: f64,
    /// Whether objects that hang on walls, which no modification moves, may be goals. The paper
    /// uses them as anchors of instructions; excluding them from the goals gives the published
    /// share of relocated goals.
    pub goals_on_walls: bool,
    /// Smallest distance of the reference pose from the target on the ground plane.
    pub reference_min_m: f64,
    /// Largest distance of the reference pose from the target on the ground plane.
    pub reference_max_m: f64,
    /// Edge length of the reference image.
    pub reference_image_px: usize,
    /// Way in which the reference image is drawn.
    pub reference_style: Style,
    /// Smallest number of pixels of a visible target.
    pub reference_min_visible_px: usize,
    /// Distance beyond which a moved object is relocated.
    pub relocated_min_m: f64,
    /// Number of places tried for an object before it stays where it is.
    pub placement_tries: usize,
    /// Number of times that a room's modification is tried with newly drawn places.
    pub modification_tries: usize,
    /// Parameters of the extensions beyond the paper.
    #[serde(default)]
    pub extensions: Extensions,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            num_stages: vec![3, 4, 5],
            evolve_probability: 0.5,
            visited_factor: 3.0,
            recently_changed_factor: 0.5,
            changed_room_window: 1,
            salient_object_probability: 0.5,
            retain_group_probability: 0.4,
            full_shuffle_probability: 0.1,
            changed_room_multiplier: 9.0,
            previous_goal_room_multiplier: 0.2,
            goal_room_window: 1,
            moved_object_multiplier: 9.0,
            moved_children_multiplier: 9.0,
            goals_on_walls: false,
            reference_min_m: 1.0,
            reference_max_m: 1.5,
            reference_image_px: 300,
            reference_style: Style::default(),
            reference_min_visible_px: 50,
            relocated_min_m: 0.1,
            placement_tries: 100,
            modification_tries: 3,
            extensions: Extensions::default(),
        }
    }
}

impl Parameters {
    /// Read the JSON that Python's `GenerationParameters` writes, and check every value.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the field.
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let parameters: Self = serde_json::from_str(json)
            .map_err(|e| Error::invalid("parameters", e, "generation parameters as JSON"))?;
        parameters.check()?;
        Ok(parameters)
    }

    /// Write the JSON that [`Parameters::from_json`] reads.
    pub fn to_json(&self) -> String {
        // Only maps whose keys are not strings could fail, and there are none.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Check every value.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the field.
    pub fn check(&self) -> Result<(), Error> {
        let is_stage_count = |&n: &usize| (1..=64).contains(&n);
        if self.num_stages.is_empty() || !self.num_stages.iter().all(is_stage_count) {
            let found = format!("{:?}", self.num_stages);
            return Err(Error::invalid("num_stages", found, "counts of 1..=64, at least one"));
        }
        let is_weight = |v: f64| v.is_finite() && (0.0..=1e9).contains(&v);
        for (name, value) in [
            ("visited_factor", self.visited_factor),
            ("recently_changed_factor", self.recently_changed_factor),
            ("salient_object_probability", self.salient_object_probability),
            ("retain_group_probability", self.retain_group_probability),
            ("full_shuffle_probability", self.full_shuffle_probability),
            ("changed_room_multiplier", self.changed_room_multiplier),
            ("previous_goal_room_multiplier", self.previous_goal_room_multiplier),
            ("moved_object_multiplier", self.moved_object_multiplier),
            ("moved_children_multiplier", self.moved_children_multiplier),
            ("relocated_min_m", self.relocated_min_m),
            ("reference_min_m", self.reference_min_m),
            ("reference_max_m", self.reference_max_m),
        ] {
            Error::require(name, value, "in 0..=1e9", is_weight)?;
        }
        let is_probability = |v: f64| (0.0..=1.0).contains(&v);
        Error::require("evolve_probability", self.evolve_probability, "in 0..=1", is_probability)?;
        let modes = self.mode_weights().iter().sum::<f64>();
        Error::require("salient_object_probability", modes, "a positive sum over modes", |v| {
            v > 0.0
        })?;
        let is_image = |v: usize| (16..=4096).contains(&v);
        Error::require("reference_image_px", self.reference_image_px, "in 16..=4096", is_image)?;
        let least = self.reference_min_m;
        let expected = "at least reference_min_m";
        Error::require("reference_max_m", self.reference_max_m, expected, |v| v >= least)?;
        let is_tries = |v: usize| (1..=100_000).contains(&v);
        Error::require("placement_tries", self.placement_tries, "in 1..=100000", is_tries)?;
        let is_window = |v: usize| (1..=64).contains(&v);
        Error::require("goal_room_window", self.goal_room_window, "in 1..=64", is_window)?;
        let is_tries = |v: usize| (1..=1000).contains(&v);
        Error::require("modification_tries", self.modification_tries, "in 1..=1000", is_tries)?;
        self.extensions.check()
    }

    /// Return the weights of the three modes, in the order of [`crate::generation::Mode::ALL`].
    pub fn mode_weights(&self) -> [f64; 3] {
        [
            self.salient_object_probability,
            self.retain_group_probability,
            self.full_shuffle_probability,
        ]
    }
}
