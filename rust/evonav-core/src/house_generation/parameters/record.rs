//! The record of all parameters, and ProcTHOR's values.
//!
//! Unless a field says otherwise, its default is that of the package `procthor` 0.0.1.dev2
//! (Deitke et al., NeurIPS 2022; Apache-2.0), and the module and constant named with it are the
//! package's.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{
    assets::Split,
    house_generation::parameters::{RoomSpec, room_spec::procthor_specs},
};

/// Everything that decides how houses are made, but the seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HouseParameters {
    /// Split whose assets are used, besides those of no split.
    pub split: Split,
    /// Specs from which the rooms are drawn (`room_specs`).
    pub room_specs: Vec<RoomSpec>,
    /// Floor plan and height.
    pub structure: Structure,
    /// Doors and open borders between rooms.
    pub doors: Doors,
    /// Materials, light and states.
    pub appearance: Appearance,
    /// Objects that stand on the floor.
    pub floor_objects: FloorObjects,
    /// Windows, and objects that hang on walls.
    pub hung: Hung,
    /// Small objects on furniture.
    pub small_objects: SmallObjects,
    /// Number of floor plans that are drawn before a house is given up; ours.
    pub max_structures: usize,
    /// Number of times that a floor plan is furnished again before another one is drawn; ours.
    pub max_furnishings: usize,
    /// Least number of places of the 0.25 m grid that the agent must reach in each room
    /// (`house.House.validate`).
    pub min_places_per_room: usize,
}

/// Parameters of the floor plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Structure {
    /// Edge length of a cell, `[least, most]`, drawn once a house (`SamplingVars`).
    pub cell_m: [f64; 2],
    /// Edge length of an average room in cells (`AVERAGE_ROOM_SIZE`).
    pub room_cells: f64,
    /// Least number of cells along a side of a house (`MIN_HOUSE_SIDE_LENGTH`).
    pub min_side_cells: usize,
    /// Largest number of cells in one cut out of a corner (`MAX_BOUNDARY_CUT_AREA`).
    pub max_cut_cells: usize,
    /// The number of cuts is `cut_scale` times a draw from Beta(`cut_alpha_per_room` times the
    /// number of rooms, `cut_beta`), rounded (`get_n_cuts`).
    pub cut_scale: f64,
    /// See [`Self::cut_scale`].
    pub cut_alpha_per_room: f64,
    /// See [`Self::cut_scale`].
    pub cut_beta: f64,
    /// Number of floor plans grown; the one whose areas are nearest to the spec's is taken
    /// (`generate_floorplan`).
    pub num_candidates: usize,
    /// Cells to which a room of ratio 1 grows before it takes what is left (`grow_rect`).
    pub cells_per_ratio: f64,
    /// Lowest and highest ceiling (`MIN_CEILING_HEIGHT`, `MAX_CEILING_HEIGHT`).
    pub height_m: [f64; 2],
    /// Parameters of the Beta distribution of heights in between (`BETA_A`, `BETA_B`).
    pub height_beta: [f64; 2],
}

/// Parameters of doors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Doors {
    /// Pair of room types that may have an open connection (`OPEN_ROOM_CONNECTIONS`).
    pub open_between: [String; 2],
    /// Probability of an open connection between such rooms.
    pub open_probability: f64,
    /// Probability that an open connection is a doorframe and not a missing wall.
    pub frame_probability: f64,
    /// Room types that get the outside door if there are any (`PREFERRED_ROOMS_TO_OUTSIDE`).
    pub outside_rooms: Vec<String>,
    /// Free depth on both sides of an open connection (`OPEN_ROOM_PADDING`).
    pub open_margin_m: f64,
    /// Free depth in front of a door on the side to which it does not open
    /// (`PREFERRED_ENTRANCE_PADDING`).
    pub entrance_margin_m: f64,
    /// Free depth beyond an open leaf (`PADDING_IN_FRONT_OF_DOOR`).
    pub leaf_margin_m: f64,
}

/// Parameters of materials, light and states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Appearance {
    /// Probability that all walls have one material (`P_ALL_WALLS_SAME`).
    pub same_walls_probability: f64,
    /// Probability that all floors have one material (`P_ALL_FLOOR_SAME`).
    pub same_floors_probability: f64,
    /// Probability that a wall is painted (`P_SAMPLE_SOLID_WALL_COLOR`).
    pub paint_probability: f64,
    /// Skies by the time of day that they show (`skyboxes.json`); each sky is as probable as any.
    pub skies: BTreeMap<TimeOfDay, Vec<String>>,
    /// Categories that are switched on or off (`TYPES_TO_TOGGLE`).
    pub toggled: Vec<String>,
    /// Categories that are clean or not (`TYPES_TO_DIRTY`).
    pub dirtied: Vec<String>,
    /// Weights of closed, open and anything in between by category (`OPENNESS_RANDOMIZATIONS`).
    pub openness: BTreeMap<String, [f64; 3]>,
}

/// A time of day: it decides the light (`skyboxes.add_skybox`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TimeOfDay {
    /// High sun, white.
    Midday,
    /// Low sun, rosy.
    GoldenHour,
    /// Sun below the horizon, bluish.
    BlueHour,
}

