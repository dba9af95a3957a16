//! The world of one stage, and reference views of goals in it.

use std::cell::OnceCell;

use crate::{
    Error,
    assets::{Catalogue, UnknownAssets},
    generation::{
        Parameters,
        record::{Appearance, GoalRejection, PoseRecord},
        stage::appearance::appearance_of,
    },
    geometry::{Pose, Vec2, distance_2d_m},
    house::House,
    rng::Stream,
    sensors::{
        camera::{Camera, View},
        raster::{
            FrameBuffer, Light, Style, Want, relight, render_rows_of, render_view, visible_px,
        },
    },
    world::{
        layout::{Layout, rounding::round_to},
        mesh::SceneMesh,
        navigation::{AgentBody, Navigation, NavigationConfig},
        scene::Scene,
    },
};

/// Height of the camera (AI2-THOR's default agent).
const CAMERA_HEIGHT_M: f64 = 1.575;
/// Field of view of the reference image (ProcTHOR's default embodiment).
const FIELD_OF_VIEW_DEG: f64 = 90.0;
/// Pitch of the reference image (ProcTHOR's default embodiment).
pub const HORIZON_DEG: f64 = 30.0;
/// Spacing of AI2-THOR's grid of reachable positions.
const GRID_M: f64 = 0.25;

/// The house of a stage, prepared for queries.
pub struct StageWorld {
    /// The house.
    pub house: House,
    /// Objects of the house.
    pub layout: Layout,
    /// Free space of the agent.
    pub navigation: Navigation,
    mesh: SceneMesh,
    light: OnceCell<Light>,
}

/// The rooms and objects that can be reached.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Access {
    /// Whether a reachable position lies in each room.
    pub rooms: Vec<bool>,
    /// Whether a reachable position of its room lies at the reference distance from each object.
    pub objects: Vec<bool>,
}

impl Access {
    /// Return whether all rooms that could be reached before still can.
    pub fn includes_rooms(&self, before: &Self) -> bool {
        before.rooms.iter().zip(&self.rooms).all(|(then, now)| *now || !*then)
    }
}

/// The reference view of a goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// Pose of the view.
    pub pose: PoseRecord,
    /// Number of pixels of the target.
    pub visible_px: usize,
    /// Appearance of the target.
    pub appearance: Appearance,
    /// Image, RGB, row by row.
    pub image: Vec<u8>,
    /// Shortest path to the pose.
    pub path_m: Vec<Vec2>,
}

impl StageWorld {
    /// Build scene, layout, navigation and mesh of a house.
    ///
    /// # Errors
    /// Those of [`Scene::build`] and [`Navigation::build`].
    pub fn build(
        house: House,
        catalogue: &Catalogue,
        unknown: UnknownAssets,
    ) -> Result<Self, Error> {
        let scene = Scene::build(&house, catalogue, unknown)?;
        let navigation =
            Navigation::build(&scene, AgentBody::DEFAULT, NavigationConfig::default())?;
        let mesh = SceneMesh::build(&scene);
        let layout = Layout::new(&house, catalogue, unknown, scene)?;
        Ok(Self { house, layout, navigation, mesh, light: OnceCell::new() })
    }

    /// Return the positions of AI2-THOR's grid that can be reached from `from_m`, each with its
    /// room.
    ///
    /// # Errors
    /// Those of [`Navigation::reachable_positions`].
    pub fn reachable(
        &self,
        navigation: &Navigation,
        from_m: Vec2,
    ) -> Result<Vec<(Vec2, Option<usize>)>, Error> {
        let positions = navigation.reachable_positions(from_m, GRID_M)?;
        Ok(positions.into_iter().map(|p| (p, self.house.room_of(p))).collect())
    }

    /// Return the rooms and objects of `layout` that `reachable` positions give access to.
    pub fn access(
        &self,
        layout: &Layout,
        reachable: &[(Vec2, Option<usize>)],
        parameters: &Parameters,
    ) -> Access {
        let rooms = (0..self.house.rooms.len())
            .map(|room| reachable.iter().any(|(_, other)| *other == Some(room)))
            .collect();
        let objects = (0..layout.items.len())
            .map(|index| self.positions_near(layout, index, reachable, parameters).next().is_some())
            .collect();
        Access { rooms, objects }
    }

