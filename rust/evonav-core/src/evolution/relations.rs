//! What an instruction may say of a target's surroundings (paper, Sec. A.4).

use super::{
    layout::{Item, Layout, bottom_m},
    plan::gap_m,
    record::Relations,
};
use crate::{
    geometry::Vec2,
    house::House,
    world::{footprint::convex_hull, scene::BodyKind},
};

/// Gap in plan up to which things are next to each other.
const NEXT_TO_M: f64 = 0.5;
/// Gap in plan up to which a door or window is near.
const STRUCTURE_M: f64 = 1.0;
/// Gap in plan up to which something on a wall is near; the paper names thresholds, not values.
const WALL_OBJECT_M: f64 = 1.0;
/// Gap in plan up to which something is below another.
const BELOW_M: f64 = 0.3;
/// Nearby anchors kept (paper, Sec. A.4).
const MAX_NEIGHBOURS: usize = 2;

/// Relations of object `index` to support, neighbours, doors or windows, and things on the wall.
///
/// Anchors are of other categories than the target, each category once: an instruction names
/// categories only.
pub fn relations_of(house: &House, layout: &Layout, index: usize) -> Relations {
    let target = &layout.items[index];
    let room = house.objects[index].room;
    let outline = outline_of(target);
    let category = &target.asset.category;
    let is_category_unique =
        layout.items.iter().filter(|item| item.asset.category == *category).count() == 1;
    let support = target.placement.parent;
    let others = || {
        let in_room = |&(i, _): &(usize, &Item)| i != index && house.objects[i].room == room;
        layout.items.iter().enumerate().filter(in_room)
    };
    // On a support its company there is what is next to it; on the floor other furniture.
    let mut neighbours: Vec<(f64, &str)> = others()
        .filter(|(_, item)| match support {
            Some(_) => item.placement.parent == support,
            None => item.is_on_floor && target.is_on_floor,
        })
        .map(|(_, item)| (gap_m(&outline, &outline_of(item)), item.asset.category.as_str()))
        .filter(|&(gap, other)| gap < NEXT_TO_M && other != category)
        .collect();
    neighbours.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(b.1)));
    let mut kept: Vec<String> = Vec::new();
    for (_, other) in neighbours {
        if kept.len() < MAX_NEIGHBOURS && !kept.iter().any(|k| k == other) {
            kept.push(other.to_owned());
        }
    }
    let wall_object = others()
        .filter(|(_, item)| item.is_hung() && !target.is_hung() && item.asset.category != *category)
        .map(|(_, item)| (gap_m(&outline, &outline_of(item)), item))
        .filter(|(gap, _)| *gap < WALL_OBJECT_M)
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let top_m = target.solids.iter().map(|solid| solid.top_m).fold(f64::NEG_INFINITY, f64::max);
    let is_below = wall_object
        .as_ref()
        .is_some_and(|(gap, item)| *gap < BELOW_M && bottom_m(&item.solids) >= top_m);
    Relations {
        room_type: room.map_or_else(String::new, |room| house.rooms[room].room_type.clone()),
        is_category_unique,
        support: support.map(|parent| layout.items[parent].asset.category.clone()),
        neighbours: kept,
        structure: structure_near(house, layout, room, &outline),
        wall_object: wall_object.map(|(_, item)| item.asset.category.clone()),
        is_below_wall_object: is_below,
    }
}

/// The nearest door or window of the room.
fn structure_near(
    house: &House,
    layout: &Layout,
    room: Option<usize>,
    outline: &[Vec2],
) -> Option<String> {
    let room_id = &house.rooms.get(room?)?.id;
    let openings = house.doors.iter().chain(&house.windows);
    let of_room: Vec<&str> = openings
        .filter(|opening| opening.room_ids.contains(room_id))
        .map(|opening| opening.id.as_str())
        .collect();
    let fixed = &layout.scene.bodies[..layout.scene.first_object.min(layout.scene.bodies.len())];
    fixed
        .iter()
        .filter(|body| of_room.contains(&body.id.as_str()) && !body.parts.is_empty())
        .filter_map(|body| {
            let name = match body.kind {
                BodyKind::Door => "doorway",
                BodyKind::Window => "window",
                _ => return None,
            };
            let (low, high) = (body.aabb.min_m, body.aabb.max_m);
            let corners =
                [[low[0], low[2]], [high[0], low[2]], [high[0], high[2]], [low[0], high[2]]];
            Some((gap_m(outline, &corners), name))
        })
        .filter(|(gap, _)| *gap < STRUCTURE_M)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name.to_owned())
}

/// Plan outline of a whole object.
fn outline_of(item: &Item) -> Vec<Vec2> {
    convex_hull(item.solids.iter().flat_map(|solid| solid.outline_m.iter().copied()).collect())
}
