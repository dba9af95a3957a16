//! Objects from above, as drawings of a house show them.

use crate::{
    assets::{Catalogue, UnknownAssets},
    error::Error,
    geometry::{Vec2, Vec3},
    house::House,
    world::footprint::{Footprint, object_footprints},
};

/// An object from above.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectOutlines {
    /// Id of the object.
    pub id: String,
    /// Category of its asset.
    pub category: String,
    /// Centre of its axis-aligned box.
    pub centre_m: Vec3,
    /// Size of this box.
    pub size_m: Vec3,
    /// Corners of this box, to the millimetre.
    pub corners_m: [Vec2; 4],
    /// Convex outlines of its parts to the millimetre, each once, lower parts first.
    pub outlines_m: Vec<Vec<Vec2>>,
}

/// Return the outlines of a house's objects in [`House::objects`] order, without those that have no
/// parts.
///
/// # Errors
/// Those of [`object_footprints`].
pub fn object_outlines(
    house: &House,
    catalogue: &Catalogue,
    unknown: UnknownAssets,
) -> Result<Vec<ObjectOutlines>, Error> {
    let found = object_footprints(house, catalogue, unknown)?;
    let objects = house.objects.iter().zip(found);
    Ok(objects
        .filter(|(_, (_, parts))| !parts.is_empty())
        .map(|(object, (category, parts))| outlines(object.id.clone(), category, parts))
        .collect())
}

fn outlines(id: String, category: String, mut parts: Vec<Footprint>) -> ObjectOutlines {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    // Of -0 and 0, `f64::min` may return either.
    let mut extend = |axis: usize, from_m: f64, to_m: f64| {
        low[axis] = if from_m < low[axis] { from_m } else { low[axis] };
        high[axis] = if to_m > high[axis] { to_m } else { high[axis] };
    };
    for part in &parts {
        extend(1, part.bottom_m, part.top_m);
        for &[x, z] in &part.outline_m {
            extend(0, x, x);
            extend(2, z, z);
        }
    }
    parts.sort_by(|a, b| a.top_m.total_cmp(&b.top_m));
    let mut outlines_m: Vec<Vec<Vec2>> = Vec::with_capacity(parts.len());
    for part in parts {
        let outline_m = part.outline_m.iter().map(|point| point.map(round_mm)).collect();
        if !outlines_m.contains(&outline_m) {
            outlines_m.push(outline_m);
        }
    }
    let ([x0, _, z0], [x1, _, z1]) = (low, high);
    ObjectOutlines {
        id,
        category,
        centre_m: std::array::from_fn(|axis| (low[axis] + high[axis]) / 2.0),
        size_m: std::array::from_fn(|axis| high[axis] - low[axis]),
        corners_m: [[x0, z0], [x1, z0], [x1, z1], [x0, z1]].map(|point| point.map(round_mm)),
        outlines_m,
    }
}

/// Round metres to the millimetre as decimal text does: the nearest, of two as near the even one.
pub fn round_mm(value_m: f64) -> f64 {
    let scaled = value_m * 1e3;
    let even = scaled.round_ties_even();
    let is_tie = (scaled - even).abs() == 0.5;
    // A product at a tie may have been rounded to it; what was lost decides.
    let lost = if is_tie { value_m.mul_add(1e3, -scaled) } else { 0.0 };
    let nearest = match lost {
        _ if lost > 0.0 => scaled.ceil(),
        _ if lost < 0.0 => scaled.floor(),
        _ => even,
    };
    nearest / 1e3
}
