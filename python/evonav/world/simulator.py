"""The simulator protocol, which AI2-THOR and the embedded simulator implement."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from evonav._core import RunImage
from evonav.world.pose import Pose, canonical_at, moved, turned
from evonav.world.run_images import with_run_images


class Action(Enum):
    """Discrete actions, as the paper spells them (Sec. 3.1).

    Examples:
        >>> import evonav
        >>> [action.value for action in evonav.Action]
        ['MOVE_FORWARD', 'TURN_LEFT', 'TURN_RIGHT', 'STOP']
    """

    MOVE_FORWARD = "MOVE_FORWARD"
    TURN_LEFT = "TURN_LEFT"
    TURN_RIGHT = "TURN_RIGHT"
    STOP = "STOP"


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Pinhole camera; pixel centres at half-integers."""

    width_px: int
    height_px: int
    vertical_fov_rad: float

    @property
    def focal_px(self) -> float:
        """Focal length, the same along both axes."""
        return self.height_px / 2.0 / float(np.tan(self.vertical_fov_rad / 2.0))


def vertical_fov_deg(horizontal_deg: float, width_px: int, height_px: int) -> float:
    """Return the vertical field of view, in degrees, of an image with a horizontal one."""
    if width_px == height_px:
        return horizontal_deg
    return math.degrees(2.0 * math.atan(math.tan(math.radians(horizontal_deg) / 2.0) * height_px / width_px))


Style = Literal["plain", "default"]
"""A way to draw colours.

`plain`: flat colours with dark corners, the cheapest. `default`: lit surfaces with smooth edges, for people, and for
models trained on photographs.
"""


@dataclass(frozen=True, slots=True)
class SimulatorConfig:
    """Camera, body and steps: AI2-THOR's defaults, with the paper's 15 degree turns (Sec. C.3)."""

    width_px: int = 300
    height_px: int = 300
    vertical_fov_deg: float = 90.0
    near_m: float = 0.1
    far_m: float = 20.0
    """Planar depths between which surfaces are visible; elsewhere depth is `inf` and the instance 0."""
    camera_height_m: float = 1.575
    move_m: float = 0.25
    turn_deg: float = 15.0
    agent_radius_m: float = 0.2
    agent_height_m: float = 1.8
    grid_m: float = 0.25
    """Spacing of `reachable_positions`, in metres."""
    occupancy_cell_m: float = 0.1
    """Edge of a cell of the oracle occupancy, in metres."""
    style: Style = "default"
    """Way in which colours are drawn; depth and instances do not depend on it. AI2-THOR has one of its own."""

    @property
    def intrinsics(self) -> Intrinsics:
        """The camera's intrinsics."""
        return Intrinsics(self.width_px, self.height_px, math.radians(self.vertical_fov_deg))

    def standing(self, pose: Pose) -> Pose:
        """Return a pose, its angles canonical, at the height of the middle of a standing body."""
        return canonical_at(self.agent_height_m / 2, pose)

    def on_floor(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `(N, 3)` positions of the agent at `(N, 2)` points, `(x, z)`."""
        ground_m = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        positions_m = np.full((len(ground_m), 3), self.agent_height_m / 2)
        positions_m[:, ::2] = ground_m
        return positions_m

    def stepped(self, pose: Pose, action: Action) -> Pose:
        """Return the pose that an action leads to if nothing is in the way."""
        if action is Action.MOVE_FORWARD:
            x_m = pose.x_m + self.move_m * math.sin(pose.yaw_rad)
            return moved(pose, x_m, pose.z_m + self.move_m * math.cos(pose.yaw_rad), pose.yaw_rad)
        turn_rad = {Action.TURN_LEFT: -1.0, Action.TURN_RIGHT: 1.0}.get(action, 0.0) * math.radians(self.turn_deg)
        return turned(pose, pose.yaw_rad + turn_rad).canonical()


@with_run_images("instances")
@dataclass(frozen=True, slots=True)
class Frame:
    """A simulator's images at one camera pose. It contains instance ids, so it is for evaluators only."""

    pose: Pose
    """Pose of the camera itself: `y_m` is its optical centre's height (`config.camera_height_m`), not the agent's."""
    intrinsics: Intrinsics
    depth_m: NDArray[np.float32]
    """`(H, W)` planar depth in metres, `inf` where nothing is between `config.near_m` and `config.far_m`."""
    rgb: NDArray[np.uint8] | None = None
    """`(H, W, 3)` colours; `None` if not requested."""
    instances: NDArray[np.int32] | None = None
    """`(H, W)` instance ids: 0 where nothing is, else 1 + index of the `SceneObject`; `None` if not requested."""

    if TYPE_CHECKING:

        @property
        def stored_instances(self) -> NDArray[np.int32] | RunImage | None:
            """The instances as they are stored, perhaps as runs of equal pixels; the core takes both."""


@dataclass(frozen=True, slots=True)
class OccupancyGrid:
    """Cells on the ground plane, `[row = z, col = x]`."""

    cells: NDArray[np.uint8]
    """`(R, C)`: 0 where the agent's body reaches the cell's centre from the house's start, 1 elsewhere."""
    cell_m: float
    corner_m: tuple[float, float]
    """`(x, z)` of the smallest corner of cell (0, 0)."""


@dataclass(frozen=True, slots=True)
class SceneObject:
    """A body of the world; its instance id is its index + 1. Oracle data."""

    id: str
    category: str
    kind: str
    """Kind: `object`, `wall`, `floor`, `ceiling`, `door` or `window`."""
    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]


