//! `evonav_core::memory`. Shapes, units and errors: `_core.pyi`.

use std::sync::Arc;

use evonav_core::{
    grid::GridSpec,
    memory::{
        frontiers::{self, FrontierConfig, Frontiers},
        occupancy,
    },
    sensors::visible_cells::VisibleCells,
};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::{arrays, error};

type Cells<'py> = Bound<'py, PyArray2<i32>>;

/// A frontier: a place from which to explore.
#[pyclass(frozen, module = "evonav._core")]
pub struct Frontier(Arc<frontiers::Frontier>);

#[pymethods]
impl Frontier {
    fn __repr__(&self) -> String {
        let ([x, z], num_cells) = (self.0.position_m, self.0.cells.len());
        format!("Frontier(id={}, position_m=({x:.2}, {z:.2}), num_cells={num_cells})", self.0.id)
    }

    #[getter]
    fn id(&self) -> u64 {
        self.0.id
    }

    #[getter]
    fn position_m(&self) -> (f64, f64) {
        self.0.position_m.into()
    }

    #[getter]
    fn direction_rad(&self) -> f64 {
        self.0.direction_rad
    }

    #[getter]
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Cells<'py>> {
        arrays::rows_of(py, self.0.cells.clone())
    }
}

/// The agent's occupancy map with its frontiers.
#[pyclass(module = "evonav._core")]
pub struct OccupancyMap {
    map: occupancy::OccupancyMap,
    frontiers: Frontiers,
    config: FrontierConfig,
}

#[pymethods]
impl OccupancyMap {
    #[new]
    fn new(map_frame: &Bound<'_, PyAny>, config: &Bound<'_, PyAny>) -> PyResult<Self> {
        let spec = arrays::from_attributes!(map_frame, GridSpec { rows, cols, cell_m, corner_m });
        let config = arrays::from_attributes!(
            config,
            FrontierConfig {
                min_cells,
                min_border_cells,
                max_span_rad,
                clearance_m,
                push_step_m,
                max_push_m,
            }
        );
        config.check().map_err(error::to_py)?;
        let map = occupancy::OccupancyMap::new(spec).map_err(error::to_py)?;
        Ok(Self { map, frontiers: Frontiers::default(), config })
    }

    fn conflicts<'py>(
        &self,
        py: Python<'py>,
        free: PyReadonlyArray2<'py, i32>,
        blocked: PyReadonlyArray2<'py, i32>,
    ) -> PyResult<(Cells<'py>, Cells<'py>)> {
        let seen = visible(&free, &blocked)?;
        let conflicts = py.detach(|| self.map.conflicts(&seen)).map_err(error::to_py)?;
        pair(py, conflicts)
    }

    #[pyo3(signature = (free, blocked, *, origin_m, explored_range_m))]
    fn integrate<'py>(
        &mut self,
        py: Python<'py>,
        free: PyReadonlyArray2<'py, i32>,
        blocked: PyReadonlyArray2<'py, i32>,
        origin_m: [f64; 2],
        explored_range_m: f64,
    ) -> PyResult<(Cells<'py>, Cells<'py>)> {
        let seen = visible(&free, &blocked)?;
        let map = &mut self.map;
        let conflicts =
            py.detach(|| map.integrate(&seen, origin_m, explored_range_m)).map_err(error::to_py)?;
        pair(py, conflicts)
    }

    fn explore_around(&mut self, centre_m: [f64; 2], radius_m: f64) -> PyResult<()> {
        self.map.explore_around(centre_m, radius_m).map_err(error::to_py)
    }

    fn assume_free(&mut self, centre_m: [f64; 2], radius_m: f64) -> PyResult<()> {
        self.map.assume_free(centre_m, radius_m).map_err(error::to_py)
    }

    fn forget(&mut self, cells: PyReadonlyArray2<'_, i32>) -> PyResult<()> {
        self.map.forget(&arrays::cells("cells", &cells)?).map_err(error::to_py)
    }

    fn distances_m<'py>(
        &self,
        py: Python<'py>,
        start_m: [f64; 2],
        targets_m: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let targets_m = arrays::rows("targets_m", &targets_m)?;
        let lengths_m = py.detach(|| self.map.distances_m(start_m, targets_m));
        Ok(lengths_m.map_err(error::to_py)?.into_pyarray(py))
    }

    fn clear(&mut self) {
        self.map.clear();
        self.frontiers.clear();
    }

    fn clear_frontiers(&mut self) {
        self.frontiers.clear();
    }

    fn update_frontiers(&mut self, py: Python<'_>, agent_m: [f64; 2]) -> PyResult<Vec<Frontier>> {
        let Self { map, frontiers, config } = self;
        py.detach(|| frontiers.update(map, agent_m, config).map(drop)).map_err(error::to_py)?;
        Ok(self.frontiers())
    }

    #[getter]
    fn frontiers(&self) -> Vec<Frontier> {
        self.frontiers.list().iter().cloned().map(Frontier).collect()
    }

    #[getter]
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        arrays::image_of(py, self.map.cells(), [self.map.spec().rows, self.map.spec().cols])
    }

    #[getter]
    fn explored<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let spec = self.map.spec();
        arrays::image_of(py, self.map.explored().to_bools(), [spec.rows, spec.cols])
    }
}

fn visible(
    free: &PyReadonlyArray2<'_, i32>,
    blocked: &PyReadonlyArray2<'_, i32>,
) -> PyResult<VisibleCells> {
    Ok(VisibleCells {
        free: arrays::cells("free", free)?,
        blocked: arrays::cells("blocked", blocked)?,
    })
}

fn pair<'py>(
    py: Python<'py>,
    conflicts: occupancy::Conflicts,
) -> PyResult<(Cells<'py>, Cells<'py>)> {
    Ok((arrays::rows_of(py, conflicts.freed)?, arrays::rows_of(py, conflicts.obstructed)?))
}
