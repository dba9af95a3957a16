//! `evonav_core::unigoal`. Shapes, units and errors: `_core.pyi`.

use evonav_core::{
    Error,
    geometry::Pose,
    grid::{bits::BitGrid, dilate::dilate_disk},
    unigoal::{
        bev_config::BevConfig,
        bev_map,
        collision_strip::{Strip, strip_cells},
        depth_view::DepthView,
        exploration::{ExploreConfig, choose_frontier, frontier_cells},
        path_planning::{PlanConfig, plan},
    },
};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::{arrays, camera::DepthImage, error};

type Cells<'py> = Bound<'py, PyArray2<i32>>;
type Mask<'py> = Bound<'py, PyArray2<bool>>;

/// UniGoal's bird's-eye map.
#[pyclass(module = "evonav._core")]
pub struct BevMap(bev_map::BevMap);

#[pymethods]
impl BevMap {
    #[new]
    fn new(centre_m: [f64; 2], num_categories: usize, config: &Bound<'_, PyAny>) -> PyResult<Self> {
        let config = arrays::from_attributes!(
            config,
            BevConfig {
                size_m,
                cell_m,
                block_m,
                heights_m,
                obstacle_min_m,
                obstacle_above_camera_m,
                max_depth_m,
                stride_px,
                category_points,
            }
        );
        bev_map::BevMap::new(centre_m, num_categories, config).map(Self).map_err(error::to_py)
    }

    fn integrate(
        &mut self,
        py: Python<'_>,
        view: DepthImage<'_>,
        categories: Option<PyReadonlyArray2<'_, i32>>,
    ) -> PyResult<()> {
        let (camera, depth_m) = view.borrow()?;
        let image_px = [camera.width_px, camera.height_px];
        let categories = categories.as_ref();
        let categories =
            categories.map(|array| arrays::image("categories", array, image_px)).transpose()?;
        let map = &mut self.0;
        py.detach(|| map.integrate(&DepthView { camera, depth_m, categories }))
            .map_err(error::to_py)
    }

