"""From the simulator to what an agent receives: views on its schedule, without ids and without the oracle."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from evonav.agents.agent import Sensing, ViewSchedule
from evonav.sensors.observation import Detections, MapFrame, Observation, View
from evonav.sensors.visibility import visible_occupancy
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, OccupancyGrid, SceneObject, Simulator


class Perception(Protocol):
    """Turns a rendered frame into detections."""

    def detect(self, frame: Frame, objects: Sequence[SceneObject]) -> Detections:
        """Objects in the frame, without their ids."""
        ...


def view_yaws_rad(schedule: ViewSchedule, heading_rad: float) -> list[float]:
    """Camera yaws of a round: left to right without the heading, then the heading."""
    first = -(schedule.count - 1) / 2.0
    offsets = [(first + i) * schedule.spacing_deg for i in range(schedule.count)]
    heading = min(offsets, key=abs)
    offsets.remove(heading)
    return [heading_rad + math.radians(offset) for offset in (*offsets, heading)]


def map_frame(grid: OccupancyGrid) -> MapFrame:
    """Shape and place of the occupancy grid."""
    rows, cols = grid.cells.shape
    return MapFrame(rows=rows, cols=cols, cell_m=grid.cell_m, corner_m=grid.corner_m)


@dataclass(frozen=True, slots=True)
class Sensed:
    """One round's observation, and what the evaluator alone learns from it."""

    observation: Observation
    is_target_visible: bool


class Sensors:
    """An agent's sensors in one stage's house."""

    def __init__(
        self,
        simulator: Simulator,
        perception: Perception,
        sensing: Sensing,
        target_id: str,
        min_visible_px: int,
    ) -> None:
        self._simulator = simulator
        self._perception = perception
        self._sensing = sensing
        self._objects = simulator.objects
        self._grid = simulator.occupancy()
        ids = [body.id for body in self._objects]
        self._target_instance = ids.index(target_id) + 1 if target_id in ids else None
        self._min_visible_px = min_visible_px

    def observe(
        self,
        *,
        is_first: bool,
        num_rounds_left: int,
        is_action_success: bool = True,
        has_arrived: bool = False,
        is_guided: bool = False,
    ) -> Sensed:
        """Looks around from the agent's pose."""
        pose = self._simulator.pose
        schedule = self._sensing.first_round if is_first else self._sensing.later_rounds
        views, is_target_visible = [], False
        for yaw_rad in view_yaws_rad(schedule, pose.yaw_rad):
            view, sees_target = self._look(replace(pose, yaw_rad=yaw_rad))
            views.append(view)
            is_target_visible |= sees_target
        observation = Observation(
            views=tuple(views),
            pose=pose,
            is_action_success=is_action_success,
            num_rounds_left=num_rounds_left,
            has_arrived=has_arrived,
            is_guided=is_guided,
        )
        return Sensed(observation, is_target_visible)

    def _look(self, pose: Pose) -> tuple[View, bool]:
        frame = self._simulator.render(pose, rgb=self._sensing.needs_rgb, instances=True)
        occupancy = visible_occupancy(self._grid, pose, frame.intrinsics, self._sensing.occupancy_range_m)
        view = View(
            pose=frame.pose,
            intrinsics=frame.intrinsics,
            depth_m=frame.depth_m,
            detections=self._perception.detect(frame, self._objects),
            occupancy=occupancy,
            rgb=frame.rgb,
        )
        if self._target_instance is None or frame.instances is None:
            return view, False
        return view, int((frame.instances == self._target_instance).sum()) >= self._min_visible_px
