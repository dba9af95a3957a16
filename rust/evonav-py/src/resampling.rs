//! `evonav_core::resampling`. Shapes: `_core.pyi`.

use evonav_core::resampling::{self, Pcg64};
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::arrays;

type Counts<'py> = Bound<'py, PyArray2<u8>>;

/// Draw how often each cluster is in resamples, and return the state of the stream behind them.
#[pyfunction]
#[pyo3(signature = (state, increment, *, num_clusters, num_resamples))]
pub fn draw_counts(
    py: Python<'_>,
    state: u128,
    increment: u128,
    num_clusters: usize,
    num_resamples: usize,
) -> PyResult<(Counts<'_>, u128)> {
    let mut source = Pcg64 { state, increment };
    let mut counts = vec![0; num_clusters * num_resamples];
    py.detach(|| resampling::draw_counts(&mut source, &mut counts, num_clusters));
    Ok((arrays::image_of(py, counts, [num_resamples, num_clusters])?, source.state))
}
