//! Contact of shapes: overlap of their outlines and of their heights.

use crate::{
    geometry::{Aabb, outline::overlap_m},
    world::footprint::Footprint,
};

/// Largest overlap of outlines or heights that counts as touching; recorded houses have overlaps up
/// to this.
pub const TOUCH_M: f64 = 0.002;

/// Return whether two shapes overlap by more than a touch.
pub fn overlap(a: &[Footprint], b: &[Footprint]) -> bool {
    a.iter().any(|a| b.iter().any(|b| collide(a, b, 0.0)))
}

/// Return whether two solids overlap by more than a touch, or are nearer than `gap_m` in plan while
/// their heights overlap.
pub(super) fn collide(a: &Footprint, b: &Footprint, gap_m: f64) -> bool {
    a.top_m.min(b.top_m) - a.bottom_m.max(b.bottom_m) > TOUCH_M
        && overlap_m(&a.outline_m, &b.outline_m) > TOUCH_M - gap_m
}

/// Return the lowest height of some solids.
pub fn bottom_m(solids: &[Footprint]) -> f64 {
    solids.iter().map(|solid| solid.bottom_m).fold(f64::INFINITY, f64::min)
}

/// Return the box around some solids.
pub fn box_of(solids: &[Footprint]) -> Aabb {
    Aabb::of_points(solids.iter().flat_map(|solid| {
        solid
            .outline_m
            .iter()
            .flat_map(|p| [[p[0], solid.bottom_m, p[1]], [p[0], solid.top_m, p[1]]])
    }))
}
