"""OneMap (Busch et al., ICRA 2025): one map of what all cells show, kept over goals, and looked at again by each."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.agents.frontier_update.agent import FrontierUpdateConfig
from evonav.agents.grid import numbered
from evonav.agents.navigator import WITH_FALLBACK, Navigator, NavigatorConfig
from evonav.agents.rivals.exploration import SAME_M, OwnExploration, Place, Pursuit
from evonav.agents.rivals.relatedness import Feature, Relatedness
from evonav.memory import Frontier
from evonav.points import Point2
from evonav.sensors.observation import MapFrame, Observation, View
from evonav.tasks.public import Goal
from evonav.world.camera import thinned, unproject
from evonav.world.simulator import Intrinsics

BACKGROUND = ""
"""The label of pixels without a detection."""


@dataclass(frozen=True, slots=True)
class OneMapConfig(FrontierUpdateConfig):
    """OneMap's constants."""

    navigator: NavigatorConfig = WITH_FALLBACK
    stride_px: int = 5
    """Every such pixel of every such row counts, if the size of the image allows it; ours."""
    gradient_factor: float = 0.2
    """Steepness with which a gradient of depth lowers the weight of a pixel."""
    best_depth_m: float = 1.0
    """Depth at which a pixel has the largest weight..."""
    depth_spread_m: float = 1.5
    """...and the distance from it over which the weight falls."""
    min_weight: float = 1e-5
    """A pixel with a smaller weight does not count."""
    max_uncertainty: float = 0.2
    """A cell is explored, or checked, when 1 over the sum of its weights is below this."""
    cluster_share: float = 0.8
    """Cells of a cluster have at least this share of the largest similarity."""
    min_cluster_cells: int = 2
    """Smallest number of cells of a cluster."""
    frontier_margin_m: float = 0.5
    """Unexplored cells this near a frontier's region count for its value; ours."""


class LabelMap:
    """Weights of the labels that each cell shows, over all goals; OneMap has the mean of image features in their place.

    The similarity of a cell to a goal is the weighted mean of what its labels have to do with it.
    """

    def __init__(self, frame: MapFrame, config: OneMapConfig) -> None:
        self.config = config
        self._frame = frame
        self._numbers: dict[str, int] = {BACKGROUND: 0}
        self._sums = np.zeros((8, frame.rows * frame.cols), np.float32)
        self._confidence = np.zeros(frame.rows * frame.cols)
        self._checked = np.zeros(frame.rows * frame.cols)
        self._features: dict[str, Feature] = {}

    @property
    def explored(self) -> NDArray[np.bool_]:
        """`(R, C)` cells that were seen well enough in any stage."""
        return self._is_certain(self._confidence)

    @property
    def checked(self) -> NDArray[np.bool_]:
        """`(R, C)` cells that were seen well enough for the present goal."""
        return self._is_certain(self._checked)

    def begin_goal(self) -> None:
        """Clear what was checked: every goal may look at every place again. What the cells show stays."""
        self._checked[:] = 0.0

    def see(self, view: View) -> None:
        """Take in the surfaces of a view."""
        config, frame = self.config, self._frame
        depth_m, intrinsics, taken = thinned(view.depth_m, view.intrinsics, config.stride_px)
        masks = view.detections.masks[taken, taken]
        weights = pixel_weights(depth_m, intrinsics, config)
        points_m = unproject(depth_m, view.pose, intrinsics)
        with np.errstate(invalid="ignore"):
            cols = np.floor((points_m[..., 0] - frame.corner_m[0]) / frame.cell_m)
            rows = np.floor((points_m[..., 2] - frame.corner_m[1]) / frame.cell_m)
            counts = (weights > config.min_weight) & (rows >= 0) & (rows < frame.rows)
            counts &= (cols >= 0) & (cols < frame.cols)
        flat = (rows[counts] * frame.cols + cols[counts]).astype(np.int64)
        labels = self._label_numbers(view)[masks[counts]]
        share = weights[counts] / np.bincount(flat, minlength=len(self._confidence))[flat]
        np.add.at(self._sums, (labels, flat), share.astype(np.float32))
        seen = np.bincount(flat, share, minlength=len(self._confidence))
        self._confidence += seen
        self._checked += seen

    def similarity(self, related: Relatedness) -> NDArray[np.float64]:
        """Return `(R, C)`: how much each cell has to do with a goal; 0 for one that was never seen."""
        scores = np.zeros(len(self._sums), np.float32)
        for label, number in self._numbers.items():
            scores[number] = related.of(label, self._unit_feature(label)) if label else 0.0
        sums = (scores @ self._sums).astype(np.float64)
        found = np.divide(sums, self._confidence, out=np.zeros_like(sums), where=self._confidence > 0.0)
        return found.reshape(self._frame.rows, self._frame.cols)

    def _label_numbers(self, view: View) -> NDArray[np.int64]:
        """Return the number of each detection's label; the last one is the background's, so index -1 finds it."""
        detections = view.detections
        for index, label in enumerate(detections.labels):
            self._numbers.setdefault(label, len(self._numbers))
            if detections.features is not None:
                feature = detections.features[index]
                self._features[label] = self._features[label] + feature if label in self._features else feature
        while len(self._numbers) > len(self._sums):
            self._sums = np.concatenate([self._sums, np.zeros_like(self._sums)])
        return np.array([*(self._numbers[label] for label in detections.labels), 0])

    def _unit_feature(self, label: str) -> Feature | None:
        """Return the direction of the mean feature of a label's detections."""
        total = self._features.get(label)
        length = 0.0 if total is None else float(np.linalg.norm(total))
        return None if total is None or length == 0.0 else total / np.float32(length)

    def _is_certain(self, sums: NDArray[np.float64]) -> NDArray[np.bool_]:
        return (sums * self.config.max_uncertainty > 1.0).reshape(self._frame.rows, self._frame.cols)


