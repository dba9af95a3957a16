"""Parts of runs for tests of many episodes a worker: agents that wait as for a model, and a deadly perception."""

import os
import time

from toy_agents import Explorer

from evonav.perception.ground_truth import GroundTruthPerception


class Waiting(Explorer):
    """Takes a tenth of a second for an answer, computing nothing."""

    def act(self, observation):
        time.sleep(0.1)
        return super().act(observation)


class Standing(Waiting):
    """Waits longer than any test."""

    def act(self, observation):
        time.sleep(600.0)
        return super().act(observation)


class Deadly:
    """Ends its worker, or hangs with it, in stage 2 of one task."""

    def __init__(self, task_id, how):
        self._perception = GroundTruthPerception()
        self._task_id, self._how = task_id, how

    def __getattr__(self, name):
        return getattr(self._perception, name)

    def begin_stage(self, scene):
        self._perception.begin_stage(scene)
        if scene.task_id == self._task_id and scene.goal.stage == 2:
            if self._how == "hang":
                time.sleep(3600.0)
            os._exit(9)
