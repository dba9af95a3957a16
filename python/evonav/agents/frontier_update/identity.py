"""Fail-then-Update that does not stop at an object that contradicts the goal."""

from evonav.agents.agent import AgentAction
from evonav.agents.frontier_update.fail_then_update import FailThenUpdate, FailThenUpdateConfig
from evonav.agents.frontier_update.questions import VerifyQuestion, identity_question
from evonav.decision.question import DecisionModel
from evonav.memory.objects import ObjectEntry
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo

RESERVE_ROUNDS = 8
"""Number of remaining rounds from which identity is no longer checked; as the text matcher's `hurry_rounds`."""


class FailThenUpdateIdentity(FailThenUpdate):
    """Sets an entry that is there, but contradicts the goal, aside for the stage.

    Entries that were set aside come back when nothing else is left, or at `reserve_rounds`; then none is checked.
    """

    def __init__(
        self,
        config: FailThenUpdateConfig | None = None,
        decision: DecisionModel | None = None,
        *,
        reserve_rounds: int = RESERVE_ROUNDS,
    ) -> None:
        super().__init__(config, decision)
        self._reserve_rounds = reserve_rounds
        self._set_aside: set[int] = set()
        """Entries of this stage that are there, but contradict the goal."""
        self._accepts_any = False
        """Whether identity is no longer checked in this stage."""
        self._num_rounds_left = 0

    def begin_task(self, task: TaskInfo) -> None:
        """Forget everything."""
        super().begin_task(task)
        self._counters.update(identity_checks=0, set_aside=0)

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal: what contradicted the last one may be it."""
        super().begin_stage(goal)
        self._set_aside.clear()
        self._accepts_any = False

    def act(self, observation: Observation) -> AgentAction:
        """Act as Fail-then-Update does."""
        self._num_rounds_left = observation.num_rounds_left
        return super().act(observation)

    def _verify(self, entry: ObjectEntry, question: VerifyQuestion) -> AgentAction | None:
        if super()._verify(entry, question) is None:
            return None
        if self._may_be_goal(entry):
            return self._stop("verified", entry.id)
        self._counters["set_aside"] += 1
        self._set_aside.add(entry.id)
        self._details = {**self._details, "set_aside": sorted(self._set_aside)}
        return None

    def _may_be_goal(self, entry: ObjectEntry) -> bool:
        """Return whether an entry does not contradict the goal, or the agent has no time for another one."""
        if self._accepts_any or self._num_rounds_left <= self._reserve_rounds:
            return True
        self._counters["identity_checks"] += 1
        question = identity_question(self._goal, entry, self._navigator, with_images=self._shows_images)
        return self._queries.ask(question) is not False

    def _decide(self, observation: Observation) -> AgentAction:
        """Decide as Frontier-Update does; take entries back that were set aside if nothing else is left."""
        if self._set_aside and not self._is_anything_left(observation):
            self._set_aside.clear()
            self._accepts_any = True
        return super()._decide(observation)

    def _is_anything_left(self, observation: Observation) -> bool:
        """Return whether there is time, and a frontier or another entry with the goal's name."""
        if observation.num_rounds_left <= self._reserve_rounds:
            return False
        navigator = self._navigator
        goal = self._matcher.parsed(self._goal)
        return bool(navigator.explorer.frontiers) or any(
            self._is_offered(entry) and self._matcher.names_goal(goal, navigator.candidate(entry))
            for entry in navigator.objects.entries
        )

    def _is_offered(self, entry: ObjectEntry) -> bool:
        resolve = self._navigator.views.resolve
        return super()._is_offered(entry) and all(resolve(entry_id) != entry.id for entry_id in self._set_aside)
