"""Execute the client's actions one after another."""

import logging
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from evonav.errors import EvonavError
from evonav.thor.actions import registry
from evonav.thor.actions.registry import ActionError, Arguments, ErrorCode
from evonav.thor.agent import Agent
from evonav.thor.scene import Scene
from evonav.world.camera import Images
from evonav.world.simulator import SimulatorConfig

_LOG = logging.getLogger("evonav.thor")
# Maximal number of characters of an error message.
_MAX_MESSAGE = 4000
_logged: set[tuple[str, int | None]] = set()


class Settings(Arguments, extra="allow"):
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


class Camera(Protocol):
    """A third-party camera. It is immutable: a change replaces it."""

    def metadata(self) -> dict[str, Any]:
        """Return AI2-THOR's `ThirdPartyCameraMetadata`."""
        ...

    def render(self, scene: Scene, *, rgb: bool, instances: bool) -> Images:
        """Render the camera's view in the size of the screen; depth ends at its own far plane."""
        ...


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
    settings: Settings = field(default_factory=Settings)
    scene: Scene = field(default_factory=Scene)
    agent: Agent = field(default_factory=Agent)
    cameras: list[Camera] = field(default_factory=list)
    """Third-party cameras, by their ids."""
    map_view: Camera | None = None
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
