"""Turn simulator frames into an agent's observations: views on its schedule, without ids and oracle data."""

import math
from dataclasses import replace

from evonav.agents.agent import SensorConfig, ViewSchedule
from evonav.evaluation.episode.staleness import StalenessTracker
from evonav.evaluation.records.costs import Stopwatch
from evonav.perception import Percept, Perception, StageScene
from evonav.sensors.observation import MapFrame, Observation, View
from evonav.sensors.visibility import visible_occupancy
from evonav.world.pose import Pose, turned
from evonav.world.simulator import Frame, OccupancyGrid, Simulator


def view_yaws_rad(schedule: ViewSchedule, heading_rad: float) -> list[float]:
    """Return the camera yaws of a round: left to right without the heading, then the heading."""
    first = -(schedule.count - 1) / 2.0
    offsets = [(first + i) * schedule.spacing_deg for i in range(schedule.count)]
    heading = min(offsets, key=abs)
    offsets.remove(heading)
    return [heading_rad + math.radians(offset) for offset in (*offsets, heading)]


def map_frame(grid: OccupancyGrid) -> MapFrame:
    """Return shape and place of the occupancy grid."""
    rows, cols = grid.cells.shape
    return MapFrame(rows=rows, cols=cols, cell_m=grid.cell_m, corner_m=grid.corner_m)


class Sensors:
    """An agent's sensors in one stage's house."""

    def __init__(
        self,
        simulator: Simulator,
        perception: Perception,
        sensors: SensorConfig,
        scene: StageScene,
        staleness: StalenessTracker | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        """Create sensors at the simulator's pose.

        Args:
            scene: The stage as the perception may know it.
            staleness: Receives every frame.
            stopwatch: Measures rendering and perception.
        """
        self._simulator = simulator
        self._perception = perception
        self._config = sensors
        self._grid = simulator.occupancy()
        self._staleness = staleness
        self._stopwatch = stopwatch or Stopwatch()
        self.pose = simulator.pose
        """The true pose of the last observation."""
        with self._stopwatch.timing("perception"):
            perception.begin_stage(scene)
            self._goal_feature = perception.text_feature(scene.goal.unified_instruction)

    def change_scene(self, scene: StageScene) -> None:
        """Take in that the house has changed during the stage."""
        self._grid = self._simulator.occupancy()
        with self._stopwatch.timing("perception"):
            self._perception.change_scene(scene)

    def observe(
        self,
        *,
        is_first: bool,
        num_rounds_left: int,
        is_action_success: bool = True,
        has_arrived: bool = False,
        is_guided: bool = False,
    ) -> Observation:
        """Observe from the agent's pose."""
        self.pose = pose = self._simulator.pose
        schedule = self._config.first_round if is_first else self._config.later_rounds
        yaws_rad = view_yaws_rad(schedule, pose.yaw_rad)
        with self._stopwatch.timing("simulation"):
            rgb = self._config.needs_rgb or self._perception.needs_rgb
            frames = [self._simulator.render(turned(pose, yaw_rad), rgb=rgb, instances=True) for yaw_rad in yaws_rad]
        with self._stopwatch.timing("perception"):
            percepts = self._perception.perceive(frames)
            views = tuple(self._view(frame, percept) for frame, percept in zip(frames, percepts, strict=True))
        if self._staleness is not None:
            for frame in frames:
                self._staleness.look(frame)
        return Observation(
            views=views,
            pose=_believed(pose, frames[-1].pose, percepts[-1].pose),
            is_action_success=is_action_success,
            num_rounds_left=num_rounds_left,
            has_arrived=has_arrived,
            is_guided=is_guided,
            goal_feature=self._goal_feature,
        )

    def _view(self, frame: Frame, percept: Percept) -> View:
        # Cells are where the oracle occupancy has them, whatever the perception believes of the pose.
        place = turned(self.pose, frame.pose.yaw_rad)
        return View(
            pose=percept.pose,
            intrinsics=frame.intrinsics,
            depth_m=percept.depth_m,
            detections=percept.detections,
            occupancy=visible_occupancy(self._grid, place, frame.intrinsics, self._config.occupancy_range_m),
            rgb=frame.rgb if self._config.needs_rgb else None,
        )


def _believed(body: Pose, camera: Pose, perceived: Pose) -> Pose:
    """Return the agent's pose with the error of its heading camera's pose."""
    if perceived == camera:
        return body
    return replace(
        body,
        x_m=body.x_m + perceived.x_m - camera.x_m,
        z_m=body.z_m + perceived.z_m - camera.z_m,
        yaw_rad=body.yaw_rad + perceived.yaw_rad - camera.yaw_rad,
    )
