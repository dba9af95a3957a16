//! AI2-THOR's `InitialRandomSpawn`: put pickupable objects at random free places.
//!
//! The order and the number of tries are those of AI2-THOR's `PhysicsSceneManager` and
//! `InstantiatePrefabTest`: objects and receptacles in random order, and on each receptacle a
//! number of points with four yaws each. Whether an object fits is decided by this crate's own
//! rule, `sample_surface_place`.

use serde::Deserialize;

use crate::{
    Error,
    assets::{Catalogue, UnknownAssets},
    geometry::{Vec2, bounds_2d_m, polygon_area_m2, polygon_contains},
    house::{House, HouseDelta},
    rng::Stream,
    world::{
        layout::{
            Layout, Placement,
            rounding::{ROUND_M, round_to},
            surfaces::sample_surface_place,
        },
        scene::Scene,
    },
};

/// Yaws that AI2-THOR tries at a point.
const NUM_YAWS: usize = 4;
/// Largest number of points tried on a receptacle after the first; AI2-THOR's default is 5.
const MAX_ATTEMPTS: usize = 1000;

/// Parameters of a random spawn. The names are those of AI2-THOR's parameters in snake case.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpawnRequest {
    /// Seed of the random stream, which is used for nothing else.
    pub seed: u64,
    /// Ids of the objects to move; `None` for all that can be moved.
    #[serde(default)]
    pub object_ids: Option<Vec<String>>,
    /// Ids of objects that stay.
    #[serde(default)]
    pub excluded_object_ids: Vec<String>,
    /// Ids of the receptacles to use; `None` for all on which an object's category was recorded.
    #[serde(default)]
    pub receptacle_ids: Option<Vec<String>>,
    /// Categories of receptacles that are not used.
    #[serde(default)]
    pub excluded_receptacles: Vec<String>,
    /// Whether only receptacles without doors or lids are used.
    #[serde(default)]
    pub forces_visible: bool,
    /// Whether the floors of rooms count as receptacles.
    #[serde(default)]
    pub allows_floor: bool,
    /// Whether objects that can only be pushed are moved too.
    #[serde(default)]
    pub allows_moveable: bool,
    /// Number of points tried on a receptacle after the first.
    pub num_attempts: usize,
}

impl SpawnRequest {
    /// Read a request.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] saying what is malformed, and where.
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let found: Self = serde_json::from_str(json)
            .map_err(|error| Error::invalid("request", error, "a SpawnRequest"))?;
        let is_count = |num: usize| num <= MAX_ATTEMPTS;
        Error::require("num_attempts", found.num_attempts, "at most 1000", is_count)?;
        Ok(found)
    }
}

/// The result of a random spawn.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Spawned {
    /// Moves of the objects that found a place.
    pub delta: HouseDelta,
    /// Ids of the objects that found no place and stay where they are.
    pub unplaced: Vec<String>,
}

/// A receptacle: an object or the floor of a room, by index.
#[derive(Clone, Copy)]
enum Receptacle {
    Object(usize),
    Floor(usize),
}

