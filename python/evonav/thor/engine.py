"""The engine: does the client's actions one after another and says what the scene then looks like."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from evonav.errors import EvonavError
from evonav.thor import actions
from evonav.thor.actions import ActionError, ErrorCode, action
from evonav.thor.agent import Agent, body_of
from evonav.thor.scene import Document, Scene
from evonav.world.simulator import SimulatorConfig

_LOG = logging.getLogger("evonav.thor")

SCENES = ("Procedural",)
"""What `GetScenesInBuild` answers: iTHOR's and RoboTHOR's rooms are Unity scenes, which nothing here can draw."""


class Settings(BaseModel):
    """What `Initialize` sets, by AI2-THOR's names; the client passes its constructor's other keywords through."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False, frozen=True)

    agentMode: str = "default"
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


@dataclass(slots=True)
class Result:
    """What the last action did."""

    action: str = ""
    is_success: bool = True
    error_message: str = ""
    error_code: ErrorCode = ErrorCode.NONE
    action_return: object = None


@dataclass(slots=True)
class Engine:
    """One client's engine: a scene, an agent in it, and the images that are asked for."""

    width_px: int = 300
    height_px: int = 300
    settings: Settings = field(default_factory=Settings)
    scene: Scene = field(default_factory=Scene)
    agent: Agent = field(default_factory=Agent)
    last: Result = field(default_factory=Result)

    def execute(self, message: Mapping[str, Any]) -> Result:
        """Does one action. Whatever happens is an answer: a failed action, never an exception."""
        name = str(message.get("action", ""))
        try:
            self.last = Result(name, action_return=actions.call(self, message))
        except ActionError as error:
            self.last = Result(name, False, str(error), error.code)
        except EvonavError as error:
            self.last = Result(name, False, str(error))
        except Exception as error:
            _LOG.exception("action %s", name)
            self.last = Result(name, False, f"{name} failed inside the engine: {type(error).__name__}: {error}")
        return self.last

    def configure(self) -> None:
        """Brings the scene's camera and body in line with the settings and the screen."""
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


@action("Reset")
def reset(engine: Engine, *, sceneName: str = "Procedural") -> None:
    """Drops the scene and starts an empty one."""
    if sceneName not in SCENES:
        raise ActionError(f"scene {sceneName!r} is not in this build, which holds {', '.join(SCENES)}")
    engine.scene, engine.agent, engine.settings = Scene(sceneName), Agent(), Settings()
    engine.configure()


@action("GetScenesInBuild")
def get_scenes_in_build(engine: Engine) -> list[str]:
    """Names that `Reset` takes."""
    return list(SCENES)


@action("CreateHouse")
def create_house(engine: Engine, *, house: Document) -> None:
    """Loads a ProcTHOR house."""
    engine.scene.load(house)
    engine.agent.enter(house)


def check_settings(settings: Settings) -> None:
    """What AI2-THOR's `Initialize` asks of its arguments, in its words."""
    if settings.fieldOfView is not None and (settings.fieldOfView < 0 or settings.fieldOfView >= 180):
        raise ActionError("fov must be set to (0, 180) noninclusive.")
    if settings.rotateStepDegrees <= 0:
        raise ActionError("rotateStepDegrees must be a non-zero, non-negative float")
    if settings.snapToGrid and settings.rotateStepDegrees % 90 != 0:
        raise ActionError(
            f"Invalid values 'rotateStepDegrees': ${settings.rotateStepDegrees:g} and 'snapToGrid':$True. "
            "'snapToGrid': 'True' is not supported when 'rotateStepDegrees' is different from grid rotation steps of "
            "0, 90, 180, 270 or 360."
        )
    if settings.maxDownwardLookAngle < 0:
        raise ActionError("maxDownwardLookAngle must be a non-negative float")
    if settings.maxUpwardLookAngle < 0:
        raise ActionError("maxUpwardLookAngle must be a non-negative float")
    if not 0 < settings.gridSize <= 5:
        raise ActionError("grid size must be in the range (0,5]")


@action("Initialize")
def initialize(engine: Engine, **settings: Any) -> dict[str, float]:  # noqa: ANN401
    """Sets the settings; any keyword of the client's constructor may come."""
    try:
        wanted = Settings(**settings)
    except ValidationError as error:
        raise ActionError(f"Initialize: {error}", ErrorCode.INVALID_ARGUMENT) from error
    check_settings(wanted)
    engine.agent.body = body_of(wanted.agentMode, wanted.maxUpwardLookAngle, wanted.maxDownwardLookAngle)
    engine.settings = wanted
    engine.configure()
    return {"cameraNearPlane": 0.1, "cameraFarPlane": 20.0}
