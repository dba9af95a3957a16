//! Places for small objects on the surfaces of receptacles.

use crate::{
    assets::Catalogue,
    geometry::{Vec2, Vec3, add, outline::overlap_m, polygon_contains, rotate, yaw_rotation},
    rng::Stream,
    world::{
        footprint::convex_hull,
        layout::{
            Item, Layout, Placement,
            contact::{TOUCH_M, bottom_m},
            rounding::{ROUND_M, round_to, turned_deg},
        },
    },
};

/// Share of a small object's outline, about its middle, that must lie over its support.
const SUPPORTED_SHARE: f64 = 0.8;
/// Largest height difference between a recorded surface and the top of the part that bears it.
const SURFACE_M: f64 = 0.02;
/// Largest height difference between parts that bear one object.
const LEVEL_M: f64 = 0.003;

/// Number of yaws at a point.
const NUM_YAWS: usize = 4;
/// Number of draws of a point on a surface that covers a part of its receptacle's box, such as the
/// tank of a toilet.
const POINT_DRAWS: usize = 20;

/// Categories that are part of their support and move with it.
pub const FITTINGS: [&str; 3] = ["Faucet", "ShowerHead", "Sink"];

/// Return whether an object never leaves its support.
pub fn is_fitting(item: &Item) -> bool {
    FITTINGS.contains(&item.asset.category.as_str())
}

/// Return the receptacles among `room_items` on which an object may stand, and how often its
/// category was recorded on each receptacle's category (`receptacles.json` of the `procthor`
/// package).
pub fn receptacles_for(
    layout: &Layout,
    catalogue: &Catalogue,
    index: usize,
    room_items: &[usize],
) -> (Vec<usize>, Vec<f64>) {
    let category = &layout.items[index].asset.category;
    let can_bear = |&other: &usize| {
        let receptacle = &layout.items[other];
        receptacle.is_on_floor
            && !receptacle.asset.surfaces_m.is_empty()
            && catalogue.can_rest_on(category, &receptacle.asset.category)
    };
    let found: Vec<usize> =
        room_items.iter().copied().filter(|other| *other != index).filter(can_bear).collect();
    let share =
        |&on: &usize| catalogue.rest_probability(category, &layout.items[on].asset.category);
    let weights = found.iter().map(share).collect();
    (found, weights)
}

/// Draw a place for one small object on one of `receptacles`; `None` if the object would overhang,
/// touch another one, or stay where it already is (within `min_move_m`).
pub fn sample_surface_place(
    layout: &Layout,
    index: usize,
    receptacles: &[usize],
    min_move_m: f64,
    stream: &mut Stream,
) -> Option<Placement> {
    let receptacle = *receptacles.get(stream.below(receptacles.len()))?;
    let point_m = sample_surface_point(layout, receptacle, stream)?;
    let quarter_turns = stream.below(NUM_YAWS);
    surface_place(layout, index, receptacle, point_m, quarter_turns, SUPPORTED_SHARE, min_move_m)
}

/// Draw a place for one small object as AI2-THOR's `InitialRandomSpawn` does: at each of
/// `num_points` points on the receptacle in turn, with each of four yaws, and with all corners over
/// it; `None` if it fits nowhere.
pub fn spawn_on_surface(
    layout: &Layout,
    index: usize,
    receptacle: usize,
    num_points: usize,
    stream: &mut Stream,
) -> Option<Placement> {
    let solids = &layout.items[receptacle].solids;
    let is_borne = |&[x, height_m, z]: &Vec3| {
        let mut level = solids.iter().filter(|solid| (solid.top_m - height_m).abs() < SURFACE_M);
        level.any(|solid| polygon_contains(&solid.outline_m, [x, z]))
    };
    (0..num_points).find_map(|_| {
        let mut points =
            (0..POINT_DRAWS).map_while(|_| sample_surface_point(layout, receptacle, stream));
        let point_m = points.find(is_borne)?;
        let first = stream.below(NUM_YAWS);
        (first..first + NUM_YAWS)
            .find_map(|turns| surface_place(layout, index, receptacle, point_m, turns, 1.0, 0.0))
    })
}

