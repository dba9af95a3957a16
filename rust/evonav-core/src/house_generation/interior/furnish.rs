//! Furnish a room (`objects.add_floor_objects` of the package `procthor`).

use crate::{
    assets::Asset,
    geometry::{Vec2, rotate, yaw_rotation},
    house_generation::{
        interior::{
            FreeFloor, Piece, PlacedObject, Stock,
            anchor::Anchor,
            choice::{Choice, Chosen},
            free_floor::largest_of,
        },
        parameters::{Appearance, FloorObjects, HouseParameters},
        rectangle::Rectangle,
        sampling::happens,
    },
    rng::Stream,
};

/// Place furniture in an empty room.
///
/// # Arguments
/// * `num_tries` - number of places that are tried; a place for which nothing is drawn counts.
/// * `floor` - free floor of the room, which is taken by the furniture.
pub(in crate::house_generation) fn furnish(
    parameters: &HouseParameters,
    stock: &Stock,
    room_type: &str,
    num_tries: usize,
    floor: &mut FreeFloor,
    stream: &mut Stream,
) -> Vec<Piece> {
    let rules = &parameters.floor_objects;
    let mut choice = Choice::new(rules, stock, room_type, stream);
    let mut pieces = Vec::new();
    let mut rectangles = floor.rectangles();
    for _ in 0..num_tries {
        let Some(rectangle) = next_rectangle(rules, &rectangles, stream) else { break };
        let anchor = Anchor::sample(rules, &floor.polygon_m, &rectangle, stream);
        match choice.sample(&rectangle, &anchor, stream) {
            Some((chosen, is_turned)) => {
                let piece = placed(parameters, chosen, is_turned, &anchor, &rectangle, stream);
                floor.take(piece.margined);
                rectangles = floor.rectangles();
                pieces.push(piece);
            }
            None => rectangles.retain(|other| *other != rectangle),
        }
    }
    pieces
}

/// Draw the free rectangle for the next piece; `None` if there is none.
fn next_rectangle(
    rules: &FloorObjects,
    rectangles: &[Rectangle],
    stream: &mut Stream,
) -> Option<Rectangle> {
    if happens(stream, rules.largest_probability) {
        return largest_of(rectangles);
    }
    let is_wide = |it: &&Rectangle| it.size_m().iter().all(|&side| side >= rules.min_side_m);
    let wide: Vec<Rectangle> = rectangles.iter().filter(is_wide).copied().collect();
    let areas: Vec<f64> = wide.iter().map(Rectangle::area_m2).collect();
    stream.choose_weighted(&areas).map(|index| wide[index])
}

/// Put a drawn piece in its place.
fn placed(
    parameters: &HouseParameters,
    chosen: Chosen,
    is_turned: bool,
    anchor: &Anchor,
    rectangle: &Rectangle,
    stream: &mut Stream,
) -> Piece {
    let rules = &parameters.floor_objects;
    let [width, depth] = chosen.size_m();
    let size_m = if is_turned { [depth, width] } else { [width, depth] };
    let (floor, yaw_deg) = anchor.floor(rules, rectangle, size_m, is_turned, stream);
    let centre_m = floor.centre_m();
    let (objects, is_group) = match chosen {
        Chosen::Single(asset) => {
            let object = PlacedObject {
                asset,
                position_m: [centre_m[0], 0.5 * asset.size_m[1], centre_m[1]],
                rotation_deg: [0.0, yaw_deg, 0.0],
                parent: None,
                openness: sample_openness(&parameters.appearance, asset, stream),
            };
            (vec![object], false)
        }
        Chosen::Group(group) => {
            let turned = |object| turned_about(object, yaw_deg, centre_m);
            (group.objects.into_iter().map(turned).collect(), true)
        }
    };
    let margined = anchor.margined(rules, &floor, yaw_deg);
    Piece { place: anchor.place(), floor, margined, objects, is_group }
}

/// Turn a group's member about the group's middle and move it to its place.
fn turned_about(mut object: PlacedObject, yaw_deg: f64, centre_m: Vec2) -> PlacedObject {
    let [x, y, z] = rotate(&yaw_rotation(yaw_deg.to_radians()), object.position_m);
    object.position_m = [x + centre_m[0], y, z + centre_m[1]];
    object.rotation_deg[1] = (object.rotation_deg[1] + yaw_deg).rem_euclid(360.0);
    object
}

/// Draw the openness of an object; `None` if its category has none.
pub(in crate::house_generation) fn sample_openness(
    rules: &Appearance,
    asset: &Asset,
    stream: &mut Stream,
) -> Option<f64> {
    let weights = rules.openness.get(&asset.category).filter(|_| asset.is_openable)?;
    match stream.choose_weighted(weights) {
        Some(0) => Some(0.0),
        Some(1) => Some(1.0),
        _ => Some(stream.uniform()),
    }
}
