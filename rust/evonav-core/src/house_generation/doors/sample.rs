//! Put doors into walls, or take walls away (`doors.add_door_meta` of the package `procthor`).

use crate::{
    assets::{Catalogue, OpeningSpace, Split},
    house_generation::{
        doors::{
            connections::{sample_connections, sample_outside_room},
            placed_door::{PlacedDoor, strip},
        },
        parameters::{Doors, HouseParameters, RoomSpec},
        rectangle::Rectangle,
        sampling::{choose, happens, uniform_in},
        structure::Structure,
    },
    rng::Stream,
};

/// Number of combinations of opening sides that are tried, for each pair of margins.
const MAX_FLIPS: usize = 64;

/// All connections of a house.
#[derive(Debug, Clone)]
pub(in crate::house_generation) struct Openings {
    /// Doors and doorframes, the outside door last.
    pub doors: Vec<PlacedDoor>,
    /// Whether each border has no wall.
    pub is_open: Vec<bool>,
    /// Floor that stays free: before and behind doors, and along open borders.
    pub passages: Vec<Rectangle>,
}

/// Draw all connections.
///
/// # Returns
/// `None` if rooms that must be connected do not touch, or no door fits a wall.
pub(in crate::house_generation) fn sample_openings(
    parameters: &HouseParameters,
    structure: &Structure,
    spec: &RoomSpec,
    stream: &mut Stream,
) -> Option<Openings> {
    let rules = &parameters.doors;
    let catalogue = Catalogue::bundled();
    let mut doors = Vec::new();
    let mut is_open = vec![false; structure.borders.len()];
    for (a, b) in sample_connections(structure, spec, stream)? {
        let borders: Vec<usize> = (0..structure.borders.len())
            .filter(|&index| structure.borders[index].rooms == (a, Some(b)))
            .collect();
        let border = sample_border(structure, &borders, stream)?;
        let (room, other) = if happens(stream, 0.5) { (b, a) } else { (a, b) };
        let types = [a, b].map(|room| &structure.rooms[room].room_type);
        let may_be_open = types.iter().all(|kind| rules.open_between.contains(kind));
        let is_wide = may_be_open && happens(stream, rules.open_probability);
        let is_frame = is_wide && happens(stream, rules.frame_probability);
        if is_wide && !is_frame {
            borders.iter().for_each(|&index| is_open[index] = true);
            continue;
        }
        let category = if is_frame { "Doorframe" } else { "Doorway" };
        let wall = (border, room, Some(other));
        doors.push(sample_door(catalogue, parameters.split, structure, category, wall, stream)?);
    }
    if let Some(room) = sample_outside_room(structure, &rules.outside_rooms, stream) {
        let borders: Vec<usize> = (0..structure.borders.len())
            .filter(|&index| structure.borders[index].rooms == (room, None))
            .collect();
        let border = sample_border(structure, &borders, stream)?;
        let wall = (border, room, None);
        doors.push(sample_door(catalogue, parameters.split, structure, "Doorway", wall, stream)?);
    }
    let doors = opened_apart(rules, structure, doors, stream);
    let door_floors = doors.iter().map(|door| door.floor(structure, door.margins_m(rules)));
    let open_borders = (0..structure.borders.len()).filter(|&index| is_open[index]);
    let open_floors = open_borders.filter_map(|index| {
        let border = &structure.borders[index];
        let side = structure.side(border.rooms.0, index)?;
        let margin_m = rules.open_margin_m;
        Some(strip(&side, [0.0, border.length_m()], [-margin_m, margin_m]))
    });
    let passages = door_floors.chain(open_floors).collect();
    Some(Openings { doors, is_open, passages })
}

/// Draw one of some borders, in proportion to their lengths.
fn sample_border(structure: &Structure, borders: &[usize], stream: &mut Stream) -> Option<usize> {
    let lengths: Vec<f64> = borders.iter().map(|&i| structure.borders[i].length_m()).collect();
    Some(borders[stream.choose_weighted(&lengths)?])
}

/// Draw a door's asset and place in a wall: a border and the rooms before and behind it.
fn sample_door(
    catalogue: &'static Catalogue,
    split: Split,
    structure: &Structure,
    category: &str,
    (border, room, other): (usize, usize, Option<usize>),
    stream: &mut Stream,
) -> Option<PlacedDoor> {
    let length_m = structure.borders[border].length_m();
    let has_split = |id: &&String| catalogue.get(id).is_some_and(|it| it.split == Some(split));
    let ids = catalogue.assets_in(category).iter().filter(has_split);
    let spaces: Vec<&OpeningSpace> = ids
        .filter_map(|id| catalogue.opening(id))
        .filter(|space| space.open_m[0] < length_m)
        .collect();
    let space = *choose(stream, &spaces)?;
    let start_m = uniform_in(stream, [0.0, length_m - space.open_m[0]]);
    Some(PlacedDoor { space, border, room, other, start_m })
}

/// Choose the sides to which doors open so that their floors do not overlap, if there are such
/// sides; otherwise with smaller margins (`doors.fix_door_intersections`).
fn opened_apart(
    rules: &Doors,
    structure: &Structure,
    doors: Vec<PlacedDoor>,
    stream: &mut Stream,
) -> Vec<PlacedDoor> {
    let (entrance_m, leaf_m) = (rules.entrance_margin_m, rules.leaf_margin_m);
    let clash = |doors: &[PlacedDoor], margins_m: [f64; 2]| {
        let floor = |door: &PlacedDoor| {
            let frame_m = [rules.open_margin_m; 2];
            door.floor(structure, if door.is_frame() { frame_m } else { margins_m })
        };
        let floors: Vec<Rectangle> = doors.iter().map(floor).collect();
        let pairs = (0..floors.len()).flat_map(|a| (0..a).map(move |b| (b, a)));
        pairs.filter(|&(a, b)| floors[a].overlaps(&floors[b])).collect::<Vec<_>>()
    };
    for margins_m in [[entrance_m, leaf_m], [entrance_m, 0.0], [0.0, leaf_m], [0.0, 0.0]] {
        let mut tried = doors.clone();
        for _ in 0..MAX_FLIPS {
            let clashes = clash(&tried, margins_m);
            let Some(&(a, b)) = choose(stream, &clashes) else { return tried };
            for index in [[a].as_slice(), &[b], &[a, b]][stream.below(3)] {
                tried[*index] = tried[*index].flipped(structure);
            }
        }
    }
    doors
}
