//! When shapes touch: overlap of their outlines and of their heights.

use crate::{
    geometry::{Aabb, outline::overlap_m},
    world::footprint::Footprint,
};

/// Overlap in plan or height that counts as touching: recorded houses have as much.
pub const TOUCH_M: f64 = 0.002;

/// Whether two shapes share more than a touch.
pub fn overlap(a: &[Footprint], b: &[Footprint]) -> bool {
    a.iter().any(|a| b.iter().any(|b| collide(a, b, 0.0)))
}

/// Whether two solids share more than a touch, `gap_m` apart or nearer in plan.
pub(super) fn collide(a: &Footprint, b: &Footprint, gap_m: f64) -> bool {
    a.top_m.min(b.top_m) - a.bottom_m.max(b.bottom_m) > TOUCH_M
        && overlap_m(&a.outline_m, &b.outline_m) > TOUCH_M - gap_m
}

/// Lowest height of solids.
pub fn bottom_m(solids: &[Footprint]) -> f64 {
    solids.iter().map(|solid| solid.bottom_m).fold(f64::INFINITY, f64::min)
}

/// Box around solids.
pub fn box_of(solids: &[Footprint]) -> Aabb {
    Aabb::of_points(solids.iter().flat_map(|solid| {
        solid
            .outline_m
            .iter()
            .flat_map(|p| [[p[0], solid.bottom_m, p[1]], [p[0], solid.top_m, p[1]]])
    }))
}
