"""Set up a session: scenes, houses, settings, image sizes."""

from dataclasses import replace

from evonav.errors import EvonavError
from evonav.thor import objects
from evonav.thor.actions.registry import ActionError, action
from evonav.thor.agent import AgentBody, body_of
from evonav.thor.engine import Engine, EngineSettings
from evonav.thor.events import scene_bounds
from evonav.thor.geometry import vector
from evonav.thor.images import FAR_M
from evonav.thor.scene import Document, Scene

SCENES = ("Procedural",)
"""Answer of `GetScenesInBuild`. The rooms of iTHOR and RoboTHOR are Unity scenes, which this engine cannot draw."""

NEAR_M = 0.1
"""Near plane of the agent's camera, in metres."""

_MAX_PX = 4096
_MIN_GRID_M = 0.01
# Images that AI2-THOR renders and this engine does not. Refused here, since a client without them would fail later.
_MISSING_IMAGES = ("renderNormalsImage", "renderFlowImage")


@action("Reset")
def reset(engine: Engine, *, sceneName: str = "Procedural") -> None:
    """Replace the scene by an empty one."""
    if sceneName not in SCENES:
        raise ActionError(f"scene {sceneName!r} is not in this build, which holds {', '.join(SCENES)}")
    engine.scene, engine.agent, engine.settings = Scene(sceneName), AgentBody(), EngineSettings()
    engine.cameras, engine.object_filter = [], None
    engine.map_view, engine.map_view_size_m = None, -1.0
    engine.configure()


@action("GetScenesInBuild")
def get_scenes_in_build(engine: Engine) -> list[str]:
    """Return the names that `Reset` accepts."""
    return list(SCENES)


@action("CreateHouse")
def create_house(engine: Engine, *, house: Document) -> None:
    """Load a ProcTHOR house; the scene stays as it is if that fails."""
    scene = Scene(engine.scene.name)
    scene.configure(engine.scene.config)
    # ProcTHOR's own generator loads houses that do not have metadata yet.
    house = {"metadata": {}, **house}
    scene.load(house)
    agent = replace(engine.agent)
    try:
        # The next event shows these records: a house without them is refused here.
        objects.static_records(scene)
        agent.enter(house)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise ActionError(f"CreateHouse: the house cannot be described: {type(error).__name__}: {error}") from error
    engine.scene, engine.agent = scene, agent


def check_settings(settings: EngineSettings) -> None:
    """Check settings as AI2-THOR's `Initialize` does, with its messages."""
    if settings.agentCount != 1:
        raise ActionError(f"agentCount {settings.agentCount}: this engine has one agent")
    for name in _MISSING_IMAGES:
        if getattr(settings, name):
            raise ActionError(f"{name} is not supported by this engine")
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
    if settings.gridSize < _MIN_GRID_M:
        raise ActionError(f"gridSize {settings.gridSize:g}: this engine's grids are {_MIN_GRID_M:g} m and coarser")


@action("Initialize")
def initialize(engine: Engine, wanted: EngineSettings) -> dict[str, float]:
    """Set the settings; any keyword of the client's constructor is accepted."""
    check_settings(wanted)
    body = body_of(wanted.agentMode, wanted.maxUpwardLookAngle, wanted.maxDownwardLookAngle)
    before = engine.settings, engine.agent.body
    engine.settings, engine.agent.body = wanted, body
    try:
        engine.configure()
        if engine.scene.house is not None:
            # A view that cannot be rendered is refused here, not by the next event.
            engine.view(rgb=False, instances=False)
    except EvonavError:
        engine.settings, engine.agent.body = before
        engine.configure()
        raise
    return {"cameraNearPlane": NEAR_M, "cameraFarPlane": FAR_M}


@action("ChangeResolution")
def change_resolution(engine: Engine, *, x: int, y: int) -> None:
    """Set the size of all images."""
    if not (0 < x <= _MAX_PX and 0 < y <= _MAX_PX):
        raise ActionError(f"ChangeResolution: {x} x {y} is not between 1 x 1 and {_MAX_PX} x {_MAX_PX}")
    engine.width_px, engine.height_px = x, y
    engine.configure()


@action("ChangeQuality")
def change_quality(engine: Engine, *, quality: str) -> None:
    """Do nothing: there is one quality."""


@action("GetSceneBounds")
def get_scene_bounds(engine: Engine) -> list[dict[str, float]]:
    """Return the largest and the smallest corner of the box around everything."""
    bounds = scene_bounds(engine.scene)
    if bounds is None:
        raise ActionError(f"scene {engine.scene.name} holds no house: call CreateHouse first")
    return [vector(bounds["cornerPoints"][corner]) for corner in (-1, 0)]