/// Put objects of `house` at random places.
///
/// # Arguments
/// * `scene` - built from the same house.
///
/// # Errors
/// [`Error::InvalidArgument`] for an object or receptacle that is not in the house,
/// [`Error::House`] for an unknown asset, unless `unknown` allows it.
pub fn random_spawn(
    house: &House,
    catalogue: &Catalogue,
    unknown: UnknownAssets,
    scene: &Scene,
    request: &SpawnRequest,
) -> Result<Spawned, Error> {
    let find = |name: &str, id: &String| {
        let missing = || Error::invalid(name, id, "an object of the house");
        house.object_index(id).ok_or_else(missing)
    };
    let find_all = |name: &str, ids: &[String]| {
        ids.iter().map(|id| find(name, id)).collect::<Result<Vec<_>, _>>()
    };
    let mut layout = Layout::new(house, catalogue, unknown, scene.clone())?;
    let excluded = find_all("excluded_object_ids", &request.excluded_object_ids)?;
    let can_go = |&index: &usize| {
        let asset = &layout.items[index].asset;
        (asset.is_pickupable || (request.allows_moveable && asset.is_moveable))
            && !excluded.contains(&index)
    };
    let mut order = match &request.object_ids {
        Some(ids) => find_all("object_ids", ids)?,
        None => (0..layout.items.len()).collect(),
    };
    order.retain(can_go);
    order.sort_unstable();
    order.dedup();
    let named = request.receptacle_ids.as_ref();
    let named = named.map(|ids| find_all("receptacle_ids", ids)).transpose()?;
    let mut stream = Stream::new(request.seed, &["initial random spawn"]);
    stream.shuffle(&mut order);
    let mut unplaced = Vec::new();
    for &index in &order {
        // Its parts are compared one by one, also if it stands on the floor now.
        layout.items[index].is_on_floor = false;
        let mut receptacles =
            receptacles_of(house, catalogue, &layout, request, named.as_deref(), index);
        stream.shuffle(&mut receptacles);
        let num_draws = NUM_YAWS.saturating_mul(request.num_attempts.saturating_add(1));
        let place = receptacles.iter().find_map(|&receptacle| {
            (0..num_draws).find_map(|_| match receptacle {
                Receptacle::Object(on) => {
                    sample_surface_place(&layout, index, &[on], 0.0, &mut stream)
                }
                Receptacle::Floor(room) => {
                    sample_floor_place(house, &layout, index, room, &mut stream)
                }
            })
        });
        match place {
            Some(place) => {
                for (member, place) in layout.carry(index, place) {
                    layout.put(member, place);
                }
            }
            None => unplaced.push(house.objects[index].id.clone()),
        }
    }
    Ok(Spawned { delta: layout.delta_from(house), unplaced })
}

/// Return the receptacles on which object `index` may be put.
fn receptacles_of(
    house: &House,
    catalogue: &Catalogue,
    layout: &Layout,
    request: &SpawnRequest,
    named: Option<&[usize]>,
    index: usize,
) -> Vec<Receptacle> {
    let category = &layout.items[index].asset.category;
    let own = layout.with_supported(index);
    let can_bear = |&other: &usize| {
        let asset = &layout.items[other].asset;
        let is_barred = own.contains(&other)
            || request.excluded_receptacles.contains(&asset.category)
            || (request.forces_visible && asset.is_openable);
        !is_barred && !asset.surfaces_m.is_empty()
    };
    let fits_category = |&other: &usize| {
        let asset = &layout.items[other].asset;
        !asset.is_pickupable && catalogue.can_rest_on(category, &asset.category)
    };
    let objects: Vec<usize> = match named {
        Some(named) => named.iter().copied().filter(can_bear).collect(),
        None => (0..layout.items.len()).filter(can_bear).filter(fits_category).collect(),
    };
    let floors = if request.allows_floor && named.is_none() { house.rooms.len() } else { 0 };
    let objects = objects.into_iter().map(Receptacle::Object);
    objects.chain((0..floors).map(Receptacle::Floor)).collect()
}

/// Draw a place on the floor of a room; `None` if the object would touch another one or stand in a
/// doorway.
fn sample_floor_place(
    house: &House,
    layout: &Layout,
    index: usize,
    room: usize,
    stream: &mut Stream,
) -> Option<Placement> {
    let polygon_m = &house.rooms[room].polygon_m;
    let [low, high] = bounds_2d_m(polygon_m.iter().copied());
    let [x, z] = [0, 1]
        .map(|axis| round_to(low[axis] + stream.uniform() * (high[axis] - low[axis]), ROUND_M));
    let item = &layout.items[index];
    let [x_deg, _, z_deg] = item.placement.rotation_deg;
    let rise_m = item.rise_m();
    let place = Placement {
        position_m: [x, round_to(rise_m, ROUND_M), z],
        rotation_deg: [x_deg, 90.0 * stream.below(NUM_YAWS) as f64, z_deg],
        parent: None,
    };
    let is_inside = |p: &Vec2| polygon_contains(polygon_m, *p);
    let solids = item.solids_at(&place);
    let is_valid = polygon_area_m2(polygon_m).abs() > 0.0
        && solids.iter().all(|solid| solid.outline_m.iter().all(is_inside))
        && layout.is_clear(&[(index, place)]);
    is_valid.then_some(place)
}
