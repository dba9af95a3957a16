"""Define the settings of an environment (camera, actions, observations, reward), and check modes named by users."""

from typing import Any, Literal, get_args

import numpy as np
from gymnasium.vector import AutoresetMode
from pydantic import Field, ValidationError

from evonav.errors import InvalidArgumentError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.records import Record, sentence_of
from evonav.world.appearance import Change, Colors, Lighting, Materials
from evonav.world.simulator import Action, SimulatorConfig, Style, vertical_fov_deg

ActionMode = Literal["actions", "waypoints"]
WaypointFrame = Literal["relative", "polar", "start"]
Reward = Literal["sparse", "spl", "progress"]
StopMode = Literal["explicit", "automatic"]
RenderView = Literal["camera", "map"]
Randomized = Literal["materials", "lighting", "colors"]

ObservationName = Literal[
    "depth",
    "rgb",
    "semantic",
    "pose",
    "category",
    "instruction",
    "reference_image",
    "stage",
    "steps_left",
    "is_action_success",
    "has_arrived",
    "image",
    "state",
]
OBSERVATIONS: tuple[ObservationName, ...] = get_args(ObservationName)
"""Keys that an observation may have; docs/gym.md describes them."""
DEFAULT_OBSERVATIONS = tuple(name for name in OBSERVATIONS if name not in ("semantic", "image", "state"))
LEARN_OBSERVATIONS: tuple[ObservationName, ...] = ("image", "state", "category")
"""Meaning of `observations="learn"`: what learning libraries take without wrappers."""
LEARN_IMAGE_PX = 84
"""Width and height of the images of `observations="learn"`, unless they are given: the size of Atari's networks."""
ACTIONS = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT, Action.STOP)
"""Discrete actions by number: AI2-THOR's MoveAhead, RotateLeft and RotateRight, and the end of the stage."""
STOP = ACTIONS.index(Action.STOP)

RENDER_MODES = ("rgb_array",)
"""Modes of `render`. Gymnasium makes `rgb_array_list` and `human` of it, by wrappers of its own."""

STEP_COST = 0.01
SUCCESS_REWARD = 2.5
"""Reward of a success under `progress`: the value of habitat's point goal task."""


