"""An agent that wants the answer from the name of the task, with the wheel alone: see test_task_names."""

import hashlib
import itertools
import re

import evonav
from evonav.agents.agent import NavigateTo, SensorConfig, Stop
from evonav.agents.explanation import Explanation
from evonav.generation.pipeline import generate_task

NUM_SEEDS = 20
"""Seeds of the generator and of runs that it tries."""


def candidates():
    """Yield the ids that the generator gives the tasks of the bundled houses."""
    for task in evonav.load_tasks("bundled"):
        stem = re.sub(r"-s\d+$", "", task.task_id)
        yield from (f"{stem}-s{seed}" for seed in range(NUM_SEEDS))


def names_of(task_id):
    """Yield the names that a task has had for agents, or might have if there were no secret."""
    yield task_id
    yield hashlib.sha256(task_id.encode()).hexdigest()
    for seed in range(NUM_SEEDS):
        digest = hashlib.sha256(f"{seed}\0\0{task_id}".encode()).digest()
        perception_seed = int.from_bytes(digest[:6], "big")
        yield hashlib.sha256(f"task\0{perception_seed}".encode()).hexdigest()[:12]


def task_named(name):
    """Generate the task again that has this name for agents; `None` if no task is found."""
    for task_id in candidates():
        if any(name[:12] == known[:12] for known in names_of(task_id)):
            place, seed = re.fullmatch(r"bundled-(\d+)-\w+-s(\d+)", task_id).groups()
            house = next(house for house in evonav.load_houses("bundled") if house.name == f"bundled:{int(place)}")
            return generate_task(house, seed=int(seed))
    return None


class Regenerating:
    """Walks to the target that the generated task names."""

    sensors = SensorConfig()

    def begin_task(self, task):
        self.name = task.task_id
        self.task = task_named(task.task_id)

    def begin_stage(self, goal):
        self.stage = goal.stage
        self.rounds = itertools.count()

    def act(self, observation):
        if self.task is None:
            return Stop("no task has this name")
        x_m, _, z_m = self.task.oracle(self.stage).target.position_m
        return Stop() if observation.has_arrived and next(self.rounds) else NavigateTo((x_m, z_m))

    def explain(self):
        return Explanation(choice=self.name)
