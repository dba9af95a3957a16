"""An agent that asks a model which of the objects it remembers is meant.

It shows how an agent is given the run's model (the parameter `decision`), puts a question of its own to it, and does
without when there is no valid answer. With `--decision vlm` the model is any OpenAI-compatible one; with
`--decision module:name` it is whatever you write. Exchanges are kept and replayed as those of evonav's own agents are.
"""

import math
from dataclasses import dataclass

from evonav import Goal, NavigateTo, ObjectMap, Observation, OccupancyMap, SensorConfig, Stop, TaskInfo
from evonav.agents.agent import AgentAction
from evonav.agents.explanation import Explanation
from evonav.decision.prompts import Prompt
from evonav.decision.query import QuerySession
from evonav.decision.question import AnswerError, DecisionModel, Question, first_line
from evonav.decision.text.matcher import Matcher


@dataclass(frozen=True)
class WhichObject(Question[int]):
    """Which of the remembered objects does the instruction mean? The answer is its number, 0 for none."""

    kind = "which_object"
    goal: Goal
    labels: tuple[str, ...]

    def prompt(self) -> Prompt:
        """The instruction, the objects, and how to answer."""
        listed = "\n".join(f"{number}. {label}" for number, label in enumerate(self.labels, start=1))
        return Prompt.of(
            f"{self.goal.unified_instruction}\nObjects seen so far:\n{listed}",
            "Which one is meant? Answer with its number alone, or with 0 if none of them is.",
        )

    def parse(self, text: str) -> int:
        """A number of the list, or 0."""
        answer = first_line(text).rstrip(".")
        if not answer.isascii() or not answer.isdigit() or int(answer) > len(self.labels):
            raise AnswerError("invalid", f"no number from 0 to {len(self.labels)}", text)
        return int(answer)

    def answer_text(self, answer: int) -> str:
        """The number."""
        return str(answer)

    def by_rule(self, matcher: Matcher) -> tuple[int, str]:
        """What `--decision text`, the default, answers: the first of the category."""
        fitting = [number for number, label in enumerate(self.labels, start=1) if label == self.goal.category]
        return (fitting[0] if fitting else 0), "the first of the asked-for category"


class AskingAgent:
    """Explores; asks whenever an object of the asked-for category is new; goes where the answer says."""

    def __init__(self, decision: DecisionModel | None = None) -> None:
        self.sensors = SensorConfig()
        self.queries = None if decision is None else QuerySession(decision)

    def begin_task(self, task: TaskInfo) -> None:
        """A new house."""
        self.map, self.objects = OccupancyMap(task.map_frame), ObjectMap()
        if self.queries is not None:
            self.queries.counters.clear()

    def begin_stage(self, goal: Goal) -> None:
        """A new goal."""
        self.goal = goal
        self.target: tuple[int, tuple[float, float]] | None = None
        self.refused: set[int] = set()

    def act(self, observation: Observation) -> AgentAction:
        """One decision round."""
        here = (observation.pose.x_m, observation.pose.z_m)
        for view in observation.views:
            self.map.update(view)
            self.objects.update(view)
        if self.target is None:
            self.target = self._chosen(here)
        elif observation.has_arrived or not observation.is_action_success:
            return Stop()
        if self.target is not None:
            return NavigateTo(self.target[1])
        frontiers = self.map.update_frontiers(here)
        if not frontiers:
            return Stop("nothing left to explore")
        return NavigateTo(
            min((frontier.position_m for frontier in frontiers), key=lambda point: math.dist(point, here))
        )

    def _chosen(self, here: tuple[float, float]) -> tuple[int, tuple[float, float]] | None:
        """The object that the model chooses, as number and place."""
        known = [entry for entry in self.objects.entries if entry.id not in self.refused]
        places = {entry.id: (entry.centre_m[0], entry.centre_m[2]) for entry in known}
        fitting = [entry.id for entry in known if entry.label == self.goal.category]
        if not fitting:
            return None
        nearest = min(fitting, key=lambda entry_id: math.dist(places[entry_id], here))
        if self.queries is None:
            return nearest, places[nearest]
        answer = self.queries.ask(WhichObject(self.goal, tuple(entry.label for entry in known)))
        if answer == 0:
            self.refused |= set(places)
            return None
        chosen = nearest if answer is None else known[answer - 1].id
        return chosen, places[chosen]

    def explain(self) -> Explanation:
        """What it goes to, what it remembers, and how the model did."""
        choice = "none" if self.target is None else f"object {self.target[0]}"
        counters = {} if self.queries is None else dict(self.queries.counters)
        return Explanation(objects=self.objects, choice=choice, counters=counters)