class Simulator(Protocol):
    """A simulator of one house at a time; `evonav.world.check.check_simulator` tests an implementation.

    Agent poses and positions that it returns have AI2-THOR's height, the middle of the body (`config.agent_height_m /
    2`). It ignores the heights of those that it is given.
    """

    config: SimulatorConfig

    def reset(self, house_json: str, pose: Pose | None = None) -> Pose:
        """Load a house; the agent stands at `pose`, or at the house's own start. Return the effective pose."""
        ...

    @property
    def pose(self) -> Pose:
        """The agent's pose."""
        ...

    @property
    def objects(self) -> Sequence[SceneObject]:
        """Bodies in instance order (instance id = index + 1)."""
        ...

    def step(self, action: Action) -> bool:
        """Execute one discrete action; `False`, and the pose unchanged, when it collides."""
        ...

    def teleport(self, pose: Pose) -> bool:
        """Set the pose; `False`, and the pose unchanged, when it is not free."""
        ...

    def render(self, pose: Pose | None = None, *, rgb: bool = True, instances: bool = True) -> Frame:
        """Render the camera's view from `pose` (default: the agent's own).

        The camera is `config.camera_height_m` above the floor, whatever `pose.y_m`. Colours cost more than the rest
        together: pass `rgb=False` unless they are needed.
        """
        ...

    def reachable_positions(self) -> NDArray[np.float64]:
        """Return the positions of the grid that the agent can reach from its place: `(N, 3)`, x, y, z in metres."""
        ...

    def nearest_reachable_position(self, position_m: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return the reachable position nearest on the ground plane."""
        ...

    def is_free(self, position_m: tuple[float, float, float]) -> bool:
        """Return whether the agent's body fits at the position and it is connected to the reachable floor."""
        ...

    def shortest_path(
        self, start_m: tuple[float, float, float], target_m: tuple[float, float, float]
    ) -> NDArray[np.float64]:
        """Return the geodesic's `(M, 3)` corners, `(0, 3)` without one; both ends move to the nearest free point."""
        ...

    def occupancy(self) -> OccupancyGrid:
        """Return the oracle occupancy at `config.occupancy_cell_m`."""
        ...

    def close(self) -> None:
        """Release everything; safe to call twice."""
        ...
