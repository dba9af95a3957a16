"""An agent's input in a decision round, without simulator ids and oracle data."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav._core import RunImage
from evonav.world.pose import Pose
from evonav.world.run_images import unexpanded, with_run_images
from evonav.world.simulator import Intrinsics


@with_run_images("masks")
@dataclass(frozen=True, slots=True)
class Detections:
    """Objects found in one image. Detection `i` covers `masks == i`; its number means nothing in other views."""

    masks: NDArray[np.int32] = field(repr=False)
    """`(H, W)` index of the detection, -1 where nothing was detected."""
    labels: tuple[str, ...]
    """The detections' labels; with perfect perception, ProcTHOR's object types."""
    confidences: NDArray[np.float32] = field(repr=False)
    """`(N,)` confidences, 0 to 1."""
    features: NDArray[np.float32] | None = field(default=None, repr=False)
    """`(N, D)` unit image features (CLIP), if the perception computes them."""

    if TYPE_CHECKING:

        @property
        def stored_masks(self) -> NDArray[np.int32] | RunImage:
            """The masks as they are stored, perhaps as runs of equal pixels; the core takes both."""

    def taken(self, indices: Sequence[int]) -> "Detections":
        """Return some of the detections, renumbered in the order given; the pixels of the others become -1."""
        taken = list(indices)
        if taken == list(range(len(self.labels))):
            return self
        numbers = np.full(len(self.labels), -1, np.int32)
        numbers[taken] = np.arange(len(taken), dtype=np.int32)
        return Detections(
            masks=unexpanded(_core.renumber_masks(self.stored_masks, numbers)),
            labels=tuple(self.labels[index] for index in taken),
            confidences=self.confidences[taken],
            features=None if self.features is None else self.features[taken],
        )


@dataclass(frozen=True, slots=True)
class VisibleOccupancy:
    """Cells of the oracle occupancy that rays from a camera pose reach: free ones and each ray's first blocked one."""

    free: NDArray[np.int32] = field(repr=False)
    """`(F, 2)` free cells `[row, col]`, sorted."""
    blocked: NDArray[np.int32] = field(repr=False)
    """`(B, 2)` blocked cells `[row, col]`, sorted."""


NO_OCCUPANCY = VisibleOccupancy(np.empty((0, 2), np.int32), np.empty((0, 2), np.int32))
"""The occupancy of views that have none."""


@dataclass(frozen=True, slots=True)
class View:
    """The sensor data of one camera pose."""

    pose: Pose
    """Pose of the camera itself, as in `Frame`.

    Its `y_m` is the height of the optical centre above the floor; that of `Observation.pose` is the body's.
    """
    intrinsics: Intrinsics
    depth_m: NDArray[np.float32] = field(repr=False)
    """`(H, W)` planar depth in metres, `inf` where nothing is."""
    detections: Detections
    occupancy: VisibleOccupancy
    rgb: NDArray[np.uint8] | None = field(default=None, repr=False)
    """`(H, W, 3)` colours; `None` if the agent declared that it does not need them."""


@dataclass(frozen=True, slots=True)
class MapFrame:
    """Shape and place of the occupancy grid that `VisibleOccupancy` indexes; the same for all stages of a task."""

    rows: int
    cols: int
    cell_m: float
    corner_m: tuple[float, float]
    """`(x, z)` of the smallest corner of cell (0, 0)."""

    def centre_m(self, row: float, col: float) -> tuple[float, float]:
        """Return the middle of a cell, `(x, z)`."""
        return (self.corner_m[0] + (col + 0.5) * self.cell_m, self.corner_m[1] + (row + 0.5) * self.cell_m)

    def centres_m(self, cells: NDArray[np.integer[Any]]) -> NDArray[np.float64]:
        """Return the middles `(..., 2)`, `(x, z)`, of cells `(..., 2)`, row and column."""
        return np.ascontiguousarray((cells[..., ::-1] + 0.5) * self.cell_m + np.array(self.corner_m))

    def cells_at(self, places_m: NDArray[np.floating[Any]]) -> NDArray[np.int64]:
        """Return row and column `(..., 2)` of the cells at places `(..., 2)`, `(x, z)`; they may be off the map."""
        xz = np.floor((places_m - np.array(self.corner_m)) / self.cell_m).astype(np.int64)
        return np.ascontiguousarray(xz[..., ::-1])

    def cell_at(self, place_m: tuple[float, float]) -> tuple[int, int]:
        """Return row and column of the cell at `(x, z)`, or of the nearest one."""
        row, col = ((place_m[axis] - self.corner_m[axis]) / self.cell_m for axis in (1, 0))
        return min(max(int(row), 0), self.rows - 1), min(max(int(col), 0), self.cols - 1)


@dataclass(frozen=True, slots=True)
class Observation:
    """The input of one decision round: views around the agent, the heading view last.

    Examples:
        >>> import evonav
        >>> simulator = evonav.Simulator(evonav.load_houses()[0])
        >>> view = simulator.look()
        >>> observation = evonav.Observation((view,), simulator.pose, is_action_success=True, num_rounds_left=50)
        >>> observation.views[-1].depth_m.shape
        (300, 300)
    """

    views: tuple[View, ...]
    pose: Pose
    """The agent's own pose after the last action."""
    is_action_success: bool
    """Whether the last action succeeded."""
    num_rounds_left: int
    """Decision rounds left in this stage, this one included."""
    has_arrived: bool = False
    """Whether the last action was a `NavigateTo` that reached its (snapped) point."""
    is_guided: bool = False
    """Whether the evaluator moves the agent in this stage and ignores its answers.

    The agent must look and remember, and must not expect the effects of its own actions.
    """
    goal_feature: NDArray[np.float32] | None = field(default=None, repr=False)
    """`(D,)` unit text feature of the stage's instruction, if the perception computes one.

    It is comparable with `Detections.features`.
    """
