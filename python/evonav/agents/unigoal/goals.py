"""Track the goal from its first sight to its confirmation, or until its place is abandoned (docs/agents.md)."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from evonav.agents.unigoal.bev import BevMap, Cells
from evonav.agents.unigoal.planner import UniGoalPlanner
from evonav.memory.views import boxes_of
from evonav.points import Point2
from evonav.sensors.observation import View
from evonav.tasks.vocabulary import CATEGORY_OF_TYPE
from evonav.world.pose import Pose

CONFIRM_M = 0.15
"""A temporary goal is confirmed when the path to it, grown as the planner does, is shorter than this."""
REDETECT_M = 1.0
"""Nearer than this the goal has to be in view, or its place is abandoned."""
SAME_PLACE_M = 0.25
"""Detections with cells this near each other are of the same object."""


@dataclass(frozen=True, slots=True)
class Glimpse:
    """A place where the goal seems to be."""

    cells: Cells = field(compare=False, repr=False)
    centre_m: Point2
    """`(x, z)`: the mean of the cells."""
    source: Literal["detection", "graph"]
    node_id: int | None = None
    """Id of the matched node."""


class GoalWatch:
    """Temporary goal and confirmed goal of one stage; the planner stores the abandoned places."""

    def __init__(self, bev: BevMap, planner: UniGoalPlanner) -> None:
        self.temporary: Glimpse | None = None
        self.confirmed: Glimpse | None = None
        self.num_given_up = 0
        self._has_way = True
        self.is_in_view = False
        """True if the last view showed the goal's category or node."""
        self._bev = bev
        self._planner = planner

    @property
    def goal(self) -> Glimpse | None:
        """The confirmed goal, else the temporary one."""
        return self.confirmed or self.temporary

    def look(self, view: View, category: str | None, seen_ids: frozenset[int]) -> None:
        """Use a view's largest detection of the goal as the temporary goal.

        A temporary goal is replaced only by a detection of the same place, or if the map shows no path to it.
        Otherwise an agent that turns towards one chair would see another, and turn back, for ever.

        Args:
            seen_ids: Ids of the scene nodes in view.
        """
        mask = None if category is None else largest_detection(view, category)
        found = None if mask is None else self._glimpse(self._bev.core.cells_of(view, mask), "detection")
        is_node_seen = self.temporary is not None and self.temporary.node_id in seen_ids
        self.is_in_view = mask is not None or is_node_seen
        if self.confirmed is None and found is not None and self._gives_way(found):
            self.temporary = found

    def _gives_way(self, found: Glimpse) -> bool:
        present = self.temporary
        if present is None or present.source == "graph" or not self._has_way:
            return True
        around = self._bev.core.grown(present.cells, round(SAME_PLACE_M / self._bev.map_frame.cell_m))
        cols = self._bev.map_frame.cols
        return bool(np.isin(found.cells @ (cols, 1), around @ (cols, 1)).any())

    def pursue(self, node_id: int, cells: Cells) -> None:
        """Go for the node that was matched with the goal, if there is no other goal."""
        if self.goal is None:
            self.temporary = self._glimpse(cells, "graph", node_id)

    def _glimpse(
        self, cells: Cells, source: Literal["detection", "graph"], node_id: int | None = None
    ) -> Glimpse | None:
        """Return the cells that were not abandoned as a place; `None` if there are none."""
        allowed = self._planner.allowed(cells)
        if not len(allowed):
            return None
        row, col = allowed.mean(axis=0).tolist()
        return Glimpse(allowed, self._bev.map_frame.centre_m(row, col), source, node_id)

    def judge(self, pose: Pose) -> None:
        """Confirm the temporary goal at its place; abandon it if it should be in view and is not.

        A goal that is near, but has a long path, is behind something. The agent cannot come nearer: it is confirmed.
        """
        goal = self.temporary
        if goal is None or self.confirmed is not None:
            return
        straight_m = self._straight_m(pose, goal)
        if not self.is_in_view and straight_m <= REDETECT_M:
            self._planner.blacklist(goal.cells)
            self.num_given_up += 1
            self.temporary = None
            return
        way_m = self._planner.distance_m(pose, goal.cells)
        self._has_way = way_m is not None
        is_long = way_m is None or way_m > self._planner.config.detour_ratio * straight_m
        is_behind = is_long and straight_m < self._planner.config.detour_straight_m
        if is_behind or (way_m is not None and way_m < CONFIRM_M):
            self.confirmed, self.temporary = goal, None

    def _straight_m(self, pose: Pose, goal: Glimpse) -> float:
        middles_m = self._bev.map_frame.centres_m(goal.cells)
        return float(np.hypot(*(middles_m - (pose.x_m, pose.z_m)).T).min())


def largest_detection(view: View, category: str) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]] | None:
    """Return the pixels of a category's detection with the largest box.

    Args:
        view: A view whose detections are labelled with ProcTHOR's types.

    Returns:
        `(H, W)` mask; `None` without a detection that has a depth.
    """
    found = view.detections
    best: tuple[int, int] | None = None
    for index, (label, (_, (left, top, right, bottom))) in enumerate(zip(found.labels, boxes_of(found), strict=True)):
        box_px = (right - left) * (bottom - top)
        if CATEGORY_OF_TYPE.get(label) != category or box_px <= (0 if best is None else best[0]):
            continue
        if np.isfinite(view.depth_m[found.masks == index]).any():
            best = (box_px, index)
    return None if best is None else found.masks == best[1]
