//! `BatchSimulator` and `GeodesicField`. Shapes, units and errors: `_core.pyi`.

use std::sync::Arc;

use evonav_core::{
    geometry::{Pose, Vec2},
    sensors::instance_masks::MaskFilter,
    simulator::{
        actions::Strides,
        batch::{Batch, BatchConfig, Images},
        batch_slot::Slot,
        geodesic_field::GeodesicField,
    },
};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadwriteArray3, PyReadwriteArray4,
};
use pyo3::prelude::*;

use crate::{arrays, camera::PyPose, error, simulator::embedded::PyEmbeddedSimulator};

/// Number of pixels from which on threads share a batch's images: four of 128 x 128.
const MIN_SHARED_PX: usize = 1 << 16;

/// Whether each agent's action was carried out, and its distance.
type Stepped<'py> = (Bound<'py, PyArray1<bool>>, Bound<'py, PyArray1<f64>>);

#[pyclass(name = "GeodesicField", module = "evonav._core", frozen)]
pub struct PyGeodesicField {
    core: Arc<GeodesicField>,
}

#[pymethods]
impl PyGeodesicField {
    #[new]
    fn new(py: Python<'_>, simulator: &PyEmbeddedSimulator, source_m: Vec2) -> PyResult<Self> {
        let world = Arc::clone(&simulator.core);
        let core = py.detach(|| GeodesicField::new(world, source_m)).map_err(error::to_py)?;
        Ok(Self { core: Arc::new(core) })
    }

    fn distance_m(&self, point_m: Vec2) -> f64 {
        self.core.distance_m(point_m)
    }
}

/// Return points as tuples.
fn pairs(points_m: Vec<Vec2>) -> Vec<(f64, f64)> {
    points_m.into_iter().map(Into::into).collect()
}

#[pyclass(name = "BatchSimulator", module = "evonav._core")]
pub struct PyBatchSimulator {
    core: Batch,
}

#[pymethods]
impl PyBatchSimulator {
    #[new]
    #[pyo3(signature = (
        num_slots, *, image_px, empty_depth_m, move_m, turn_rad, grid_m, min_area_px, num_threads
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword-only in Python")]
    fn new(
        num_slots: usize,
        image_px: [usize; 2],
        empty_depth_m: f32,
        move_m: f64,
        turn_rad: f64,
        grid_m: f64,
        min_area_px: usize,
        num_threads: usize,
    ) -> PyResult<Self> {
        let mask_filter = MaskFilter { min_area_px, max_box_fraction: 1.0 };
        let strides = Strides { move_m, turn_rad };
        let config = BatchConfig {
            image_px,
            empty_depth_m,
            strides,
            grid_m,
            mask_filter,
            num_threads,
            min_shared_px: MIN_SHARED_PX,
        };
        Ok(Self { core: Batch::new(num_slots, config).map_err(error::to_py)? })
    }

    fn place(
        &mut self,
        slot: usize,
        simulator: &PyEmbeddedSimulator,
        pose: PyPose,
        labels: Option<PyReadonlyArray1<'_, u8>>,
    ) -> PyResult<()> {
        let world = Arc::clone(&simulator.core);
        let labels = match &labels {
            Some(labels) => Arc::from(labels.as_slice()?),
            None => vec![0; world.bodies().len()].into(),
        };
        let agent = Slot::new(world, pose.pose(), labels);
        self.core.place(slot, agent).map_err(error::to_py)
    }

    fn aim(&mut self, slot: usize, field: Option<&PyGeodesicField>) -> PyResult<()> {
        let field = field.map(|field| Arc::clone(&field.core));
        self.core.aim(slot, field).map_err(error::to_py)
    }

    /// Return the corners of the path of one agent.
    fn plan_one(
        &mut self,
        py: Python<'_>,
        slot: usize,
        target_m: Vec2,
    ) -> PyResult<Vec<(f64, f64)>> {
        let path_m = py.detach(|| self.core.plan_one(slot, target_m)).map_err(error::to_py)?;
        Ok(pairs(path_m))
    }

    fn step<'py>(
        &mut self,
        py: Python<'py>,
        actions: PyReadonlyArray1<'py, u8>,
    ) -> PyResult<Stepped<'py>> {
        let actions = actions.as_slice()?;
        let stepped = py.detach(|| self.core.step(actions)).map_err(error::to_py)?;
        let is_success: Vec<bool> = stepped.iter().map(|one| one.is_success).collect();
        let distances_m: Vec<f64> = stepped.iter().map(|one| one.distance_m).collect();
        Ok((is_success.into_pyarray(py), distances_m.into_pyarray(py)))
    }

    fn plan(
        &mut self,
        py: Python<'_>,
        targets_m: Vec<Option<Vec2>>,
    ) -> PyResult<Vec<Vec<(f64, f64)>>> {
        let paths_m = py.detach(|| self.core.plan(&targets_m)).map_err(error::to_py)?;
        Ok(paths_m.into_iter().map(pairs).collect())
    }

    fn follow(&mut self, slot: usize, stops: Vec<(Vec2, f64)>) -> PyResult<usize> {
        self.core.follow(slot, &stops).map_err(error::to_py)
    }

    fn distance_m(&self, slot: usize) -> PyResult<f64> {
        self.core.slot(slot).map(Slot::distance_m).map_err(error::to_py)
    }

    /// Return the poses, `(B, 5)`: x, y, z, yaw and horizon.
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = (0..self.core.num_slots()).map(|index| {
            let Pose { position_m: [x_m, y_m, z_m], yaw_rad, horizon_rad } =
                self.core.slot(index)?.pose();
            Ok([x_m, y_m, z_m, yaw_rad, horizon_rad])
        });
        arrays::rows_of(py, rows.collect::<Result<_, _>>().map_err(error::to_py)?)
    }

    #[pyo3(signature = (*, depth_m, rgb, labels))]
    fn render(
        &self,
        py: Python<'_>,
        mut depth_m: Option<PyReadwriteArray3<'_, f32>>,
        mut rgb: Option<PyReadwriteArray4<'_, u8>>,
        mut labels: Option<PyReadwriteArray3<'_, u8>>,
    ) -> PyResult<()> {
        let depth_m =
            depth_m.as_mut().map(|array| arrays::whole_mut("depth_m", array)).transpose()?;
        let rgb = rgb.as_mut().map(|array| arrays::whole_mut("rgb", array)).transpose()?;
        let labels = labels.as_mut().map(|array| arrays::whole_mut("labels", array)).transpose()?;
        py.detach(|| self.core.render(Images { depth_m, rgb, labels })).map_err(error::to_py)
    }
}
