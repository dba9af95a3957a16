"""From the simulator to what an agent receives: views on its schedule, without ids and without the oracle."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from evonav.agents.agent import Sensing, ViewSchedule
from evonav.evaluation.costs import Stopwatch
from evonav.evaluation.witness import Witness
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


class Sensors:
    """An agent's sensors in one stage's house."""

    def __init__(
        self,
        simulator: Simulator,
        perception: Perception,
        sensing: Sensing,
        witness: Witness | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        """Sensors at the simulator's pose, wherever it is.

        Args:
            simulator: With the stage's house.
            perception: Of the run.
            sensing: As granted.
            witness: Is shown every frame.
            stopwatch: Books what rendering and perceiving take.
        """
        self._simulator = simulator
        self._perception = perception
        self._sensing = sensing
        self._objects = simulator.objects
        self._grid = simulator.occupancy()
        self._witness = witness
        self._stopwatch = stopwatch or Stopwatch()

    def observe(
        self,
        *,
        is_first: bool,
        num_rounds_left: int,
        is_action_success: bool = True,
        has_arrived: bool = False,
        is_guided: bool = False,
    ) -> Observation:
        """Looks around from the agent's pose."""
        pose = self._simulator.pose
        schedule = self._sensing.first_round if is_first else self._sensing.later_rounds
        views = [self._look(replace(pose, yaw_rad=yaw_rad)) for yaw_rad in view_yaws_rad(schedule, pose.yaw_rad)]
        return Observation(
            views=tuple(views),
            pose=pose,
            is_action_success=is_action_success,
            num_rounds_left=num_rounds_left,
            has_arrived=has_arrived,
            is_guided=is_guided,
        )

    def _look(self, pose: Pose) -> View:
        with self._stopwatch.timing("simulation"):
            frame = self._simulator.render(pose, rgb=self._sensing.needs_rgb, instances=True)
        with self._stopwatch.timing("perception"):
            view = View(
                pose=frame.pose,
                intrinsics=frame.intrinsics,
                depth_m=frame.depth_m,
                detections=self._perception.detect(frame, self._objects),
                occupancy=visible_occupancy(self._grid, pose, frame.intrinsics, self._sensing.occupancy_range_m),
                rgb=frame.rgb,
            )
        if self._witness is not None:
            self._witness.look(frame)
        return view
