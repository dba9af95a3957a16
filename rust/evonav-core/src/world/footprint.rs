//! The part of the ground plane that a body covers between two heights.

use crate::{
    assets::{Catalogue, UnknownAssets, part::Part},
    error::Error,
    geometry::{Vec2, Vec3, add, rotate},
    house::House,
    world::{
        mesh::{each_polygon, vertices_of},
        scene::Scene,
    },
};

/// Distance below which two points are merged.
const MERGE_M: f64 = 1e-9;

/// The part of a convex solid between two heights, projected to the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    /// Convex outline `[x, z]` with the interior on the left of each edge (x turns towards z);
    /// one point or two for solids that are thinner than a nanometre.
    pub outline_m: Vec<Vec2>,
    /// Lowest height of the solid inside the band.
    pub bottom_m: f64,
    /// Highest height of the solid inside the band.
    pub top_m: f64,
}

/// Project the slice of a part between the heights `low_m` and `high_m`; `None` if the slice is
/// empty.
///
/// The part is the polyhedron that is drawn, so that the agent collides with the shape that it
/// sees.
pub fn footprint(part: &Part, low_m: f64, high_m: f64) -> Option<Footprint> {
    let own = vertices_of(&part.primitive);
    let place = |corner: &Vec3| add(rotate(&part.rotation, *corner), part.centre_m);
    let corners: Vec<Vec3> = own.iter().map(place).collect();
    let mut shadow: Vec<Vec2> = Vec::with_capacity(corners.len());
    let (mut bottom_m, mut top_m) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut keep = |point: Vec3| {
        shadow.push([point[0], point[2]]);
        bottom_m = bottom_m.min(point[1]);
        top_m = top_m.max(point[1]);
    };
    for &corner in corners.iter().filter(|c| (low_m..=high_m).contains(&c[1])) {
        keep(corner);
    }
    // The band's faces cut the solid along polygons whose corners lie on its edges.
    let is_cut = |height: f64| {
        corners.iter().any(|c| c[1] < height) && corners.iter().any(|c| height <= c[1])
    };
    if is_cut(low_m) || is_cut(high_m) {
        each_polygon(&part.primitive, &own, |polygon| {
            for (k, &i) in polygon.iter().enumerate() {
                let b = corners[polygon[(k + 1) % polygon.len()] as usize];
                let a = corners[i as usize];
                for height in [low_m, high_m] {
                    // Each edge runs upwards in one of its two faces.
                    if a[1] < height && height <= b[1] {
                        let t = (height - a[1]) / (b[1] - a[1]);
                        keep([a[0] + t * (b[0] - a[0]), height, a[2] + t * (b[2] - a[2])]);
                    }
                }
            }
        });
    }
    (!shadow.is_empty()).then(|| Footprint { outline_m: convex_hull(shadow), bottom_m, top_m })
}

/// Return the footprints of every object of a house, part by part, as a drawing of the house shows
/// them.
///
/// # Returns
/// Category and footprints of each object, in [`House::objects`] order, at rest on its support.
///
/// # Errors
/// Those of [`Scene::build`].
pub fn object_footprints(
    house: &House,
    catalogue: &Catalogue,
    unknown: UnknownAssets,
) -> Result<Vec<(String, Vec<Footprint>)>, Error> {
    let scene = Scene::build(house, catalogue, unknown)?;
    let whole = |part: &Part| footprint(part, f64::NEG_INFINITY, f64::INFINITY);
    let objects = scene.bodies.into_iter().skip(scene.first_object);
    Ok(objects.map(|body| (body.category, body.parts.iter().filter_map(whole).collect())).collect())
}

/// Return the convex hull, counter-clockwise when x turns towards z, collinear points left out.
pub fn convex_hull(mut points: Vec<Vec2>) -> Vec<Vec2> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup_by(|a, b| (a[0] - b[0]).abs() < MERGE_M && (a[1] - b[1]).abs() < MERGE_M);
    if points.len() < 3 {
        return points;
    }
    let mut hull: Vec<Vec2> = Vec::with_capacity(points.len() + 1);
    for is_upper in [false, true] {
        let floor = hull.len() + 1;
        for i in 0..points.len() {
            let point = points[if is_upper { points.len() - 1 - i } else { i }];
            while hull.len() > floor && is_right_or_straight(&hull, point) {
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop(); // The last point of a chain is the first of the other.
    }
    hull
}

/// Return whether the hull turns right at its last point on the way to `point`, or left by less
/// than a nanometre.
fn is_right_or_straight(hull: &[Vec2], point: Vec2) -> bool {
    let [.., a, b] = hull else { return false };
    let along = [point[0] - a[0], point[1] - a[1]];
    let cross = along[0] * (b[1] - a[1]) - along[1] * (b[0] - a[0]);
    // Mostly the length, which takes longer than the rest, does not matter; it is less than twice
    // the sum.
    let clear = 2.0 * MERGE_M * (along[0].abs() + along[1].abs());
    cross >= 0.0 || (cross > -clear && cross >= -MERGE_M * along[0].hypot(along[1]))
}