/// Parameters of floor objects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FloorObjects {
    /// Numbers of places tried in each room of a house and their weights (`SamplingVars`).
    pub max_per_room: Vec<(usize, f64)>,
    /// Categories placed first, by room type (`PRIORITY_ASSET_TYPES`).
    pub priority: BTreeMap<String, Vec<String>>,
    /// Free depth on all sides of objects in the middle of a room (`MARGIN`).
    pub middle_margin_m: f64,
    /// Free depth in front of objects at an edge or in a corner (`MARGIN`).
    pub front_margin_m: f64,
    /// Length by which objects are kept off walls, half of it on either side
    /// (`PADDING_AGAINST_WALL`).
    pub wall_padding_m: f64,
    /// Probability of an asset group where one fits (`P_CHOOSE_ASSET_GROUP`).
    pub group_probability: f64,
    /// Number of draws of a group whose members touch (`MAX_INTERSECTING_OBJECT_RETRIES`).
    pub group_tries: usize,
    /// Probability that categories of weight 1 are left out (`P_W1_ASSET_SKIPPED`).
    pub skip_untypical_probability: f64,
    /// Probability of the edge for a rectangle at the edge of a room (`P_CHOOSE_EDGE`).
    pub edge_probability: f64,
    /// Probability of the largest free rectangle (`P_LARGEST_RECTANGLE`).
    pub largest_probability: f64,
    /// Least side of any other rectangle (`MIN_RECTANGLE_SIDE_SIZE`).
    pub min_side_m: f64,
    /// Probability that a room may have a group, for groups that would be too frequent
    /// (`P_ALLOW_HOUSE_PLANT_GROUP`, `P_ALLOW_TV_GROUP`).
    pub allowed_groups: BTreeMap<String, f64>,
    /// Probability that an object lies instead of standing, by category (`FLOOR_OBJECTS_TO_DROP`).
    pub lying: BTreeMap<String, f64>,
}

/// Parameters of windows and of objects on walls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Hung {
    /// Height below which objects are centred on walls (`MAX_CENTER_Y_HEIGHT`).
    pub centred_below_m: f64,
    /// Parameters of the Beta distribution of heights on a wall (`BETA_A`, `BETA_B`).
    pub height_beta: [f64; 2],
    /// Room types with windows (`ROOM_TYPES_WITH_WINDOWS`).
    pub window_rooms: Vec<String>,
    /// Weights of 0, 1, 2 ... windows a room (`WINDOWS_PER_ROOM`).
    pub window_weights: Vec<f64>,
    /// Room types with paintings (`ROOM_TYPES_WITH_PAINTINGS`).
    pub painting_rooms: Vec<String>,
    /// Weights of 0, 1, 2 ... paintings a room (`PAINTINGS_PER_ROOM`).
    pub painting_weights: Vec<f64>,
    /// Gap between a wall and what hangs on it (`PAINTING_WALL_PADDING`).
    pub gap_m: f64,
    /// Height from which an object on the floor leaves no room above it
    /// (`NO_PAINTINGS_ABOVE_ASSETS_OF_HEIGHT`).
    pub clear_above_m: f64,
    /// Televisions that can hang on a wall (`VALID_WALL_TELEVISIONS`).
    pub televisions: Vec<String>,
    /// Probability of one in a room without a television (`ROOMS_WITH_WALL_TELEVISIONS`).
    pub television_rooms: BTreeMap<String, f64>,
}

/// Parameters of small objects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SmallObjects {
    /// Added to the probability of an object on a receptacle (`PARENT_BIAS`).
    pub receptacle_bias: f64,
    /// The same for some categories of receptacles.
    pub receptacle_biases: BTreeMap<String, f64>,
    /// Added to the probability for some categories of objects (`CHILD_BIAS`; its `Basketball` is no
    /// category of the package, so it has no effect there and is left out here).
    pub object_biases: BTreeMap<String, f64>,
    /// Least and largest value added for a whole house (`randomize_bias`).
    pub house_bias: [f64; 2],
    /// Parameters of the Beta distribution of that value.
    pub house_bias_beta: [f64; 2],
    /// Largest number of objects of a category on a receptacle (`MAX_OF_TYPE_ON_RECEPTACLE`).
    pub max_of_category: usize,
    /// Height from which an asset of a category is not small (`HOUSE_PLANT_MAX_HEIGHT`).
    pub max_heights_m: BTreeMap<String, f64>,
    /// Number of points tried for an object on its receptacle, with 4 yaws each, as AI2-THOR's
    /// `InitialRandomSpawn` does (`numPlacementAttempts` and the first one).
    pub num_points: usize,
}

fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

fn table<T: Clone>(rows: &[(&str, T)]) -> BTreeMap<String, T> {
    rows.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect()
}

impl Default for HouseParameters {
    fn default() -> Self {
        Self {
            split: Split::Train,
            room_specs: procthor_specs(),
            structure: Structure::default(),
            doors: Doors::default(),
            appearance: Appearance::default(),
            floor_objects: FloorObjects::default(),
            hung: Hung::default(),
            small_objects: SmallObjects::default(),
            max_structures: 40,
            max_furnishings: 6,
            min_places_per_room: 5,
        }
    }
}