/// Draw a point over the box of a receptacle, at the height of one of its surfaces; `None` if it
/// has no surface.
fn sample_surface_point(layout: &Layout, receptacle: usize, stream: &mut Stream) -> Option<Vec3> {
    let receptacle = &layout.items[receptacle];
    let surfaces = &receptacle.asset.surfaces_m;
    let height_m = bottom_m(&receptacle.solids) + surfaces.get(stream.below(surfaces.len()))?;
    let yaw_deg = receptacle.placement.rotation_deg[1];
    let [size_x, _, size_z] = receptacle.asset.size_m;
    let local = [(stream.uniform() - 0.5) * size_x, 0.0, (stream.uniform() - 0.5) * size_z];
    let [x, _, z] =
        add(rotate(&yaw_rotation(yaw_deg.to_radians()), local), receptacle.placement.position_m);
    Some([x, height_m, z])
}

/// Return the place of an object over a point of a receptacle's surface; `None` if it would
/// overhang, touch another object, or stay where it already is.
///
/// # Arguments
/// * `quarter_turns` - its yaw from that of the receptacle.
/// * `supported_share` - share of its outline, about its middle, that must lie over the surface.
fn surface_place(
    layout: &Layout,
    index: usize,
    receptacle_index: usize,
    [x, height_m, z]: Vec3,
    quarter_turns: usize,
    supported_share: f64,
    min_move_m: f64,
) -> Option<Placement> {
    let (item, receptacle) = (&layout.items[index], &layout.items[receptacle_index]);
    let yaw_deg = receptacle.placement.rotation_deg[1] + 90.0 * quarter_turns as f64;
    let rise_m = item.rise_m();
    let [x_deg, _, z_deg] = item.placement.rotation_deg;
    let mut place = Placement {
        position_m: [x, height_m + rise_m, z].map(|value| round_to(value, ROUND_M)),
        rotation_deg: [x_deg, turned_deg(yaw_deg), z_deg],
        parent: Some(receptacle_index),
    };
    let moved_m: f64 = (0..3)
        .map(|i| (place.position_m[i] - item.placement.position_m[i]).powi(2))
        .sum::<f64>()
        .sqrt();
    if item.placement.parent == place.parent && moved_m <= min_move_m {
        return None;
    }
    let solids = item.solids_at(&place);
    let outline = convex_hull(solids.iter().flat_map(|s| s.outline_m.iter().copied()).collect());
    // The parts under it may end a little above or below the recorded height.
    let bearing: Vec<_> = receptacle
        .solids
        .iter()
        .filter(|solid| (solid.top_m - height_m).abs() < SURFACE_M)
        .filter(|solid| overlap_m(&solid.outline_m, &outline) > TOUCH_M)
        .collect();
    let top_m = bearing.iter().map(|solid| solid.top_m).fold(f64::NEG_INFINITY, f64::max);
    if !top_m.is_finite() {
        return None;
    }
    place.position_m[1] = round_to(top_m + rise_m, ROUND_M);
    // The object stands level: no part under it is higher than the parts under its middle and its
    // corners.
    let is_borne = |p: Vec2| {
        let mut level = bearing.iter().filter(|solid| top_m - solid.top_m < LEVEL_M);
        level.any(|solid| polygon_contains(&solid.outline_m, p))
    };
    let shrunk = |p: &Vec2| {
        [0, 1].map(|i| {
            let middle = place.position_m[2 * i];
            middle + supported_share * (p[i] - middle)
        })
    };
    let is_valid = is_borne([place.position_m[0], place.position_m[2]])
        && outline.iter().map(shrunk).all(is_borne)
        && layout.is_clear(&[(index, place)]);
    is_valid.then_some(place)
}
