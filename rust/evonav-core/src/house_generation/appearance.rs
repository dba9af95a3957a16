//! Materials of walls and floors (`materials` and `exterior_walls` of the package `procthor`).

use crate::{
    assets::SurfaceChoices,
    house_generation::{
        parameters::{Appearance, TimeOfDay},
        sampling::{choose, happens},
    },
    rng::Stream,
};

/// Material that carries paint.
const PAINTED: &str = "PureWhite";

/// A material, and the colour of its paint if it is painted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SurfaceLook {
    pub material: String,
    /// sRGB.
    pub paint: Option<[u8; 3]>,
}

/// Everything about the look of a house that is not its objects.
#[derive(Debug, Clone)]
pub(super) struct HouseLook {
    /// Walls of each room.
    pub walls: Vec<SurfaceLook>,
    /// Ceilings.
    pub ceiling: SurfaceLook,
    /// Outer sides of walls.
    pub outside: String,
    /// Floor of each room.
    pub floors: Vec<String>,
    /// Name of the sky.
    pub sky: String,
    /// Time of day that the sky shows.
    pub time: TimeOfDay,
}

/// Draw the look of a house with `num_rooms` rooms.
pub(super) fn sample_look(rules: &Appearance, num_rooms: usize, stream: &mut Stream) -> HouseLook {
    let choices = SurfaceChoices::bundled();
    let (walls, ceiling) = if happens(stream, rules.same_walls_probability) {
        let wall = sample_wall(rules, choices, stream);
        (vec![wall.clone(); num_rooms], wall)
    } else {
        let walls = (0..num_rooms).map(|_| sample_wall(rules, choices, stream)).collect();
        (walls, sample_wall(rules, choices, stream))
    };
    let material = |names: &[String], stream: &mut Stream| {
        choose(stream, names).map_or(PAINTED, String::as_str).to_owned()
    };
    let floors = if happens(stream, rules.same_floors_probability) {
        vec![material(&choices.floors, stream); num_rooms]
    } else {
        (0..num_rooms).map(|_| material(&choices.floors, stream)).collect()
    };
    let outside = material(&choices.walls, stream);
    let skies: Vec<(TimeOfDay, &String)> = rules
        .skies
        .iter()
        .flat_map(|(&time, names)| names.iter().map(move |name| (time, name)))
        .collect();
    let (time, sky) = choose(stream, &skies)
        .map_or((TimeOfDay::Midday, String::new()), |&(time, name)| (time, name.clone()));
    HouseLook { walls, ceiling, outside, floors, sky, time }
}

fn sample_wall(rules: &Appearance, choices: &SurfaceChoices, stream: &mut Stream) -> SurfaceLook {
    if happens(stream, rules.paint_probability) {
        let paint = choose(stream, &choices.paints).copied();
        return SurfaceLook { material: PAINTED.to_owned(), paint };
    }
    let material = choose(stream, &choices.walls).map_or(PAINTED, String::as_str).to_owned();
    SurfaceLook { material, paint: None }
}