    /// Return the reachable positions of the object's room at the reference distance from it.
    fn positions_near<'a>(
        &self,
        layout: &Layout,
        index: usize,
        reachable: &'a [(Vec2, Option<usize>)],
        parameters: &Parameters,
    ) -> impl Iterator<Item = Vec2> + use<'a> {
        let room = self.house.objects[index].room;
        let [x, _, z] = layout.items[index].placement.position_m;
        let [near_m, far_m] = [parameters.reference_min_m, parameters.reference_max_m];
        reachable
            .iter()
            .filter(move |(position, other)| {
                room.is_some()
                    && *other == room
                    && (near_m..=far_m).contains(&distance_2d_m(*position, [x, z]))
            })
            .map(|(position, _)| *position)
    }

    /// Draw a reference pose for an object: a reachable position of its room at the reference
    /// distance, facing it, from which it is visible (paper, Sec. A.4).
    ///
    /// # Errors
    /// Those of [`render`]. The inner error is the reason why the object cannot be a goal.
    pub fn sample_reference(
        &self,
        index: usize,
        start_m: Vec2,
        reachable: &[(Vec2, Option<usize>)],
        parameters: &Parameters,
        stream: &mut Stream,
        frame: &mut FrameBuffer,
    ) -> Result<Result<Reference, GoalRejection>, Error> {
        let mut positions: Vec<Vec2> =
            self.positions_near(&self.layout, index, reachable, parameters).collect();
        if positions.is_empty() {
            return Ok(Err(GoalRejection::NoReferencePose));
        }
        stream.shuffle(&mut positions);
        let [x, _, z] = self.layout.items[index].placement.position_m;
        let body = self.layout.scene.first_object + index;
        let side_px = parameters.reference_image_px;
        for position in positions {
            let yaw_deg = (x - position[0]).atan2(z - position[1]).to_degrees();
            let yaw_deg = round_to(yaw_deg.rem_euclid(360.0), 1.0) % 360.0;
            let pose = PoseRecord {
                position_m: [
                    round_to(position[0], 1e-6),
                    0.5 * AgentBody::DEFAULT.height_m,
                    round_to(position[1], 1e-6),
                ],
                yaw_deg,
                horizon_deg: HORIZON_DEG,
            };
            let camera = camera_at(&pose, side_px);
            let least_px = parameters.reference_min_visible_px;
            let Some(visible_px) = visible_px(&self.mesh, &camera, body, least_px, frame)? else {
                continue;
            };
            let Some(path_m) = self.navigation.shortest_path(start_m, position) else {
                return Ok(Err(GoalRejection::Unreachable));
            };
            let view = View::from(camera);
            // Words for colours come from flat ones, so they are the same whatever the image's style.
            let instance = body as i32 + 1;
            render_rows_of(&self.mesh, &view, instance, frame)?;
            let appearance = appearance_of(
                &self.layout.items[index].asset,
                self.house.objects[index].condition(),
                frame,
                instance,
            );
            match parameters.reference_style {
                Style::Plain => {
                    let want = Want { rgb: Some(Style::Plain), instances: false };
                    render_view(&self.mesh, &view, want, frame)?;
                }
                Style::Default => relight(&self.mesh, self.light(), &view, frame),
            }
            let image = std::mem::take(&mut frame.rgb);
            return Ok(Ok(Reference { pose, visible_px, appearance, image, path_m }));
        }
        Ok(Err(GoalRejection::NotVisible))
    }

    fn light(&self) -> &Light {
        self.light.get_or_init(|| Light::build(&self.house, &self.layout.scene, &self.mesh))
    }
}

/// Return the camera of an agent at a pose.
fn camera_at(pose: &PoseRecord, side_px: usize) -> Camera {
    let pose = Pose {
        position_m: pose.position_m,
        yaw_rad: pose.yaw_deg.to_radians(),
        horizon_rad: pose.horizon_deg.to_radians(),
    };
    Camera::at(&pose, [side_px; 2], FIELD_OF_VIEW_DEG.to_radians(), CAMERA_HEIGHT_M)
}
