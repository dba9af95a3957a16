//! Small objects on furniture (`small_objects` of the package `procthor`).

use crate::{
    assets::{Asset, Catalogue},
    house_generation::{
        interior::{Stock, sample_openness},
        objects::{HouseObject, Kind},
        parameters::{HouseParameters, SmallObjects},
        sampling::{beta, choose, happens},
        structure::Structure,
    },
    rng::Stream,
    world::layout::{Layout, surfaces::spawn_on_surface},
};

/// Height at which objects wait for their place: no house reaches it.
const WAITING_M: f64 = -20.0;

/// Draw the small objects that are to be placed, in the order in which they are.
///
/// They are listed below the house, with their future support as `parent`; [`place`] puts them
/// where they fit.
pub(super) fn sample(
    parameters: &HouseParameters,
    stock: &Stock,
    structure: &Structure,
    objects: &[HouseObject],
    stream: &mut Stream,
) -> Vec<HouseObject> {
    let rules = &parameters.small_objects;
    let [low, high] = rules.house_bias;
    let house_bias = low + (high - low) * beta(stream, rules.house_bias_beta);
    let mut waiting = Vec::new();
    for (room, planned) in structure.rooms.iter().enumerate() {
        let mut drawn = Vec::new();
        for (index, receptacle) in objects.iter().enumerate() {
            if receptacle.room == room && !receptacle.asset.surfaces_m.is_empty() {
                let on = &receptacle.asset.category;
                let wanted = wanted_on(rules, stock, &planned.room_type, on, house_bias, stream);
                drawn.extend(wanted.into_iter().map(|(category, p)| (index, category, p)));
            }
        }
        stream.shuffle(&mut drawn);
        for (receptacle, category, probability) in drawn {
            let mut count = 1;
            while count < rules.max_of_category && happens(stream, probability) {
                count += 1;
            }
            let small = small_assets(rules, stock, category);
            for _ in 0..count {
                let Some(&asset) = choose(stream, &small) else { continue };
                waiting.push(HouseObject {
                    id: format!("small|{}|{}", planned.number, waiting.len()),
                    asset,
                    kind: Kind::Small,
                    room,
                    position_m: [0.0, WAITING_M, 0.0],
                    rotation_deg: [0.0; 3],
                    parent: Some(receptacle),
                    openness: sample_openness(&parameters.appearance, asset, stream),
                    is_on: None,
                    is_dirty: None,
                });
            }
        }
    }
    waiting
}

/// Draw the categories that are put on a receptacle, with the probability of each.
fn wanted_on(
    rules: &SmallObjects,
    stock: &Stock,
    room_type: &str,
    receptacle: &str,
    house_bias: f64,
    stream: &mut Stream,
) -> Vec<(&'static str, f64)> {
    let catalogue = Catalogue::bundled();
    let receptacle_bias = rules.receptacle_biases.get(receptacle);
    let receptacle_bias = receptacle_bias.copied().unwrap_or(rules.receptacle_bias);
    let on_it = stock.categories.iter().filter_map(|(&category, facts)| {
        let probability = catalogue.rest_probability(category, receptacle);
        // `InitialRandomSpawn` leaves what is fixed, such as taps, where it is.
        let is_used =
            probability > 0.0 && facts.is_movable && facts.rule.room_weight(room_type) > 0.0;
        is_used.then_some((category, probability))
    });
    let happening = on_it.filter(|(category, probability)| {
        let own_bias = rules.object_biases.get(*category).copied().unwrap_or(0.0);
        happens(stream, probability + receptacle_bias + own_bias + house_bias)
    });
    happening.collect()
}

/// Return the assets of a category that are small enough.
fn small_assets(rules: &SmallObjects, stock: &Stock, category: &str) -> Vec<&'static Asset> {
    let most_m = rules.max_heights_m.get(category).copied().unwrap_or(f64::INFINITY);
    let assets = stock.categories.get(category).map_or(&[][..], |it| &it.assets);
    assets.iter().filter(|asset| asset.size_m[1] < most_m).copied().collect()
}

/// Put waiting objects on their receptacles, and drop those that find no place.
///
/// # Arguments
/// * `objects` - all objects of the house; the waiting ones come last.
/// * `layout` - layout of these objects.
pub(super) fn place(
    rules: &SmallObjects,
    structure: &Structure,
    objects: &mut Vec<HouseObject>,
    layout: &mut Layout,
    stream: &mut Stream,
) {
    let catalogue = Catalogue::bundled();
    let mut num_placed = 0;
    let mut is_placed: Vec<bool> = objects.iter().map(|it| it.kind != Kind::Small).collect();
    for index in 0..objects.len() {
        let Some(receptacle) = objects[index].parent.filter(|_| !is_placed[index]) else {
            continue;
        };
        let (room, category) = (objects[index].room, &objects[index].asset.category);
        let is_single = catalogue.placement(category).is_some_and(|rule| !rule.multiple_per_room);
        let has_one = (0..objects.len()).any(|i| {
            is_placed[i] && objects[i].room == room && objects[i].asset.category == *category
        });
        if is_single && has_one {
            continue;
        }
        let place = spawn_on_surface(layout, index, receptacle, rules.num_points, stream);
        if let Some(place) = place {
            layout.put(index, place);
            let object = &mut objects[index];
            object.id = format!("small|{}|{num_placed}", structure.rooms[room].number);
            object.position_m = place.position_m;
            object.rotation_deg = place.rotation_deg;
            is_placed[index] = true;
            num_placed += 1;
        }
    }
    // Small objects are the last ones, and nothing stands on them.
    let mut flags = is_placed.into_iter();
    objects.retain(|_| flags.next().unwrap_or(false));
}
