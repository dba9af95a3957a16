"""Execute the client's actions one after another."""

import logging
import math
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evonav.errors import EvonavError
from evonav.thor.actions import registry
from evonav.thor.actions.registry import ActionError, Arguments, ErrorCode
from evonav.thor.agent import AgentBody
from evonav.thor.geometry import Vec3, vector
from evonav.thor.scene import Scene
from evonav.world.camera import CameraView, Images
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

Rgb = tuple[int, int, int]
_LOG = logging.getLogger("evonav.thor")
# Maximal number of characters of an error message.
_MAX_MESSAGE = 4000
_logged: set[tuple[str, int | None]] = set()


class EngineSettings(Arguments, extra="allow"):
    """The settings of `Initialize`, by AI2-THOR's names; the client also passes other keywords of its constructor."""

    agentMode: str = "default"
    agentCount: int = 1
    gridSize: float = 0.25
    snapToGrid: bool = True
    rotateStepDegrees: float = 90.0
    visibilityDistance: float = 1.5
    fieldOfView: float | None = None
    maxUpwardLookAngle: float = 0.0
    maxDownwardLookAngle: float = 0.0
    applyActionNoise: bool = True
    movementGaussianMu: float = 0.0
    movementGaussianSigma: float = 0.0
    rotateGaussianMu: float = 0.0
    rotateGaussianSigma: float = 0.0
    renderDepthImage: bool = False
    renderInstanceSegmentation: bool = False
    renderSemanticSegmentation: bool = False
    renderNormalsImage: bool = False
    renderFlowImage: bool = False
    fastActionEmit: bool = False
    """Answer an action that changed nothing with its result alone."""


@dataclass(frozen=True, slots=True)
class ThirdPartyCamera:
    """One camera. It is immutable: a change makes another camera."""

    camera_id: int
    position_m: Vec3
    rotation_deg: Vec3
    """Unity's Euler angles in degrees: pitch down, yaw right, roll counter-clockwise; roll is applied first."""
    field_of_view_deg: float
    """Vertical field of view in degrees."""
    near_m: float
    far_m: float
    is_orthographic: bool
    orthographic_size_m: float
    """Half the height of an orthographic image, in metres."""
    skybox: Rgb | None
    """Colour of the background; `None` for the renderer's own."""

    def metadata(self) -> dict[str, Any]:
        """Return AI2-THOR's `ThirdPartyCameraMetadata`."""
        return {
            "thirdPartyCameraId": self.camera_id,
            "position": vector(self.position_m),
            "rotation": vector(_euler_deg(self.rotation_deg)),
            "fieldOfView": self.field_of_view_deg,
        }

    def render(self, scene: Scene, *, rgb: bool, instances: bool) -> Images:
        """Render the camera's view in the size of the screen; depth ends at its far plane."""
        view = self._view(scene.config.width_px, scene.config.height_px)
        needs_instances = instances or (rgb and self.skybox is not None)
        depth_m, colours, ids = scene.simulator.render_camera(view, rgb=rgb, instances=needs_instances)
        if colours is not None and self.skybox is not None and ids is not None:
            colours = np.where((ids == 0)[..., np.newaxis], np.array(self.skybox, dtype=np.uint8), colours)
        return Images(np.minimum(depth_m, np.float32(self.far_m)), colours, ids if instances else None)

    def _view(self, width_px: int, height_px: int) -> CameraView:
        down, right, roll = (math.radians(angle) for angle in self.rotation_deg)
        return CameraView(
            Pose(*self.position_m, yaw_rad=right, horizon_rad=down),
            width_px,
            height_px,
            math.radians(self.field_of_view_deg),
            self.near_m,
            self.far_m,
            roll,
            self.orthographic_size_m if self.is_orthographic else None,
        )


def _euler_deg(angles_deg: Vec3) -> Vec3:
    """Return angles as Unity reads them back: each in [0, 360), with a pitch of at most 90 degrees."""
    down, right, roll = (angle % 360 for angle in angles_deg)
    if 90 < down < 270:
        down, right, roll = (180 - down) % 360, (right + 180) % 360, (roll + 180) % 360
    return (down, right, roll)


