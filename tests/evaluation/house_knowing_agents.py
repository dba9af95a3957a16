"""Agents that want to know the house from what they are told: see test_shifted_run."""

import dataclasses

import numpy as np

import evonav
from evonav.agents.agent import EntryBelief, Move, NavigateTo, RoundDiagnostics, SensorConfig, Stop
from evonav.house import House
from evonav.world.simulator import Action

MEASURED = {"depth_m", "masks", "confidences", "rgb", "reference_image", "free", "blocked"}
"""Arrays without places: images, and cells counted from the corner of the map."""
WALK = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.MOVE_FORWARD, Action.TURN_RIGHT, Action.MOVE_FORWARD)


def numbers_in(value, name=""):
    """Yield every number in a tree of dataclasses, lists and arrays."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            if field.name not in MEASURED:
                yield from numbers_in(getattr(value, field.name), field.name)
    elif isinstance(value, tuple | list):
        for one in value:
            yield from numbers_in(one, name)
    elif isinstance(value, np.ndarray):
        yield from value.ravel().tolist()
    elif isinstance(value, int | float):
        yield float(value)
    elif value is not None and not isinstance(value, str):
        raise TypeError(f"{name}: {type(value).__name__}: walk through it here")


class Collecting:
    """Walks a little, and says every number that it was given."""

    sensors = SensorConfig(needs_rgb=True)

    def begin_task(self, task):
        self.numbers = set(numbers_in(task))

    def begin_stage(self, goal):
        self.numbers |= set(numbers_in(goal))
        self.walk = iter(WALK)

    def act(self, observation):
        self.numbers |= set(numbers_in(observation))
        action = next(self.walk, None)
        return Stop() if action is None else Move(action)

    def diagnostics(self):
        return RoundDiagnostics(details={"numbers": sorted(self.numbers)})

    def entries(self):
        return []


def starts():
    """Yield the bundled tasks with where each begins, and where that is from the corner of the map."""
    for task in evonav.load_tasks("bundled")[:4]:
        start = task.start_pose
        corner_m = evonav.Simulator(House(task.house_json(1), name=task.task_id)).map_frame.corner_m
        yield task, (start.x_m, start.z_m), (start.x_m - corner_m[0], start.z_m - corner_m[1])


class Recognising:
    """Looks for its task among those of houses that it holds, by where it begins, and walks to the target."""

    sensors = SensorConfig()
    is_relative = False
    """Whether it compares places by their distances from the corner of the map."""

    def begin_task(self, task):
        self.corner_m = task.map_frame.corner_m
        self.task = None
        self.has_looked = False

    def begin_stage(self, goal):
        self.stage = goal.stage
        self.has_gone = False

    def act(self, observation):
        if not self.has_looked:
            self.has_looked = True
            here = (observation.pose.x_m, observation.pose.z_m)
            if self.is_relative:
                here = (here[0] - self.corner_m[0], here[1] - self.corner_m[1])
            for task, start, from_corner in starts():
                if np.allclose(here, from_corner if self.is_relative else start, rtol=0.0, atol=1e-6):
                    self.task = task
        if self.task is None:
            return Stop("no house begins here")
        if self.has_gone and observation.has_arrived:
            return Stop(self.task.task_id)
        self.has_gone = True
        x_m, _, z_m = self.task.oracle(self.stage).target.position_m
        return NavigateTo((x_m, z_m))


class RecognisingShape(Recognising):
    """Compares distances, which no shift hides."""

    is_relative = True


class Boasting:
    """Says that something is at the end of what an answer may say, where a shift leads out of range."""

    sensors = SensorConfig()

    def begin_task(self, task):
        pass

    def begin_stage(self, goal):
        pass

    def act(self, observation):
        return Stop()

    def diagnostics(self):
        return RoundDiagnostics()

    def entries(self):
        return [EntryBelief(i, "Mug", (x, 0.0, x), (0.1, 0.1, 0.1), 1) for i, x in enumerate((1e6, -1e6))]
