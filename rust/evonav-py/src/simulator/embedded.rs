//! `EmbeddedSimulator`. Shapes, units and errors: `_core.pyi`.

use std::sync::{Arc, Mutex};

use evonav_core::{
    assets::{Catalogue, UnknownAssets},
    geometry::{Pose, Vec2, Vec3},
    house::{House, HouseDelta},
    sensors::{
        camera::{CLIP_M, View},
        raster::{FrameBuffer, Style, Want},
    },
    simulator::{EmbeddedSimulator, SimulatorConfig},
    world::{
        appearance::Appearance,
        layout::{SpawnRequest, random_spawn, settled},
        navigation::{self, AgentBody},
        scene::{Body, BodyKind, OrientedBox, Scene},
    },
};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::{arrays, camera::PyPose, error, house::unknown_assets, run_image::RunImage};

/// Depth, colours and instances of a view.
type Images<'py, I> = (Bound<'py, PyArray2<f32>>, Option<Bound<'py, PyArray3<u8>>>, Option<I>);

/// Corners, bodies and colours of triangles.
type Triangles<'py> =
    (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray1<i32>>, Bound<'py, PyArray2<u8>>);

/// Rows and columns, and `(x, z)` of the corner.
type MapSpec = ((usize, usize), Vec2);

/// Id, category, kind, centre and size of a body.
type BodyRecord = (String, String, &'static str, Vec3, Vec3);

/// Working memory of the renderer that no thread uses, for the views of all simulators.
static BUFFERS: Mutex<Vec<FrameBuffer>> = Mutex::new(Vec::new());

/// Largest image, in pixels, whose working memory is used again.
const MAX_REUSED_PX: usize = 1 << 20;

#[pyclass(name = "EmbeddedSimulator", module = "evonav._core", frozen, weakref)]
pub struct PyEmbeddedSimulator {
    pub core: Arc<EmbeddedSimulator>,
}

/// `evonav.world.camera.CameraView`.
#[derive(FromPyObject)]
struct CameraView {
    pose: PyPose,
    width_px: usize,
    height_px: usize,
    vertical_fov_rad: f64,
    near_m: f64,
    far_m: f64,
    roll_rad: f64,
    orthographic_half_height_m: Option<f64>,
}

impl CameraView {
    fn view(&self) -> View {
        View {
            camera: self.pose.camera([self.width_px, self.height_px], self.vertical_fov_rad),
            clip_m: [self.near_m, self.far_m],
            roll_rad: self.roll_rad,
            half_height_m: self.orthographic_half_height_m,
        }
    }
}

impl From<EmbeddedSimulator> for PyEmbeddedSimulator {
    fn from(core: EmbeddedSimulator) -> Self {
        Self { core: Arc::new(core) }
    }
}

#[pymethods]
impl PyEmbeddedSimulator {
    #[new]
    #[pyo3(signature = (
        house_json, *, name, image_px, vertical_fov_rad, clip_m, camera_height_m,
        agent_radius_m, agent_height_m, allow_unknown_assets, style
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword-only in Python")]
    fn new(
        py: Python<'_>,
        house_json: &str,
        name: &str,
        image_px: [usize; 2],
        vertical_fov_rad: f64,
        clip_m: [f64; 2],
        camera_height_m: f64,
        agent_radius_m: f64,
        agent_height_m: f64,
        allow_unknown_assets: bool,
        style: &str,
    ) -> PyResult<Self> {
        let unknown = unknown_assets(allow_unknown_assets);
        let agent = AgentBody { radius_m: agent_radius_m, height_m: agent_height_m };
        let style = Style::of(style).map_err(error::to_py)?;
        let config = SimulatorConfig {
            image_px,
            vertical_fov_rad,
            clip_m,
            camera_height_m,
            agent,
            unknown,
            style,
        };
        py.detach(|| EmbeddedSimulator::new(House::from_json(name, house_json)?, config))
            .map(Self::from)
            .map_err(error::to_py)
    }

    /// Apply a `HouseDelta` (JSON); return the simulator of the changed house.
    fn apply(&self, py: Python<'_>, delta_json: &str) -> PyResult<Self> {
        let delta: HouseDelta = HouseDelta::from_json(delta_json).map_err(error::to_py)?;
        py.detach(|| self.core.apply(&delta)).map(Self::from).map_err(error::to_py)
    }

    /// Return the house after a change around an agent, as JSON, and the ids of what stays.
    #[pyo3(signature = (delta_json, *, agent_m, target_id))]
    fn change_around(
        &self,
        py: Python<'_>,
        delta_json: &str,
        agent_m: Vec2,
        target_id: &str,
    ) -> PyResult<(String, Vec<String>)> {
        py.detach(|| {
            let delta = HouseDelta::from_json(delta_json)?;
            let (after, skipped) = self.core.change_around(&delta, agent_m, target_id)?;
            Ok((after.house().to_json(), skipped))
        })
        .map_err(error::to_py)
    }

    /// Return the same house in a random look (a list of changes, JSON).
    #[pyo3(signature = (changes_json, *, are_checked))]
    fn with_look(&self, py: Python<'_>, changes_json: &str, are_checked: bool) -> PyResult<Self> {
        py.detach(|| {
            let appearance = Appearance::from_json(changes_json)?;
            if !are_checked {
                appearance.check_names(self.core.house(), Catalogue::bundled())?;
            }
            Ok(self.core.with_look(&appearance).into())
        })
        .map_err(error::to_py)
    }

    fn num_materials(&self) -> usize {
        self.core.num_materials()
    }

    fn house_json(&self) -> String {
        self.core.house().to_json()
    }

    fn room_of(&self, x_m: f64, z_m: f64) -> Option<&str> {
        self.core.house().room_id_of([x_m, z_m])
    }

    fn bodies(&self) -> Vec<BodyRecord> {
        self.core.bodies().iter().map(body_record).collect()
    }

    /// Carry out a `SpawnRequest`; return the `HouseDelta` (both JSON) and the ids of the objects
    /// that found no place.
    fn random_spawn(&self, py: Python<'_>, request_json: &str) -> PyResult<(String, Vec<String>)> {
        let (house, scene) = (self.core.house(), self.core.scene());
        py.detach(|| {
            let request = SpawnRequest::from_json(request_json)?;
            let (catalogue, unknown) = (Catalogue::bundled(), UnknownAssets::CategoryDefault);
            let spawned = random_spawn(house, catalogue, unknown, scene, &request)?;
            Ok((spawned.delta.to_json(), spawned.unplaced))
        })
        .map_err(error::to_py)
    }

    /// Return the `HouseDelta` (JSON) that lets objects that hang in the air fall.
    fn settled(&self, py: Python<'_>) -> PyResult<String> {
        let (house, scene) = (self.core.house(), self.core.scene());
        py.detach(|| settled(house, Catalogue::bundled(), UnknownAssets::CategoryDefault, scene))
            .map(|delta| delta.to_json())
            .map_err(error::to_py)
    }

    /// Return position, yaw and horizon of the start pose.
    fn start(&self) -> (Vec3, f64, f64) {
        let Pose { position_m, yaw_rad, horizon_rad } = self.core.start();
        (position_m, yaw_rad, horizon_rad)
    }

    #[pyo3(signature = (pose, *, rgb, instances))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        pose: PyPose,
        rgb: bool,
        instances: bool,
    ) -> PyResult<Images<'py, RunImage>> {
        let (view, want) = (self.core.view(&pose.pose()), self.core.want(rgb, instances));
        let take = |buffer: &mut FrameBuffer| std::mem::take(&mut buffer.instance_runs);
        self.images(py, &view, want, true, take)
            .map(|(depth, colours, ids)| (depth, colours, ids.map(RunImage::new)))
    }

    #[pyo3(signature = (view, *, rgb, instances))]
    fn render_camera<'py>(
        &self,
        py: Python<'py>,
        view: CameraView,
        rgb: bool,
        instances: bool,
    ) -> PyResult<Images<'py, Bound<'py, PyArray2<i32>>>> {
        let view = view.view();
        let shape = [view.camera.height_px, view.camera.width_px];
        let take = |buffer: &mut FrameBuffer| std::mem::take(&mut buffer.instances);
        let want = self.core.want(rgb, instances);
        let (depth, colours, ids) = self.images(py, &view, want, false, take)?;
        let ids = ids.map(|ids| arrays::image_of(py, ids, shape)).transpose()?;
        Ok((depth, colours, ids))
    }

    /// Return the indices of the bodies that AI2-THOR calls visible.
    #[pyo3(signature = (view, *, agent_m, max_distance_m))]
    fn visible_bodies(
        &self,
        py: Python<'_>,
        view: CameraView,
        agent_m: Vec2,
        max_distance_m: f64,
    ) -> PyResult<Vec<usize>> {
        let view = View { clip_m: CLIP_M, ..view.view() };
        py.detach(|| self.core.visible_bodies(&view, agent_m, max_distance_m)).map_err(error::to_py)
    }

    fn is_free(&self, point_m: Vec2) -> bool {
        self.core.navigation().is_free(point_m)
    }

    fn is_reachable(&self, py: Python<'_>, point_m: Vec2) -> bool {
        py.detach(|| self.core.is_reachable(point_m))
    }

    fn can_move(&self, from_m: Vec2, to_m: Vec2) -> bool {
        self.core.navigation().try_move(from_m, to_m)
    }

    /// Return the index of a body that a straight move touches.
    fn blocker(&self, from_m: Vec2, to_m: Vec2) -> Option<usize> {
        self.core.navigation().obstacles().blocker_between(from_m, to_m)
    }

    fn is_visible(&self, py: Python<'_>, from_m: Vec3, to_m: Vec3, ignored: Vec<usize>) -> bool {
        py.detach(|| self.core.is_visible(from_m, to_m, &ignored))
    }

    fn reachable_positions<'py>(
        &self,
        py: Python<'py>,
        from_m: Vec2,
        grid_m: f64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points_m = py
            .detach(|| self.core.navigation().reachable_positions(from_m, grid_m))
            .map_err(error::to_py)?;
        arrays::rows_of(py, points_m)
    }

    fn shortest_path<'py>(
        &self,
        py: Python<'py>,
        start_m: Vec2,
        target_m: Vec2,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let path_m = py.detach(|| self.core.navigation().shortest_path(start_m, target_m));
        arrays::rows_of(py, path_m.unwrap_or_default())
    }

    fn distances_m<'py>(
        &self,
        py: Python<'py>,
        start_m: Vec2,
        targets_m: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let targets_m = arrays::rows("targets_m", &targets_m)?;
        let lengths_m = py.detach(|| self.core.navigation().distances_m(start_m, targets_m));
        Ok(lengths_m.into_pyarray(py))
    }

    /// Return the cells and `(x, z)` of the grid's corner.
    fn occupancy<'py>(
        &self,
        py: Python<'py>,
        cell_m: f64,
    ) -> PyResult<(Bound<'py, PyArray2<u8>>, Vec2)> {
        let (spec, cells) = py.detach(|| self.core.occupancy(cell_m)).map_err(error::to_py)?;
        Ok((arrays::image_of(py, cells, [spec.rows, spec.cols])?, spec.corner_m))
    }

    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Triangles<'py>> {
        let triangles: Vec<_> = py.detach(|| self.core.mesh().triangles().collect());
        let corners_m = triangles.iter().flat_map(|t| t.vertices_m).collect::<Vec<_>>();
        let bodies = triangles.iter().map(|t| t.body as i32).collect::<Vec<_>>();
        let colours = triangles.iter().map(|t| t.colour).collect();
        let corners_m = arrays::image_of(py, corners_m.into_flattened(), [bodies.len(), 3, 3])?;
        Ok((corners_m, bodies.into_pyarray(py), arrays::rows_of(py, colours)?))
    }
}