def pixel_weights(depth_m: NDArray[np.float32], intrinsics: Intrinsics, config: OneMapConfig) -> NDArray[np.float64]:
    """Return how certain the place of each pixel is: 1 at the best depth on a surface that faces the camera.

    Args:
        depth_m: `(H, W)` planar depth.

    Returns:
        `(H, W)` weights, 0 to 1; 0 where there is no depth.
    """
    is_finite = np.isfinite(depth_m)
    depth = np.where(is_finite, depth_m, depth_m[is_finite].max() if is_finite.any() else 0.0).astype(np.float64)
    by_row, by_col = np.gradient(depth) if min(depth.shape) > 1 else (np.zeros_like(depth), np.zeros_like(depth))
    by_row /= intrinsics.focal_px / intrinsics.height_px
    by_col /= intrinsics.focal_px / intrinsics.width_px
    flatness = 1.0 - np.tanh(config.gradient_factor * np.hypot(by_row, by_col))
    nearness = np.exp(-(((config.best_depth_m - depth) / config.depth_spread_m) ** 2) / 3.0)
    return np.where(is_finite, flatness * nearness, 0.0)


def clusters_of(
    similarity: NDArray[np.float64], is_open: NDArray[np.bool_], *, share: float, min_cells: int
) -> list[tuple[int, int, float]]:
    """Return the groups of the most similar cells.

    Args:
        similarity: `(R, C)`.
        is_open: `(R, C)` cells that may belong to a group.
        share: Least similarity in a group, relative to the largest one of all these cells.
        min_cells: Smallest number of cells of a group.

    Returns:
        Row, column and similarity of each group's most similar cell, the first of equals; by row and column.
    """
    largest = float(np.where(is_open, similarity, 0.0).max(initial=0.0))
    if largest <= 0.0 or not math.isfinite(largest):
        return []
    groups = numbered(is_open & (similarity >= share * largest), min_cells)
    found = []
    for number in range(int(groups.max(initial=-1)) + 1):
        inside = np.where(groups == number, similarity, -1.0)
        row, col = np.unravel_index(int(inside.argmax()), inside.shape)
        found.append((int(row), int(col), float(inside[row, col])))
    return found


class OneMap(OwnExploration):
    """Explores the frontier or the unchecked place with the largest similarity to the goal."""

    config: OneMapConfig = OneMapConfig()

    def _new_navigator(self) -> Navigator:
        navigator = super()._new_navigator()
        self._labels = LabelMap(self._task.map_frame, self.config)
        navigator.observers.append(lambda _, view, __: self._labels.see(view))
        return navigator

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal: nothing is checked for it yet."""
        super().begin_stage(goal)
        self._labels.begin_goal()
        self._pursuit = Pursuit()
        self._looked_at: list[Point2] = []
        """Clusters of this stage that the agent went to see."""

    def _after_look(self, observation: Observation) -> None:
        place = self._place
        is_done = observation.has_arrived or not observation.is_action_success
        if place is not None and place.frontier is None and is_done and self._pursuit.is_going_to(place):
            self._looked_at.append(place.face_m)

    def _place_to_explore(self, observation: Observation) -> Place | None:
        self._places = self._all_places()
        return self._pursuit.choice(self._places, (observation.pose.x_m, observation.pose.z_m))

    def _all_places(self) -> list[Place]:
        """Return all frontiers, and the clusters of similar cells that were not checked for this goal."""
        config, labels, frame = self.config, self._labels, self._task.map_frame
        similarity, explored = labels.similarity(self._related), labels.explored
        beyond = np.where(explored, 0.0, similarity)
        places = [
            Place(one.position_m, one.position_m, self._value_beyond(one, beyond), one)
            for one in self._navigator.explorer.frontiers
        ]
        is_open = explored & ~labels.checked
        for row, col, value in clusters_of(
            similarity, is_open, share=config.cluster_share, min_cells=config.min_cluster_cells
        ):
            middle_m = frame.centre_m(row, col)
            stand_m = self._navigator.observation_point(middle_m)
            if stand_m is not None and all(math.dist(middle_m, one) > SAME_M for one in self._looked_at):
                places.append(Place(stand_m, middle_m, value))
        return places

    def _value_beyond(self, frontier: Frontier, beyond: np.ndarray) -> float:
        """Return the largest similarity of the unexplored cells in and around a frontier's region."""
        margin = round(self.config.frontier_margin_m / self._task.map_frame.cell_m)
        lows, highs = frontier.cells.min(axis=0) - margin, frontier.cells.max(axis=0) + margin + 1
        low_row, low_col = np.maximum(lows, 0).tolist()
        high_row, high_col = highs.tolist()
        return float(beyond[low_row:high_row, low_col:high_col].max(initial=0.0))

    def _goes_to(self, place: Place, here: Point2) -> None:
        self._pursuit.go(place, self._places, here)
