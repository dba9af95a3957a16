"""Define the settings of an environment: camera, actions, observations, reward."""

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

from evonav.errors import InvalidArgumentError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.world.simulator import Action, SimulatorConfig

ActionMode = Literal["actions", "waypoints"]
WaypointFrame = Literal["relative", "polar", "start"]
Reward = Literal["sparse", "spl", "progress"]

OBSERVATIONS = (
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
)
"""Keys that an observation may have; docs/gym.md describes them."""
ACTIONS = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT, Action.STOP)
"""Discrete actions by number: AI2-THOR's MoveAhead, RotateLeft and RotateRight, and the end of the stage."""
STOP = ACTIONS.index(Action.STOP)

STEP_COST = 0.01
SUCCESS_REWARD = 2.5
"""Reward of a success under `progress`: the value of habitat's point goal task."""


@dataclass(frozen=True, slots=True)
class NavConfig:
    """Settings of an environment; `gymnasium.make` takes them by name."""

    action_mode: ActionMode = "actions"
    """`actions`: one of `ACTIONS` a step. `waypoints`: a point to approach along the planner's waypoints."""
    waypoint_frame: WaypointFrame = "relative"
    """Meaning of the point's two numbers; see `evonav.gym.spaces.waypoint_m`."""
    waypoint_range_m: float = 5.0
    """Length in metres of a number of 1."""
    observations: tuple[str, ...] = tuple(name for name in OBSERVATIONS if name != "semantic")
    width_px: int = 128
    height_px: int = 128
    hfov_deg: float = 90.0
    """Horizontal field of view in degrees."""
    turn_deg: float = SimulatorConfig().turn_deg
    move_m: float = SimulatorConfig().move_m
    max_steps: int | None = None
    """Number of steps of a stage; by default the protocol's, 500 actions or 50 waypoint rounds."""
    success_radius_m: float = ProtocolConfig().success_radius_m
    reward: Reward = "progress"
    reference_image_px: int = 300
    """Side of `reference_image` in pixels; images of another size are resampled."""
    allow_unknown_assets: bool = False
    """Whether to draw assets that the catalogue lacks in the usual size of their category, not to refuse the house."""
    oracle_info: bool = False
    """Whether `info["oracle"]` contains the target. For debugging and imitation, never for evaluation."""
    protocol: ProtocolConfig = field(default=ProtocolConfig(), repr=False)

    def __post_init__(self) -> None:
        """Check what the simulator does not.

        Raises:
            InvalidArgumentError: A setting is out of range.
        """
        for name, choices in (("action_mode", ActionMode), ("waypoint_frame", WaypointFrame), ("reward", Reward)):
            if getattr(self, name) not in get_args(choices):
                expected = ", ".join(get_args(choices))
                raise InvalidArgumentError(f"argument `{name}` is {getattr(self, name)!r}, expected one of {expected}")
        unknown = [name for name in self.observations if name not in OBSERVATIONS]
        if unknown or not self.observations:
            expected = ", ".join(OBSERVATIONS)
            raise InvalidArgumentError(f"argument `observations` holds {unknown!r}, expected some of {expected}")
        for name, low, high in (
            ("width_px", 1, 8192),
            ("height_px", 1, 8192),
            ("hfov_deg", 1.0, 170.0),
            ("turn_deg", 1.0, 180.0),
            ("move_m", 0.01, 10.0),
            ("success_radius_m", 0.01, 100.0),
            ("waypoint_range_m", 0.01, 100.0),
            ("reference_image_px", 1, 4096),
        ):
            if not low <= getattr(self, name) <= high:
                raise InvalidArgumentError(f"argument `{name}` is {getattr(self, name)}, expected {low} to {high}")
        if self.max_steps is not None and not 1 <= self.max_steps <= 1_000_000:
            raise InvalidArgumentError(f"argument `max_steps` is {self.max_steps}, expected 1 to 1000000")

    @property
    def simulator(self) -> SimulatorConfig:
        """Camera, body and steps."""
        vertical_fov_deg = self.hfov_deg
        if self.width_px != self.height_px:
            slope = math.tan(math.radians(self.hfov_deg) / 2.0) * self.height_px / self.width_px
            vertical_fov_deg = math.degrees(2.0 * math.atan(slope))
        return SimulatorConfig(
            width_px=self.width_px,
            height_px=self.height_px,
            vertical_fov_deg=vertical_fov_deg,
            move_m=self.move_m,
            turn_deg=self.turn_deg,
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

    def has(self, name: str) -> bool:
        """Return whether an observation has a key."""
        return name in self.observations