impl PyEmbeddedSimulator {
    /// Render a view, with instances as `take` returns them.
    fn images<'py, I: Send>(
        &self,
        py: Python<'py>,
        view: &View,
        want: Want,
        has_runs: bool,
        take: impl FnOnce(&mut FrameBuffer) -> I + Send,
    ) -> PyResult<Images<'py, I>> {
        let shape @ [height, width] = [view.camera.height_px, view.camera.width_px];
        let (depth, colours, ids) = py
            .detach(|| {
                // Nobody waits here: after a fork, the thread that holds the lock may not exist.
                let free = BUFFERS.try_lock().ok().and_then(|mut buffers| buffers.pop());
                let mut buffer = free.unwrap_or_default();
                buffer.has_runs = has_runs;
                self.core.render(view, want, &mut buffer)?;
                let ids = want.instances.then(|| take(&mut buffer));
                let (depth, colours) = buffer.take();
                if height * width <= MAX_REUSED_PX
                    && let Ok(mut buffers) = BUFFERS.try_lock()
                {
                    buffers.push(buffer);
                }
                Ok((depth, colours, ids))
            })
            .map_err(error::to_py)?;
        let depth = arrays::image_of(py, depth, shape)?;
        let of_colours = || arrays::image_of(py, colours, [height, width, 3]);
        let colours = want.rgb.is_some().then(of_colours).transpose()?;
        Ok((depth, colours, ids))
    }
}

fn body_record(body: &Body) -> BodyRecord {
    let kind = match body.kind {
        BodyKind::Object => "object",
        BodyKind::Wall => "wall",
        BodyKind::Floor => "floor",
        BodyKind::Ceiling => "ceiling",
        BodyKind::Door => "door",
        BodyKind::Window => "window",
    };
    let aabb = OrientedBox::of_aabb(&body.unopened);
    (body.id.clone(), body.category.clone(), kind, aabb.centre_m, aabb.half_m.map(|h| 2.0 * h))
}

/// Return the shape and corner of the oracle occupancy's grid.
#[pyfunction]
#[pyo3(signature = (house_json, *, name, cell_m))]
pub fn map_spec(py: Python<'_>, house_json: &str, name: &str, cell_m: f64) -> PyResult<MapSpec> {
    let spec = py.detach(|| {
        let house = House::from_json(name, house_json)?;
        navigation::map_spec(&Scene::build_empty(&house, Catalogue::bundled()), cell_m)
    });
    spec.map(|spec| ((spec.rows, spec.cols), spec.corner_m)).map_err(error::to_py)
}