@dataclass(slots=True)
class Result:
    """The result of the last action."""

    action: str = ""
    is_success: bool = True
    error_message: str = ""
    error_code: ErrorCode = ErrorCode.NONE
    action_return: object = None


@dataclass(slots=True)
class Engine:
    """One client's engine: a scene, an agent in it, and the requested images."""

    width_px: int = 300
    height_px: int = 300
    settings: EngineSettings = field(default_factory=EngineSettings)
    scene: Scene = field(default_factory=Scene)
    agent: AgentBody = field(default_factory=AgentBody)
    cameras: list[ThirdPartyCamera] = field(default_factory=list)
    """Third-party cameras, by their ids."""
    map_view: ThirdPartyCamera | None = None
    """The camera that `ToggleMapView` puts in place of the agent's."""
    map_view_size_m: float = -1.0
    """Half the height of the last map view, in metres."""
    object_filter: frozenset[str] | None = None
    """Ids of the objects that the metadata lists; `None` for all."""
    random_seed: int = 0
    """Seed of the session, by `SetRandomSeed`."""
    num_randomizations: int = 0
    """Number of random looks drawn since then."""
    last: Result = field(default_factory=Result)

    @property
    def state(self) -> tuple[object, ...]:
        """Everything that an event shows, except the last action: equal states give equal events."""
        agent = self.agent
        return (
            *(self.scene.version, self.width_px, self.height_px, self.settings, self.object_filter),
            *(agent.x_m, agent.y_m, agent.z_m, agent.yaw_deg, agent.horizon_deg, agent.is_standing, agent.body),
            *(self.map_view, self.map_view_size_m),
            *self.cameras,
        )

    @property
    def camera_position_m(self) -> tuple[float, float, float]:
        """Position of the agent's camera, `(x, y, z)`."""
        if self.map_view is not None:
            at = self.map_view.metadata()["position"]
            return (at["x"], at["y"], at["z"])
        return self.agent.camera.position_m

    def view(self, *, rgb: bool, instances: bool) -> Images:
        """Render the agent's camera, which crouching, a forced teleport or the map view may have moved."""
        if self.map_view is not None:
            return self.map_view.render(self.scene, rgb=rgb, instances=instances)
        return self.scene.simulator.render_camera(self.scene.seen_from(self.agent.camera), rgb=rgb, instances=instances)

    def execute(self, message: Mapping[str, Any]) -> Result:
        """Execute one action. Every failure becomes a failed action, never an exception."""
        name = registry.brief(message.get("action", ""))
        try:
            if message.get("agentId", 0) != 0:
                raise ActionError(f"agentId {registry.brief(message['agentId'])}: this engine has one agent, 0")
            self.last = Result(name, action_return=registry.call(self, message))
        except (ActionError, EvonavError) as error:
            code = error.code if isinstance(error, ActionError) else ErrorCode.NONE
            self.last = Result(name, False, _short(str(error)), code)
        except Exception as error:
            problem = f"{name} failed inside the engine: {type(error).__name__}: {error}"
            log_once(error, problem)
            self.last = Result(name, False, _short(problem))
        return self.last

    def configure(self) -> None:
        """Set the scene's camera and body by the settings and the screen."""
        body = self.agent.body
        self.scene.configure(
            SimulatorConfig(
                width_px=self.width_px,
                height_px=self.height_px,
                vertical_fov_deg=self.settings.fieldOfView or body.vertical_fov_deg,
                camera_height_m=body.camera_height_m,
                agent_radius_m=body.radius_m,
                agent_height_m=body.height_m,
                move_m=self.settings.gridSize,
                turn_deg=self.settings.rotateStepDegrees,
                grid_m=self.settings.gridSize,
            )
        )


def log_once(error: Exception, problem: str) -> None:
    """Log an internal error of the engine with its traceback, once for each line that raises."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    if (place.filename, place.lineno) not in _logged:
        _logged.add((place.filename, place.lineno))
        _LOG.error("%s", _short(problem), exc_info=error)


def _short(message: str) -> str:
    return message if len(message) <= _MAX_MESSAGE else message[:_MAX_MESSAGE] + " ..."
