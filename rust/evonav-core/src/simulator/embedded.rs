//! The embedded simulator of one house.

use std::sync::{Arc, OnceLock};

use crate::{
    Error,
    assets::{Catalogue, UnknownAssets},
    geometry::{Pose, Vec2, Vec3},
    grid::GridSpec,
    house::{House, HouseDelta},
    sensors::{
        camera::{Camera, View},
        raster::{FrameBuffer, Light, Style, Want, render_lit},
        ray_caster::RayCaster,
        visible_bodies::visible_bodies,
    },
    world::{
        appearance::{Appearance, scene_of},
        mesh::SceneMesh,
        navigation::{AgentBody, Navigation, NavigationConfig},
        scene::{Body, Scene},
    },
};

/// Spacing of the places that are tried if the house's own start is blocked.
const SEARCH_PITCH_M: f64 = 0.25;

/// Yaw and horizon in houses without a start: ProcTHOR's usual horizon.
const DEFAULT_LOOK_DEG: [f64; 2] = [0.0, 30.0];

/// The agent's camera and body, and the treatment of unknown assets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatorConfig {
    /// Columns and rows of images.
    pub image_px: [usize; 2],
    /// Field of view from the upper to the lower border.
    pub vertical_fov_rad: f64,
    /// Planar depths `[near, far]` between which surfaces are drawn.
    pub clip_m: [f64; 2],
    /// Height of the optical centre over the floor.
    pub camera_height_m: f64,
    /// Body of the agent.
    pub agent: AgentBody,
    /// Treatment of assets that the catalogue does not contain.
    pub unknown: UnknownAssets,
    /// Way to draw colours.
    pub style: Style,
}

/// A house with its bodies, surfaces and free space.
///
/// It has no state of an agent, so several threads may share one simulator.
#[derive(Debug)]
pub struct EmbeddedSimulator {
    built: Arc<Built>,
    /// The look, if it is not the house's own.
    look: Option<Look>,
}

/// All that does not depend on the look of a house.
#[derive(Debug)]
struct Built {
    house: House,
    config: SimulatorConfig,
    scene: Scene,
    mesh: SceneMesh,
    navigation: Navigation,
    start_m: Vec2,
    rays: OnceLock<RayCaster>,
    /// The house's own light.
    light: OnceLock<Light>,
}

/// The surfaces of a house in another look, and its light.
#[derive(Debug)]
struct Look {
    appearance: Appearance,
    num_materials: usize,
    mesh: SceneMesh,
    /// The light, if the look changes it.
    light: OnceLock<Light>,
}

impl EmbeddedSimulator {
    /// Instantiate a house.
    ///
    /// # Errors
    /// [`Error::House`] for unknown assets, [`Error::InvalidArgument`] for the camera or the body,
    /// [`Error::Simulation`] if the agent fits nowhere.
    pub fn new(house: House, config: SimulatorConfig) -> Result<Self, Error> {
        let scene = Scene::build(&house, Catalogue::bundled(), config.unknown)?;
        let navigation = Navigation::build(&scene, config.agent, NavigationConfig::default())?;
        Self::assemble(house, config, scene, navigation)
    }

    /// Return the same house in a random look, which replaces an earlier one. Names that the house
    /// lacks have no effect; [`Appearance::check_names`] finds them.
    ///
    /// # Complexity
    /// O(parts); free space, rays and an unchanged light are shared.
    #[must_use]
    pub fn with_look(&self, appearance: &Appearance) -> Self {
        let built = Arc::clone(&self.built);
        if appearance.changes.is_empty() {
            return Self { built, look: None };
        }
        let Built { house, config, scene, .. } = &*built;
        let (varied, num_materials) =
            scene_of(house, Catalogue::bundled(), config.unknown, scene, appearance);
        let look = Look {
            appearance: appearance.clone(),
            num_materials,
            mesh: SceneMesh::build(&varied),
            light: OnceLock::new(),
        };
        Self { built, look: Some(look) }
    }

    /// Return the number of materials and assets from which the look's materials were drawn.
    pub fn num_materials(&self) -> usize {
        self.look.as_ref().map_or(0, |look| look.num_materials)
    }

    /// Apply a change; return the simulator of the changed house in the same look. Only moved
    /// objects are built again.
    ///
    /// # Errors
    /// Those of [`House::apply`] and [`Self::new`].
    pub fn apply(&self, delta: &HouseDelta) -> Result<Self, Error> {
        let house = self.built.house.apply(delta)?;
        let states = delta.states.iter().map(|change| &change.id);
        let changed = delta.moves.iter().map(|change| &change.id).chain(states);
        let changed: Option<Vec<usize>> = changed.map(|id| house.object_index(id)).collect();
        let (catalogue, unknown) = (Catalogue::bundled(), self.built.config.unknown);
        let scene = match changed {
            Some(changed) => self.built.scene.rebuild(&house, catalogue, unknown, &changed)?,
            // A door changed, which is not an object; `rebuild` reuses the structure.
            None => Scene::build(&house, catalogue, unknown)?,
        };
        let navigation = self.built.navigation.with_scene(&scene)?;
        let changed = Self::assemble(house, self.built.config, scene, navigation)?;
        Ok(match &self.look {
            Some(look) => changed.with_look(&look.appearance),
            None => changed,
        })
    }

    fn assemble(
        house: House,
        config: SimulatorConfig,
        scene: Scene,
        navigation: Navigation,
    ) -> Result<Self, Error> {
        let mesh = SceneMesh::build(&scene);
        let start_m = start_of(&house, &scene, &navigation)?;
        let (rays, light) = (OnceLock::new(), OnceLock::new());
        let built = Built { house, config, scene, mesh, navigation, start_m, rays, light };
        let simulator = Self { built: Arc::new(built), look: None };
        simulator.view(&simulator.start()).check()?;
        Ok(simulator)
    }

