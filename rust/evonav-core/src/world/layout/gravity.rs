//! Let objects that hang in the air fall: the part of AI2-THOR's physics that ProcTHOR's generator
//! uses. The generator drops baseball bats from near the ceiling, a few degrees tilted, and reads
//! where they lie.

use crate::{
    Error,
    assets::{Catalogue, UnknownAssets, placement_rule::Place},
    geometry::{outline::overlap_m, polygon_contains},
    house::{House, HouseDelta},
    world::{
        layout::{
            Layout, Placement,
            contact::{TOUCH_M, bottom_m},
            rounding::{ROUND_M, round_to, turned_deg},
        },
        scene::Scene,
    },
};

/// Shortest fall: files have objects a few centimetres over their support.
const LEAST_FALL_M: f64 = 0.1;
/// Ratio of height to depth above which an object that lands tilted does not stand.
const SLENDER: f64 = 4.0;
/// Largest tilt of an upright object.
const ASKEW_DEG: f64 = 0.5;
/// Directions to tip over, relative to the object's heading, in the order in which they are tried.
const TURNS_DEG: [f64; 8] = [0.0, 180.0, 90.0, 270.0, 45.0, 135.0, 225.0, 315.0];

/// Return the places where all objects that hang in the air come to rest.
///
/// An object falls straight down onto the highest object under it. A slender and tilted one then
/// tips over its foot to a side that has room, along its heading first; all others stand. Fixed
/// (`kinematic`) objects and categories that hang on walls stay.
///
/// # Arguments
/// * `scene` - built from the same house.
///
/// # Errors
/// [`Error::House`] for an unknown asset, unless `unknown` allows it.
pub fn settled(
    house: &House,
    catalogue: &Catalogue,
    unknown: UnknownAssets,
    scene: &Scene,
) -> Result<HouseDelta, Error> {
    let mut layout = Layout::new(house, catalogue, unknown, scene.clone())?.with_file_positions();
    for (index, object) in house.objects.iter().enumerate() {
        let item = &layout.items[index];
        let rule = catalogue.placement(&item.asset.category);
        let is_hung = rule.is_some_and(|rule| rule.is_placed(Place::Wall));
        if object.is_kinematic || is_hung {
            continue;
        }
        let (support_m, _) = support(&layout, index, &item.placement);
        // Inside its parent it rests on something, perhaps a drawer that the shapes do not show.
        let parent_m = object.parent.map_or(f64::NEG_INFINITY, |parent| {
            layout.items[parent].solids.iter().fold(f64::NEG_INFINITY, |m, s| m.max(s.top_m))
        });
        if bottom_m(&item.solids) - support_m.max(parent_m) >= LEAST_FALL_M {
            layout.items[index].is_on_floor = false;
            let place = fallen(&layout, index);
            layout.put(index, place);
        }
    }
    Ok(layout.delta_from(house))
}

/// Return the first lying place that is clear and stable, or the standing place if there is none.
fn fallen(layout: &Layout, index: usize) -> Placement {
    let item = &layout.items[index];
    let Placement { position_m, rotation_deg: [x_deg, yaw_deg, z_deg], .. } = item.placement;
    let [width_m, height_m, depth_m] = item.asset.size_m;
    let signed = |angle: f64| (angle + 180.0).rem_euclid(360.0) - 180.0;
    let is_lying = height_m > SLENDER * width_m.max(depth_m)
        && [x_deg, z_deg].iter().any(|&angle| signed(angle).abs() > ASKEW_DEG);
    let standing = ([0.0, yaw_deg, 0.0], position_m);
    // A pitch of 90 degrees points the top along the heading.
    let lying = |turn_deg: &f64| {
        let heading_deg = turned_deg(yaw_deg + turn_deg);
        let (sin, cos) = heading_deg.to_radians().sin_cos();
        let [x, y, z] = position_m;
        let reach_m = 0.5 * height_m;
        let middle_m = [x + reach_m * sin, y, z + reach_m * cos];
        ([90.0, heading_deg, 0.0], middle_m.map(|value| round_to(value, ROUND_M)))
    };
    let turns: &[f64] = if is_lying { &TURNS_DEG } else { &[] };
    let rest = |(rotation_deg, position_m): ([f64; 3], [f64; 3])| {
        let mut place = Placement { position_m, rotation_deg, parent: None };
        let solids = item.solids_at(&place);
        let (support_m, bearer) = support(layout, index, &place);
        place.position_m[1] += support_m - bottom_m(&solids);
        place.position_m[1] = round_to(place.position_m[1], ROUND_M);
        place.parent = bearer.map(|bearer| bearer.index);
        (place, bearer.is_none_or(|bearer| bearer.is_central))
    };
    turns
        .iter()
        .map(lying)
        .map(rest)
        .find(|(place, is_stable)| *is_stable && layout.is_clear(&[(index, *place)]))
        .map_or_else(|| rest(standing).0, |(place, _)| place)
}

/// The object on which another one lands.
#[derive(Clone, Copy)]
struct Bearer {
    /// Index of the object.
    index: usize,
    /// Whether it is under the middle of the other one.
    is_central: bool,
}

/// Return the height to which an object at `place` falls, and the object on which it lands; `None`
/// for the floor.
fn support(layout: &Layout, index: usize, place: &Placement) -> (f64, Option<Bearer>) {
    let solids = layout.items[index].solids_at(place);
    let from_m = bottom_m(&solids);
    let family = layout.with_supported(index);
    let middle = [place.position_m[0], place.position_m[2]];
    let mut found: (f64, Option<Bearer>) = (0.0_f64.min(from_m), None);
    for (other, item) in layout.items.iter().enumerate().filter(|(i, _)| !family.contains(i)) {
        for solid in item.solids.iter().filter(|solid| solid.top_m <= from_m + TOUCH_M) {
            let is_central = polygon_contains(&solid.outline_m, middle);
            let is_higher = solid.top_m > found.0 + TOUCH_M;
            let is_better = is_central && solid.top_m > found.0 - TOUCH_M;
            let is_under =
                || solids.iter().any(|s| overlap_m(&s.outline_m, &solid.outline_m) > TOUCH_M);
            if (is_higher || is_better) && is_under() {
                let top_m = solid.top_m.max(found.0);
                found = (top_m, Some(Bearer { index: other, is_central }));
            }
        }
    }
    found
}
