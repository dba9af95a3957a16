"""What an agent receives each decision round. No simulator id, no oracle field."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics


@dataclass(frozen=True, slots=True)
class Detections:
    """Objects found in one image. Detection `i` is where `masks == i`; numbering means nothing across views."""

    masks: NDArray[np.int32]
    """`(H, W)`, -1 where nothing was detected."""
    labels: tuple[str, ...]
    """A word per detection; under ground truth, ProcTHOR's object type."""
    confidences: NDArray[np.float32]
    """`(N,)` in 0..1."""
    features: NDArray[np.float32] | None = None
    """`(N, D)` unit image features (CLIP), when the perception has them."""


@dataclass(frozen=True, slots=True)
class VisibleOccupancy:
    """Cells of the oracle occupancy that rays from a camera pose reach: free ones and each ray's first blocked one."""

    free: NDArray[np.int32]
    """`(F, 2)` `[row, col]`, sorted."""
    blocked: NDArray[np.int32]
    """`(B, 2)` `[row, col]`, sorted."""


@dataclass(frozen=True, slots=True)
class View:
    """One camera pose's worth of sensing."""

    pose: Pose
    """The camera's pose, as in `Frame`: `y_m` is the height of its optical centre over the floor, whereas that of
    `Observation.pose` is the height of the agent's body."""
    intrinsics: Intrinsics
    depth_m: NDArray[np.float32]
    """`(H, W)` planar z, `inf` where nothing is."""
    detections: Detections
    occupancy: VisibleOccupancy
    rgb: NDArray[np.uint8] | None = None
    """`(H, W, 3)`; `None` when the agent declared that it needs none."""


@dataclass(frozen=True, slots=True)
class MapFrame:
    """Shape and place of the occupancy grid that `VisibleOccupancy` indexes; the same for all stages of a task."""

    rows: int
    cols: int
    cell_m: float
    corner_m: tuple[float, float]
    """`(x, z)` of the smallest corner of cell (0, 0)."""


@dataclass(frozen=True, slots=True)
class Observation:
    """One decision round: views around the agent, the heading view last."""

    views: tuple[View, ...]
    pose: Pose
    """The agent's own pose after the last action."""
    is_action_success: bool
    """Whether the last action was carried out as asked."""
    num_rounds_left: int
    """Decision rounds left in this stage, this one included."""
    has_arrived: bool = False
    """Whether the last action was a `NavigateTo` that reached its (snapped) point."""
    is_guided: bool = False
    """The evaluator walks in this stage and carries out no answer: look, remember, and draw no conclusion from where
    the last action should have led."""
    goal_feature: NDArray[np.float32] | None = None
    """`(D,)` unit text feature of the stage's instruction, comparable with `Detections.features`, when the perception
    has such."""
