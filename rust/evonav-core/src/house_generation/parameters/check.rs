//! Read the parameters, and check every value.

use serde_json::Value;

use crate::{
    Error,
    assets::{Asset, Catalogue},
    house_generation::parameters::{HouseParameters, RoomNode},
};

/// Largest number of rooms of a spec: several times that of ProcTHOR's largest.
const MAX_ROOMS: usize = 30;
/// Largest number of cells along a side of a house.
const MAX_SIDE_CELLS: usize = 20;
/// Largest number of places tried in a room: free rectangles grow with its fourth power.
const MAX_TRIES: usize = 20;
/// Largest weight.
const MAX_WEIGHT: f64 = 1e9;

impl HouseParameters {
    /// Read parameters; what is left out has its default. Sections are read one by one, so that an
    /// error names the section.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the field, the value and what is expected.
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let root: Value = serde_json::from_str(json)
            .map_err(|error| Error::invalid("parameters", error, "parameters as JSON"))?;
        let Value::Object(sections) = &root else {
            return Err(Error::invalid("parameters", root, "an object"));
        };
        for (name, value) in sections {
            let alone = serde_json::json!({ name: value });
            let _: Self = serde_json::from_value(alone)
                .map_err(|error| Error::invalid(name, error, "a parameter of house generation"))?;
        }
        let found: Self = serde_json::from_value(root)
            .map_err(|error| Error::invalid("parameters", error, "parameters as JSON"))?;
        found.check(Catalogue::bundled())?;
        Ok(found)
    }

    /// Write the JSON that [`Self::from_json`] reads.
    pub fn to_json(&self) -> String {
        // Only maps whose keys are not strings could fail, and there are none.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Check every value.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] naming the field, the value and what is expected.
    pub fn check(&self, catalogue: &Catalogue) -> Result<(), Error> {
        self.check_specs()?;
        self.check_numbers()?;
        self.check_names(catalogue)?;
        let is_count = |v: usize| (1..=100).contains(&v);
        Error::require("max_structures", self.max_structures, "in 1..=100", is_count)?;
        Error::require("max_furnishings", self.max_furnishings, "in 1..=100", is_count)?;
        let is_places = |v: usize| v <= 100;
        Error::require("min_places_per_room", self.min_places_per_room, "in 0..=100", is_places)
    }

    fn check_specs(&self) -> Result<(), Error> {
        if self.room_specs.is_empty() {
            return Err(Error::invalid("room_specs", "empty", "at least one spec"));
        }
        let is_weight = |v: f64| v > 0.0 && v <= MAX_WEIGHT;
        for (index, spec) in self.room_specs.iter().enumerate() {
            let field = format!("room_specs[{index}]");
            if self.room_specs[..index].iter().any(|other| other.id == spec.id) {
                return Err(Error::invalid(&format!("{field}.id"), &spec.id, "no id twice"));
            }
            Error::require(
                &format!("{field}.weight"),
                spec.weight,
                "in 0..=1e9, not 0",
                is_weight,
            )?;
            for [least, most] in spec.cells.iter().flatten() {
                if !(1 <= *least && least <= most && *most <= MAX_SIDE_CELLS) {
                    let expected = "[least, most] in 1..=20";
                    let value = format!("[{least}, {most}]");
                    return Err(Error::invalid(&format!("{field}.cells"), value, expected));
                }
            }
            check_rooms(&format!("{field}.rooms"), &spec.rooms)?;
            let is_number = |v: usize| v <= MAX_ROOMS;
            let num_rooms = spec.leaves().len();
            Error::require(&format!("{field}.rooms"), num_rooms, "at most 30 rooms", is_number)?;
        }
        Ok(())
    }

    fn check_numbers(&self) -> Result<(), Error> {
        let Self { structure, doors, appearance, floor_objects, hung, small_objects, .. } = self;
        for (name, value) in [
            ("doors.open_probability", doors.open_probability),
            ("doors.frame_probability", doors.frame_probability),
            ("appearance.same_walls_probability", appearance.same_walls_probability),
            ("appearance.same_floors_probability", appearance.same_floors_probability),
            ("appearance.paint_probability", appearance.paint_probability),
            ("floor_objects.group_probability", floor_objects.group_probability),
            ("floor_objects.skip_untypical_probability", floor_objects.skip_untypical_probability),
            ("floor_objects.edge_probability", floor_objects.edge_probability),
            ("floor_objects.largest_probability", floor_objects.largest_probability),
        ] {
            Error::require(name, value, "in 0..=1", |v| (0.0..=1.0).contains(&v))?;
        }
        let tables = [
            ("floor_objects.allowed_groups", &floor_objects.allowed_groups),
            ("floor_objects.lying", &floor_objects.lying),
            ("hung.television_rooms", &hung.television_rooms),
        ];
        for (name, table) in tables {
            for (key, &value) in table {
                let field = format!("{name}.{key}");
                Error::require(&field, value, "in 0..=1", |v| (0.0..=1.0).contains(&v))?;
            }
        }
        for (name, value) in [
            ("doors.open_margin_m", doors.open_margin_m),
            ("doors.entrance_margin_m", doors.entrance_margin_m),
            ("doors.leaf_margin_m", doors.leaf_margin_m),
            ("floor_objects.middle_margin_m", floor_objects.middle_margin_m),
            ("floor_objects.front_margin_m", floor_objects.front_margin_m),
            ("floor_objects.wall_padding_m", floor_objects.wall_padding_m),
            ("floor_objects.min_side_m", floor_objects.min_side_m),
            ("hung.gap_m", hung.gap_m),
            ("hung.clear_above_m", hung.clear_above_m),
            ("hung.centred_below_m", hung.centred_below_m),
        ] {
            Error::require(name, value, "a length in 0..=10", |v| (0.0..=10.0).contains(&v))?;
        }
        let span = |name: &str, [low, high]: [f64; 2], least: f64, most: f64| {
            let is_span = least <= low && low <= high && high <= most;
            let expected = format!("[least, most] in {least}..={most}");
            let value = format!("[{low}, {high}]");
            if is_span { Ok(()) } else { Err(Error::invalid(name, value, &expected)) }
        };
        span("structure.cell_m", structure.cell_m, 1.2, 5.0)?;
        span("structure.height_m", structure.height_m, 2.2, 20.0)?;
        span("small_objects.house_bias", small_objects.house_bias, -1.0, 1.0)?;
        let is_shape = |v: f64| (0.01..=1e4).contains(&v);
        for (name, shape) in [
            ("structure.height_beta", structure.height_beta),
            ("hung.height_beta", hung.height_beta),
            ("small_objects.house_bias_beta", small_objects.house_bias_beta),
            ("structure.cut_beta", [structure.cut_beta, structure.cut_alpha_per_room]),
        ] {
            for value in shape {
                Error::require(name, value, "in 0.01..=1e4", is_shape)?;
            }
        }
        for (name, value, most) in [
            ("structure.room_cells", structure.room_cells, 10.0),
            ("structure.cut_scale", structure.cut_scale, 100.0),
            ("structure.cells_per_ratio", structure.cells_per_ratio, 1000.0),
        ] {
            let expected = format!("in 0..={most}");
            Error::require(name, value, &expected, |v| (0.0..=most).contains(&v))?;
        }
        for (name, value, least, most) in [
            ("structure.min_side_cells", structure.min_side_cells, 1, MAX_SIDE_CELLS),
            ("structure.max_cut_cells", structure.max_cut_cells, 0, 100),
            ("structure.num_candidates", structure.num_candidates, 1, 1000),
            ("floor_objects.group_tries", floor_objects.group_tries, 1, 1000),
            ("small_objects.max_of_category", small_objects.max_of_category, 1, 100),
            ("small_objects.num_points", small_objects.num_points, 1, 1000),
        ] {
            let expected = format!("in {least}..={most}");
            Error::require(name, value, &expected, |v| (least..=most).contains(&v))?;
        }
        let counts = floor_objects.max_per_room.iter();
        if let Some((count, _)) = counts.clone().find(|(count, _)| *count > MAX_TRIES) {
            let expected = "at most 20 places";
            return Err(Error::invalid("floor_objects.max_per_room", count, expected));
        }
        let numbers: Vec<f64> = counts.map(|&(_, weight)| weight).collect();
        check_weights("floor_objects.max_per_room", &numbers)?;
        check_weights("hung.window_weights", &hung.window_weights)?;
        check_weights("hung.painting_weights", &hung.painting_weights)?;
        for (category, weights) in &appearance.openness {
            check_weights(&format!("appearance.openness.{category}"), weights)?;
        }
        let biases = small_objects.receptacle_biases.iter().chain(&small_objects.object_biases);
        let default = ("receptacle_bias".to_owned(), small_objects.receptacle_bias);
        for (key, value) in biases.chain([(&default.0, &default.1)]) {
            let field = format!("small_objects: bias of {key}");
            Error::require(&field, *value, "in -1..=1", |v| (-1.0..=1.0).contains(&v))?;
        }
        for (category, &height_m) in &small_objects.max_heights_m {
            let field = format!("small_objects.max_heights_m.{category}");
            Error::require(&field, height_m, "in 0..=10", |v| (0.0..=10.0).contains(&v))?;
        }
        Ok(())
    }

    /// Check that categories, groups and assets exist.
    fn check_names(&self, catalogue: &Catalogue) -> Result<(), Error> {
        let Self { appearance, floor_objects, hung, small_objects, .. } = self;
        let categories = catalogue.categories();
        let lists: [(&str, Vec<&String>); 7] = [
            ("appearance.toggled", appearance.toggled.iter().collect()),
            ("appearance.dirtied", appearance.dirtied.iter().collect()),
            ("appearance.openness", appearance.openness.keys().collect()),
            ("floor_objects.priority", floor_objects.priority.values().flatten().collect()),
            ("floor_objects.lying", floor_objects.lying.keys().collect()),
            ("small_objects.receptacle_biases", small_objects.receptacle_biases.keys().collect()),
            ("small_objects.object_biases", small_objects.object_biases.keys().collect()),
        ];
        for (field, names) in lists {
            let unknown = names.into_iter().find(|name| !categories.contains(&name.as_str()));
            if let Some(name) = unknown {
                return Err(Error::invalid(field, name, "categories of the catalogue"));
            }
        }
        let is_group = |name: &&String| catalogue.groups().iter().all(|group| group.name != **name);
        if let Some(name) = floor_objects.allowed_groups.keys().find(is_group) {
            let expected = "names of asset groups";
            return Err(Error::invalid("floor_objects.allowed_groups", name, expected));
        }
        let is_television =
            |asset: Option<&Asset>| asset.is_some_and(|it| it.category == "Television");
        let unknown = hung.televisions.iter().find(|id| !is_television(catalogue.get(id)));
        if let Some(id) = unknown {
            return Err(Error::invalid("hung.televisions", id, "televisions of the catalogue"));
        }
        if appearance.skies.values().flatten().next().is_none() {
            return Err(Error::invalid("appearance.skies", "empty", "at least one sky"));
        }
        Ok(())
    }
}

