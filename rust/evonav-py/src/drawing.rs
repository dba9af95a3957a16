//! `evonav_core::drawing`. Shapes and units: `_core.pyi`.

use evonav_core::drawing::{label_point, outline};
use pyo3::prelude::*;

/// Return path data of closed polygons.
#[pyfunction]
pub fn outlines(polygons_m: Vec<Vec<[f64; 2]>>) -> Vec<String> {
    polygons_m.iter().map(|polygon_m| outline::outline(polygon_m)).collect()
}

/// Return where in a polygon a label stands best.
#[pyfunction]
#[pyo3(name = "label_point", signature = (polygon_m, num, *, taken_m, size_m))]
pub fn best_label_point(
    polygon_m: Vec<[f64; 2]>,
    num: usize,
    taken_m: Vec<[f64; 4]>,
    size_m: [f64; 2],
) -> (f64, f64) {
    label_point::label_point(&polygon_m, num, &taken_m, size_m).into()
}