impl Default for Structure {
    fn default() -> Self {
        Self {
            cell_m: [1.6, 2.2],
            room_cells: 3.0,
            min_side_cells: 2,
            max_cut_cells: 6,
            cut_scale: 10.0,
            cut_alpha_per_room: 0.5,
            cut_beta: 6.0,
            num_candidates: 100,
            cells_per_ratio: 4.0,
            height_m: [2.5, 7.0],
            height_beta: [1.25, 5.5],
        }
    }
}

impl Default for Doors {
    fn default() -> Self {
        Self {
            open_between: ["Kitchen", "LivingRoom"].map(str::to_owned),
            open_probability: 0.75,
            frame_probability: 0.5,
            outside_rooms: names(&["Kitchen", "LivingRoom"]),
            open_margin_m: 0.35,
            entrance_margin_m: 0.5,
            leaf_margin_m: 0.35,
        }
    }
}

impl Default for Appearance {
    fn default() -> Self {
        let midday = [
            "Sky1",
            "Sky2",
            "SkyAlbany",
            "SkyAlbanyHill",
            "SkyDalyCity",
            "SkyEmeryville",
            "SkyGarden",
            "SkyGasworks",
            "SkyMosconeCenter",
            "SkyMountain",
            "SkyOakland",
            "SkySeaStacks",
            "SkySFCityHall",
            "SkySFDowntown",
            "SkySFGarden",
            "SkySnow",
        ];
        let golden =
            ["SkyNeighborhood", "SkySouthLakeUnion", "SkySunset", "SkyTreeFarm", "SkyTropical"];
        Self {
            same_walls_probability: 0.35,
            same_floors_probability: 0.15,
            paint_probability: 0.5,
            skies: BTreeMap::from([
                (TimeOfDay::Midday, names(&midday)),
                (TimeOfDay::GoldenHour, names(&golden)),
                (TimeOfDay::BlueHour, names(&["Sky2Dusk"])),
            ]),
            toggled: names(&["DeskLamp", "FloorLamp"]),
            dirtied: names(&["Bed"]),
            openness: table(&[("Box", [0.5, 0.5, 0.0]), ("Laptop", [0.4, 0.4, 0.2])]),
        }
    }
}

impl Default for FloorObjects {
    fn default() -> Self {
        Self {
            max_per_room: vec![(1, 0.005), (4, 0.01), (5, 0.02), (6, 0.1), (7, 0.865)],
            priority: BTreeMap::from([
                ("Bedroom".to_owned(), names(&["Bed", "Dresser"])),
                ("LivingRoom".to_owned(), names(&["Television", "DiningTable", "Sofa"])),
                ("Kitchen".to_owned(), names(&["CounterTop", "Fridge"])),
                ("Bathroom".to_owned(), names(&["Toilet", "Sink"])),
            ]),
            middle_margin_m: 0.35,
            front_margin_m: 0.5,
            wall_padding_m: 0.05,
            group_probability: 0.6,
            group_tries: 5,
            skip_untypical_probability: 0.8,
            edge_probability: 0.7,
            largest_probability: 0.8,
            min_side_m: 0.5,
            allowed_groups: table(&[("floor-house-plant", 0.5), ("television", 0.5)]),
            lying: table(&[("BaseballBat", 0.7)]),
        }
    }
}

impl Default for Hung {
    fn default() -> Self {
        Self {
            centred_below_m: 3.0,
            height_beta: [12.0, 12.0],
            window_rooms: names(&["Bedroom", "Kitchen", "LivingRoom"]),
            window_weights: vec![0.125, 0.375, 0.5],
            painting_rooms: names(&["Bedroom", "Kitchen", "LivingRoom", "Bathroom"]),
            painting_weights: vec![0.05, 0.1, 0.5, 0.25, 0.1],
            gap_m: 0.005,
            clear_above_m: 1.15,
            televisions: names(&[
                "Television_14",
                "Television_16",
                "Television_25",
                "Television_27",
                "Television_3",
                "Television_9",
            ]),
            television_rooms: table(&[("LivingRoom", 0.8), ("Kitchen", 0.25), ("Bedroom", 0.4)]),
        }
    }
}

impl Default for SmallObjects {
    fn default() -> Self {
        Self {
            receptacle_bias: 0.2,
            receptacle_biases: table(&[("Chair", 0.0), ("ArmChair", 0.0), ("ShelvingUnit", 0.4)]),
            object_biases: table(&[
                ("HousePlant", 0.25),
                ("SprayBottle", 0.2),
                ("Pot", 0.1),
                ("Pan", 0.1),
                ("Bowl", 0.05),
                ("BaseballBat", 0.1),
            ]),
            house_bias: [-0.3, 0.1],
            house_bias_beta: [3.5, 1.9],
            max_of_category: 3,
            max_heights_m: table(&[("HousePlant", 0.75)]),
            num_points: 6,
        }
    }
}
