"""Agents that misbehave, for tests of containment. All walk as the nearest-frontier explorer does until they do not."""

import os
import time
from pathlib import Path

import numpy as np

from evonav.agents.agent import NavigateTo, SensorConfig, Stop
from evonav.agents.baselines import NearestFrontier


class Explorer(NearestFrontier):
    """Well-behaved."""

    stage = 0

    def begin_stage(self, goal):
        self.stage = goal.stage
        super().begin_stage(goal)


class Dying(Explorer):
    def act(self, observation):
        if self.stage == 2 and observation.num_rounds_left < 50:
            os._exit(3)
        return super().act(observation)


class DyingOnce(Explorer):
    """Dies in stage 2 unless the file named by TOY_ALIVE exists."""

    def act(self, observation):
        if self.stage == 2 and not os.path.exists(os.environ["TOY_ALIVE"]):  # noqa: PTH110
            os._exit(3)
        return super().act(observation)


class Raising(Explorer):
    def act(self, observation):
        if self.stage == 2:
            raise RuntimeError("no idea")
        return super().act(observation)


class AlwaysRaising(Explorer):
    def act(self, observation):
        raise RuntimeError("no idea")


class Hanging(Explorer):
    def act(self, observation):
        if self.stage == 2:
            time.sleep(60.0)
        return super().act(observation)


class Speechless(Explorer):
    def act(self, observation):
        return "forward" if self.stage == 2 else super().act(observation)


class Lost(Explorer):
    def act(self, observation):
        return NavigateTo((float("nan"), 0.0))


class FarSighted(Explorer):
    def __init__(self):
        super().__init__()
        self.sensors = SensorConfig(occupancy_range_m=100.0)


class Idle:
    """Stops at once: what comes for free."""

    sensors = SensorConfig()

    def begin_task(self, task):
        pass

    def begin_stage(self, goal):
        pass

    def act(self, observation):
        return Stop("idle")


class Undecided(Explorer):
    """Not deterministic: goes where the clock says."""

    def act(self, observation):
        pose = observation.pose
        angle_rad = time.monotonic_ns() % 1000
        return NavigateTo((pose.x_m + np.sin(angle_rad), pose.z_m + np.cos(angle_rad)))


class DyingAtFirst(Explorer):
    """Dies in stage 2, and leaves the file named by TOY_DIED, after which it lives."""

    def act(self, observation):
        flag = Path(os.environ["TOY_DIED"])
        if self.stage == 2 and not flag.exists():
            flag.touch()
            os._exit(3)
        return super().act(observation)


class Slow(Explorer):
    """Takes TOY_PACE_S for an answer."""

    def act(self, observation):
        time.sleep(float(os.environ["TOY_PACE_S"]))
        return super().act(observation)