    /// Return the house.
    pub fn house(&self) -> &House {
        &self.built.house
    }

    /// Return the columns and rows of images.
    pub fn image_px(&self) -> [usize; 2] {
        self.built.config.image_px
    }

    /// Return all bodies of the house, in instance order.
    pub fn bodies(&self) -> &[Body] {
        &self.built.scene.bodies
    }

    /// Return the scene: the bodies and their bounds.
    pub fn scene(&self) -> &Scene {
        &self.built.scene
    }

    /// Return all surfaces, as they look.
    pub fn mesh(&self) -> &SceneMesh {
        self.look.as_ref().map_or(&self.built.mesh, |look| &look.mesh)
    }

    /// Return the free space.
    pub fn navigation(&self) -> &Navigation {
        &self.built.navigation
    }

    /// Return the house's own start pose, moved to the nearest place where the agent fits; the
    /// middle of the house if it has no start.
    pub fn start(&self) -> Pose {
        let given = self.built.house.start.map(|start| [start.yaw_deg, start.horizon_deg]);
        let [yaw_rad, horizon_rad] = given.unwrap_or(DEFAULT_LOOK_DEG).map(f64::to_radians);
        Pose { position_m: self.body_position_m(self.built.start_m), yaw_rad, horizon_rad }
    }

    /// Return AI2-THOR's agent position, the middle of the body, over a point of the floor.
    pub fn body_position_m(&self, point_m: Vec2) -> Vec3 {
        [point_m[0], self.built.config.agent.height_m / 2.0, point_m[1]]
    }

    /// Return the camera of an agent at `pose`, whose own height does not matter.
    pub fn camera(&self, pose: &Pose) -> Camera {
        let SimulatorConfig { image_px, vertical_fov_rad, camera_height_m, .. } = self.built.config;
        Camera::at(pose, image_px, vertical_fov_rad, camera_height_m)
    }

    /// Return the view of an agent at `pose`.
    pub fn view(&self, pose: &Pose) -> View {
        View { clip_m: self.built.config.clip_m, ..View::from(self.camera(pose)) }
    }

    /// Return the images to render besides depth, with colours in the simulator's style.
    pub fn want(&self, rgb: bool, instances: bool) -> Want {
        Want { rgb: rgb.then_some(self.built.config.style), instances }
    }

    /// Render the view of any camera, the agent's ([`Self::view`]) or another.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] as [`View::check`].
    pub fn render(&self, view: &View, want: Want, out: &mut FrameBuffer) -> Result<(), Error> {
        let light = (want.rgb == Some(Style::Default)).then(|| self.light());
        render_lit(self.mesh(), light, view, want, out)
    }

    fn light(&self) -> &Light {
        let Built { house, scene, mesh, light, .. } = &*self.built;
        let own = || light.get_or_init(|| Light::build(house, scene, mesh));
        let look = self.look.as_ref();
        match look.and_then(|look| Some((&look.light, look.appearance.lighting()?))) {
            Some((light, lighting)) => light.get_or_init(|| own().varied(lighting)),
            None => own(),
        }
    }

    /// Return whether an agent fits at `[x, z]` and can move there from the house's start.
    pub fn is_reachable(&self, point_m: Vec2) -> bool {
        self.built.navigation.is_connected(self.built.start_m, point_m)
    }

    /// Return the oracle occupancy: a grid over the house, and its cells ([`Navigation::occupancy`]
    /// from the house's start).
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if `cell_m` is below 0.01, not finite, or needs too large a grid.
    pub fn occupancy(&self, cell_m: f64) -> Result<(GridSpec, Vec<u8>), Error> {
        let spec = self.built.navigation.map_spec(cell_m)?;
        Ok((spec, self.built.navigation.occupancy(&spec, self.built.start_m)?))
    }

    /// Return whether nothing is between two points except the bodies in `ignored` (indices).
    pub fn is_visible(&self, from_m: Vec3, to_m: Vec3, ignored: &[usize]) -> bool {
        self.rays().is_visible(&self.built.mesh, from_m, to_m, |body| ignored.contains(&body))
    }

    /// Return the indices of the bodies that AI2-THOR would call visible to an agent at `agent_m`.
    ///
    /// # Errors
    /// As [`visible_bodies`].
    pub fn visible_bodies(
        &self,
        view: &View,
        agent_m: Vec2,
        max_distance_m: f64,
    ) -> Result<Vec<usize>, Error> {
        visible_bodies(
            &self.built.scene,
            &self.built.mesh,
            self.rays(),
            view,
            agent_m,
            max_distance_m,
        )
    }

    fn rays(&self) -> &RayCaster {
        self.built.rays.get_or_init(|| RayCaster::build(&self.built.mesh))
    }
}

/// Return the house's start, or the free place nearest to it.
fn start_of(house: &House, scene: &Scene, navigation: &Navigation) -> Result<Vec2, Error> {
    let [x, _, z] = house.start.map_or_else(|| scene.bounds.centre_m(), |start| start.position_m);
    let anywhere = || {
        let spec = navigation.map_spec(SEARCH_PITCH_M).ok()?;
        let cells = (0..spec.len()).map(|i| spec.centre_m([i / spec.cols, i % spec.cols]));
        let squared_m2 = |p: &Vec2| (p[0] - x).powi(2) + (p[1] - z).powi(2);
        cells
            .filter(|&point_m| navigation.is_free(point_m))
            .min_by(|a, b| squared_m2(a).total_cmp(&squared_m2(b)))
    };
    navigation.snap([x, z]).or_else(anywhere).ok_or_else(|| Error::Simulation {
        message: format!("house {}: the agent fits nowhere", house.name),
    })
}