    fn cells_of<'py>(
        &self,
        py: Python<'py>,
        view: DepthImage<'py>,
        mask: PyReadonlyArray2<'py, bool>,
    ) -> PyResult<Cells<'py>> {
        let (camera, depth_m) = view.borrow()?;
        let mask = arrays::image("mask", &mask, [camera.width_px, camera.height_px])?;
        let view = DepthView { camera, depth_m, categories: None };
        let cells = py.detach(|| self.0.cells_of(&view, mask)).map_err(error::to_py)?;
        arrays::rows_of(py, cells)
    }

    fn visit(&mut self, from_m: [f64; 2], to_m: [f64; 2]) -> PyResult<()> {
        self.0.visit(from_m, to_m).map_err(error::to_py)
    }

    #[pyo3(signature = (position_m, yaw_rad, *, start, length, width))]
    fn collide<'py>(
        &mut self,
        py: Python<'py>,
        position_m: [f64; 2],
        yaw_rad: f64,
        start: usize,
        length: usize,
        width: usize,
    ) -> PyResult<Cells<'py>> {
        let pose =
            Pose { position_m: [position_m[0], 0.0, position_m[1]], yaw_rad, horizon_rad: 0.0 };
        let cells = strip_cells(self.0.spec(), &pose, Strip { start, length, width });
        self.0.collide(&cells);
        arrays::rows_of(py, cells.into_iter().map(|cell| cell.map(|i| i as i32)).collect())
    }

    fn grown<'py>(
        &self,
        py: Python<'py>,
        cells: PyReadonlyArray2<'py, i32>,
        radius: usize,
    ) -> PyResult<Cells<'py>> {
        let mut grid = BitGrid::new(self.0.spec().rows, self.0.spec().cols);
        for cell in arrays::rows::<i32, 2>("cells", &cells)? {
            if let [Ok(row), Ok(col)] = cell.map(usize::try_from) {
                grid.insert(row, col);
            }
        }
        listed(py, &dilate_disk(&grid, radius))
    }

    #[pyo3(signature = (*, obstacle_radius, min_cells))]
    fn frontiers<'py>(
        &self,
        py: Python<'py>,
        obstacle_radius: usize,
        min_cells: usize,
    ) -> PyResult<Cells<'py>> {
        let config = ExploreConfig {
            frontier_obstacle_radius: obstacle_radius,
            min_cells,
            ..Default::default()
        };
        let cells = py.detach(|| frontier_cells(&self.0, &config));
        listed(py, &cells)
    }

    #[pyo3(signature = (
        agent_m, goal_m, *, frontier_obstacle_radius, min_cells, min_distance_m, span_m,
        path_obstacle_radius, margin,
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of the Python method")]
    #[expect(clippy::type_complexity, reason = "cell, two distances and a score")]
    fn choose_frontier(
        &self,
        py: Python<'_>,
        agent_m: [f64; 2],
        goal_m: Option<[f64; 2]>,
        frontier_obstacle_radius: usize,
        min_cells: usize,
        min_distance_m: f64,
        span_m: f64,
        path_obstacle_radius: usize,
        margin: usize,
    ) -> PyResult<Option<((usize, usize), f64, Option<f64>, f64)>> {
        let config = ExploreConfig {
            frontier_obstacle_radius,
            min_cells,
            min_distance_m,
            span_m,
            path_obstacle_radius,
            margin,
        };
        let chosen = py
            .detach(|| {
                let agent = self.0.require_cell("agent_m", agent_m)?;
                let goal =
                    goal_m.map(|goal_m| self.0.require_cell("goal_m", goal_m)).transpose()?;
                Ok(choose_frontier(&self.0, agent, goal, &config))
            })
            .map_err(|error: Error| error::to_py(error))?;
        Ok(chosen.map(|c| (c.cell.into(), c.distance_m, c.goal_distance_m, c.score)))
    }

    #[pyo3(signature = (
        agent_m, goals, *, goal_radius, obstacle_radius, margin, circle, small_circle
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of the Python method")]
    #[expect(clippy::type_complexity, reason = "two distances and a point")]
    fn plan(
        &self,
        py: Python<'_>,
        agent_m: [f64; 2],
        goals: PyReadonlyArray2<'_, i32>,
        goal_radius: usize,
        obstacle_radius: usize,
        margin: usize,
        circle: usize,
        small_circle: usize,
    ) -> PyResult<(Option<f64>, f64, Option<(f64, f64)>)> {
        let goals = arrays::rows("goals", &goals)?;
        let config = PlanConfig { obstacle_radius, margin, circle, small_circle };
        let plan = py
            .detach(|| plan(&self.0, agent_m, goals, goal_radius, &config))
            .map_err(error::to_py)?;
        Ok((plan.distance_m, plan.straight_m, plan.short_term_m.map(Into::into)))
    }

    fn category<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let cells = self.0.category(index).map_err(error::to_py)?;
        arrays::image_of(py, cells, [self.0.spec().rows, self.0.spec().cols])
    }

    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.0.spec().rows, self.0.spec().cols)
    }

    #[getter]
    fn corner_m(&self) -> (f64, f64) {
        self.0.spec().corner_m.into()
    }

    #[getter]
    fn obstacles<'py>(&self, py: Python<'py>) -> PyResult<Mask<'py>> {
        mask(py, self.0.obstacles())
    }

    #[getter]
    fn explored<'py>(&self, py: Python<'py>) -> PyResult<Mask<'py>> {
        mask(py, self.0.explored())
    }

    #[getter]
    fn visited<'py>(&self, py: Python<'py>) -> PyResult<Mask<'py>> {
        mask(py, self.0.visited())
    }

    #[getter]
    fn collisions<'py>(&self, py: Python<'py>) -> PyResult<Mask<'py>> {
        mask(py, self.0.collisions())
    }
}

fn listed<'py>(py: Python<'py>, grid: &BitGrid) -> PyResult<Cells<'py>> {
    arrays::rows_of(py, grid.cells().map(|cell| cell.map(|i| i as i32)).collect())
}

fn mask<'py>(py: Python<'py>, grid: &BitGrid) -> PyResult<Mask<'py>> {
    arrays::image_of(py, grid.to_bools(), [grid.rows(), grid.cols()])
}
