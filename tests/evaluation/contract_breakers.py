"""Agents that keep the contract but for one point each."""

import os
import random
import sys
import time

from evonav.agents.agent import EntryBelief, Move, SensorConfig, ViewSchedule
from evonav.agents.explanation import Explanation
from evonav.world.simulator import Action


class Turning:
    """Keeps all of it: turns left or right, as its seed says."""

    def __init__(self):
        self.sensors = SensorConfig(first_round=ViewSchedule(1, 0.0), later_rounds=ViewSchedule(1, 0.0))

    def begin_task(self, task):
        self.random = random.Random(task.seed)
        frame = task.map_frame
        self.corner_m = (frame.corner_m[0], 0.0, frame.corner_m[1])

    def begin_stage(self, goal):
        self.category = goal.category

    def act(self, observation):
        return Move(self.random.choice([Action.TURN_LEFT, Action.TURN_RIGHT]))

    def explain(self):
        return Explanation(choice="turn", objects=self.entries)

    def entries(self):
        return [EntryBelief(1, self.category, self.corner_m, (1.0, 1.0, 1.0), 1)]


class Moody(Turning):
    def begin_task(self, task):
        super().begin_task(task)
        self.random = random.SystemRandom()


class Collective(Turning):
    """What one does depends on what others of its class did."""

    num_rounds = 0

    def act(self, observation):
        Collective.num_rounds += 1
        return Move(Action.TURN_LEFT if Collective.num_rounds < 15 else Action.TURN_RIGHT)


class Remembering(Turning):
    """Forgets nothing at a new task."""

    num_rounds = 0

    def act(self, observation):
        self.num_rounds += 1
        return Move(Action.TURN_LEFT if self.num_rounds < 15 else Action.TURN_RIGHT)


class Scribbling(Turning):
    def act(self, observation):
        observation.views[0].detections.masks[:5] = 99
        return super().act(observation)


class Greedy(Turning):
    def __init__(self):
        self.sensors = SensorConfig(first_round=ViewSchedule(100, 3.6))


class Displaced(Turning):
    def entries(self):
        return [EntryBelief(4, "Mug", (1000.0, 0.0, 0.0), (1.0, 1.0, 1.0), 1)]


class Halting(Turning):
    def begin_stage(self, goal):
        if goal.stage == 2:
            raise KeyError(goal.category)
        super().begin_stage(goal)


class Wordless(Turning):
    def act(self, observation):
        return None


class Evasive(Turning):
    """It explains itself by a dictionary, already when a stage begins."""

    def explain(self):
        return {}


class Opaque(Turning):
    def explain(self):
        return Explanation(details={"self": self}, objects=self.entries)


class Senseless(Turning):
    def __init__(self):
        """Set no `sensors`."""


class Colourful(Turning):
    """Looks at colours that it did not ask for."""

    def act(self, observation):
        image = observation.views[0].rgb
        return Move(Action.TURN_LEFT if image.mean() > 100 else Action.TURN_RIGHT)


class Plain:
    """Explains nothing."""

    def __init__(self):
        self.sensors = SensorConfig(later_rounds=ViewSchedule(1, 0.0))

    def begin_task(self, task):
        pass

    def begin_stage(self, goal):
        pass

    def act(self, observation):
        return Move(Action.MOVE_FORWARD)


class Needy(Turning):
    def __init__(self, weights):
        super().__init__()


class Quitting(Turning):
    def act(self, observation):
        sys.exit("no more")


class Dying(Turning):
    def act(self, observation):
        os._exit(3)


class Slow(Turning):
    def act(self, observation):
        time.sleep(60)


class Dependent(Turning):
    """Does elsewhere what it does not do here."""

    def act(self, observation):
        return Move(Action.TURN_LEFT if "pytest" in sys.modules else Action.TURN_RIGHT)