fn check_weights(field: &str, weights: &[f64]) -> Result<(), Error> {
    let is_weight = |v: f64| (0.0..=MAX_WEIGHT).contains(&v);
    for &weight in weights {
        Error::require(field, weight, "weights in 0..=1e9", is_weight)?;
    }
    match weights.iter().sum::<f64>() > 0.0 {
        true => Ok(()),
        false => Err(Error::invalid(field, format!("{weights:?}"), "a positive sum of weights")),
    }
}

fn check_rooms(field: &str, rooms: &[RoomNode]) -> Result<(), Error> {
    if rooms.is_empty() {
        return Err(Error::invalid(field, "empty", "at least one room"));
    }
    for (index, node) in rooms.iter().enumerate() {
        let field = format!("{field}[{index}]");
        let is_ratio = |v: f64| v > 0.0 && v <= 1e6;
        Error::require(&format!("{field}.ratio"), node.ratio, "in 0..=1e6, not 0", is_ratio)?;
        match (&node.room_type, node.rooms.is_empty()) {
            (Some(name), true) if name.is_empty() || name.len() > 64 => {
                return Err(Error::invalid(&format!("{field}.type"), name, "1 to 64 characters"));
            }
            (Some(_), true) => {}
            (None, false) => check_rooms(&format!("{field}.rooms"), &node.rooms)?,
            (Some(name), false) => {
                let expected = "either `type` or `rooms`, not both";
                return Err(Error::invalid(&format!("{field}.type"), name, expected));
            }
            (None, true) => {
                let expected = "a `type` (a room) or `rooms` (a group)";
                return Err(Error::invalid(&field, "neither", expected));
            }
        }
    }
    Ok(())
}
