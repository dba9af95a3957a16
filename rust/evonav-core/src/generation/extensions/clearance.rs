//! Check that moved parts do not touch other bodies.

use crate::{
    assets::part::Part,
    geometry::outline::overlap_m,
    world::{
        footprint::{Footprint, footprint},
        layout::contact::TOUCH_M,
        scene::{BodyKind, Scene},
    },
};

/// Return whether the parts of a body that differ between `old` and `new` touch no other body. A
/// door's leaf may touch walls, since it hangs in one.
pub(crate) fn has_clearance(old: &Scene, new: &Scene, id: &str) -> bool {
    let Some(after) = new.bodies.iter().find(|body| body.id == id) else { return false };
    let before = old.bodies.iter().find(|body| body.id == id);
    let is_moved = |part: &&Part| before.is_none_or(|before| !before.parts.contains(part));
    let moved: Vec<Footprint> = after.parts.iter().filter(is_moved).filter_map(solid).collect();
    let is_obstacle = |kind: BodyKind| match kind {
        BodyKind::Floor | BodyKind::Ceiling => false,
        BodyKind::Object => true,
        BodyKind::Wall | BodyKind::Door | BodyKind::Window => after.kind != BodyKind::Door,
    };
    let others = new.bodies.iter().filter(|other| {
        other.id != id && is_obstacle(other.kind) && other.aabb.intersects(&after.aabb)
    });
    let others: Vec<Footprint> =
        others.flat_map(|other| other.parts.iter().filter_map(solid)).collect();
    let touch = |a: &Footprint, b: &Footprint| {
        a.top_m.min(b.top_m) - a.bottom_m.max(b.bottom_m) > TOUCH_M
            && overlap_m(&a.outline_m, &b.outline_m) > TOUCH_M
    };
    moved.iter().all(|part| others.iter().all(|other| !touch(part, other)))
}

fn solid(part: &Part) -> Option<Footprint> {
    footprint(part, f64::NEG_INFINITY, f64::INFINITY)
}
