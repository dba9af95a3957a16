//! AI2-THOR's `InitialRandomSpawn`: things that can be carried go to random free places.
//!
//! Order and number of tries are those of AI2-THOR's `PhysicsSceneManager` and
//! `InstantiatePrefabTest`: objects and receptacles in random order, and on each receptacle so many
//! points at four yaws each. Where a thing fits is this crate's own rule, `sample_surface_place`.

use serde::Deserialize;

use crate::{
    Error,
    assets::{Catalogue, UnknownAssets},
    geometry::{Vec2, polygon_area_m2, polygon_contains},
    house::{House, HouseDelta},
    rng::Stream,
    world::{
        layout::{Layout, Placement, rounding::round_to, surfaces::sample_surface_place},
        scene::Scene,
    },
};

/// Yaws that AI2-THOR tries at a point.
const NUM_YAWS: usize = 4;
/// Rounding of places on the floor.
const ROUND_M: f64 = 1e-4;

/// What to put where. Names are those of AI2-THOR's parameters, in our spelling.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpawnRequest {
    /// Of the random stream, which nothing else draws from.
    pub seed: u64,
    /// Objects to put; `None` for all that can be.
    #[serde(default)]
    pub object_ids: Option<Vec<String>>,
    /// Objects that stay.
    #[serde(default)]
    pub excluded_object_ids: Vec<String>,
    /// What to put them on; `None` for all on which their category was recorded.
    #[serde(default)]
    pub receptacle_ids: Option<Vec<String>>,
    /// Categories of which nothing is put on.
    #[serde(default)]
    pub excluded_receptacles: Vec<String>,
    /// Only on what stands open: nothing behind doors or lids.
    #[serde(default)]
    pub forces_visible: bool,
    /// The floors of rooms count as receptacles.
    #[serde(default)]
    pub allows_floor: bool,
    /// Also what can only be pushed.
    #[serde(default)]
    pub allows_moveable: bool,
    /// Points tried on a receptacle after the first.
    pub num_attempts: usize,
}

impl SpawnRequest {
    /// Reads a request.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] saying what is malformed, and where.
    pub fn from_json(json: &str) -> Result<Self, Error> {
        serde_json::from_str(json)
            .map_err(|error| Error::invalid("request", error, "a SpawnRequest"))
    }
}

/// What came of a request.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Spawned {
    /// Everything that found a place.
    pub delta: HouseDelta,
    /// Ids of those that found none, and stay where they are.
    pub unplaced: Vec<String>,
}

/// One place to try.
#[derive(Clone, Copy)]
enum Receptacle {
    Object(usize),
    Floor(usize),
}

/// Puts objects of `house` at random places.
///
/// # Arguments
/// * `scene` - built from the same house.
///
/// # Errors
/// [`Error::InvalidArgument`] for an object or receptacle that the house does not hold,
/// [`Error::House`] for an unknown asset, if `unknown` says so.
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
        // It is to be held to its parts, also where it stands on the floor now.
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
                for (member, place) in layout.carried(index, place) {
                    layout.put(member, place);
                }
            }
            None => unplaced.push(house.objects[index].id.clone()),
        }
    }
    Ok(Spawned { delta: layout.delta_from(house), unplaced })
}

/// What `index` may be put on.
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

/// Draws a place on the floor of a room; `None` where it touches something or stands in a doorway.
fn sample_floor_place(
    house: &House,
    layout: &Layout,
    index: usize,
    room: usize,
    stream: &mut Stream,
) -> Option<Placement> {
    let polygon_m = &house.rooms[room].polygon_m;
    let range = |axis: usize| {
        let values = polygon_m.iter().map(|corner| corner[axis]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
    };
    let [x, z] = [0, 1].map(|axis| {
        let [low, high] = range(axis);
        round_to(low + stream.uniform() * (high - low), ROUND_M)
    });
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