class NavConfig(Record, strict=False):
    """Settings of an environment; `gymnasium.make` takes them by name."""

    action_mode: ActionMode = "actions"
    """`actions`: one of `ACTIONS` a step. `waypoints`: a point to approach along the planner's waypoints."""
    waypoint_frame: WaypointFrame = "relative"
    """Meaning of the point's two numbers; see `evonav.gym.spaces.waypoint_m`."""
    waypoint_range_m: float = Field(5.0, ge=0.01, le=100.0)
    """Length in metres of a number of 1."""
    stop: StopMode = "explicit"
    """Way in which a stage ends before its steps are used up.

    `explicit`: the agent has an action for it, as in the benchmark. `automatic`: there is no such action, and a stage
    ends when the agent is within the success radius. That tells where the target is: for training only.
    """
    observations: tuple[ObservationName, ...] = Field(DEFAULT_OBSERVATIONS, min_length=1)
    """Keys of an observation, or `learn` for `LEARN_OBSERVATIONS` in images of `LEARN_IMAGE_PX`."""
    width_px: int = Field(128, ge=1, le=8192)
    height_px: int = Field(128, ge=1, le=8192)
    hfov_deg: float = Field(90.0, ge=1.0, le=170.0)
    """Horizontal field of view in degrees."""
    turn_deg: float = Field(SimulatorConfig().turn_deg, ge=1.0, le=180.0)
    move_m: float = Field(SimulatorConfig().move_m, ge=0.01, le=10.0)
    max_steps: int | None = Field(None, ge=1, le=1_000_000)
    """Number of steps of a stage; by default the protocol's, 500 actions or 50 waypoint rounds."""
    success_radius_m: float = Field(ProtocolConfig().success_radius_m, ge=0.01, le=100.0)
    style: Style = SimulatorConfig().style
    """Way in which the colours of `rgb` are drawn: `plain` (the fastest) or `default`."""
    randomize: tuple[Randomized, ...] = ()
    """Properties drawn again for each episode: `materials`, `lighting` (seen in the style `default`) or `colors`."""
    render_view: RenderView = "camera"
    """Picture that `render` gives: what the agent's `camera` sees, or a `map` of the house with path and target."""
    map_px: int = Field(400, ge=32, le=2048)
    """Side of the map in pixels."""
    reward: Reward = "progress"
    reference_image_px: int = Field(300, ge=1, le=4096)
    """Side of `reference_image` in pixels; images of another size are resampled."""
    allow_unknown_assets: bool = False
    """Whether to draw assets that the catalogue lacks in the usual size of their category, not to refuse the house."""
    oracle_info: bool = False
    """Whether `info["oracle"]` contains the target. For debugging and imitation, never for evaluation."""
    protocol: ProtocolConfig = Field(ProtocolConfig(), repr=False)

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - the fields
        """Check the settings.

        Raises:
            InvalidArgumentError: A setting does not exist, or is out of range.
        """
        if settings.get("observations") == "learn":
            side_px = {"width_px": LEARN_IMAGE_PX, "height_px": LEARN_IMAGE_PX}
            settings = side_px | settings | {"observations": LEARN_OBSERVATIONS}
        try:
            super().__init__(**settings)
        except ValidationError as error:
            raise InvalidArgumentError(f"argument {sentence_of(error)}") from None

    @property
    def simulator(self) -> SimulatorConfig:
        """Camera, body and steps."""
        return SimulatorConfig(
            width_px=self.width_px,
            height_px=self.height_px,
            vertical_fov_deg=vertical_fov_deg(self.hfov_deg, self.width_px, self.height_px),
            move_m=self.move_m,
            turn_deg=self.turn_deg,
            style=self.style,
        )

    @property
    def budget(self) -> int:
        """Number of steps of a stage."""
        if self.max_steps is not None:
            return self.max_steps
        return self.protocol.max_actions if self.action_mode == "actions" else self.protocol.max_rounds

    @property
    def min_mask_px(self) -> int:
        """Smallest number of pixels of an object in `semantic`: that of ground-truth perception."""
        perception = GroundTruthPerception()
        return max(perception.min_area_px, round(perception.min_area_fraction * self.width_px * self.height_px))

    def draw_appearance(self, random: np.random.Generator) -> tuple[Change, ...]:
        """Draw the look of an episode's house; none if nothing is randomised. `random` itself stays as it is."""
        if not self.randomize:
            return ()
        seed = int(random.spawn(1)[0].integers(2**63))
        kinds: dict[Randomized, type[Change]] = {"materials": Materials, "colors": Colors, "lighting": Lighting}
        return tuple(kind(seed=seed) for name, kind in kinds.items() if name in self.randomize)

    def has(self, name: str) -> bool:
        """Return whether an observation has a key."""
        return name in self.observations


def check_render_mode(mode: str | None) -> None:
    """Refuse a render mode that does not exist.

    Raises:
        InvalidArgumentError: It does not exist.
    """
    if mode is None or mode in RENDER_MODES:
        return
    hint = {
        "human": "; for a window use `gymnasium.make`, which opens one with pygame",
        "rgb_array_list": "; for a list of pictures use `gymnasium.make`",
        "camera": "; choose the picture with `render_view`",
        "map": "; choose the picture with `render_view`",
    }.get(mode, "")
    raise InvalidArgumentError(f"argument `render_mode` is {mode!r}, expected 'rgb_array' or None{hint}")


def checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Return the mode of a name.

    Raises:
        InvalidArgumentError: It is neither `NEXT_STEP` nor `SAME_STEP`.
    """
    expected = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
    for known in expected:
        if mode in (known, known.value):
            return known
    names = " or ".join(repr(known.value) for known in expected)
    raise InvalidArgumentError(f"argument `autoreset_mode` is {mode!r}, expected {names}")
