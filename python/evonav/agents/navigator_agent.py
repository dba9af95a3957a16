"""The base of all agents that use a `Navigator`: they ask a decision model, and describe each round for the records."""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

from evonav.agents.agent import AgentAction, EntryBelief, NavigateTo, SensorConfig, Stop
from evonav.agents.explanation import Explanation, entry_belief
from evonav.agents.navigator import NavigationTarget, Navigator, NavigatorConfig
from evonav.decision.candidates import FrontierCandidate, ObjectCandidate
from evonav.decision.goal_input import goal_as_given
from evonav.decision.pictures import Picture, picture_of
from evonav.decision.query import QuerySession
from evonav.decision.question import DecisionModel
from evonav.decision.rules import TextMatch
from evonav.memory import Frontier
from evonav.points import Point2
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo


class NavigatorAgent(ABC):
    """An agent with a map, object entries, stored views and a decision model."""

    _counted: ClassVar[tuple[str, ...]] = ()
    """Names of the agent's own counters, which begin at 0 with a task."""
    _rereads_detections = True
    """Whether the agent reads the detections of stored views even if its decision model does not look."""

    def __init__(
        self,
        config: NavigatorConfig,
        decision: DecisionModel | None,
        *,
        num_tries: int,
        sensors: SensorConfig | None = None,
    ) -> None:
        """Create the agent; its memory is made when a task begins.

        Args:
            decision: Decision model; default: the text matcher.
            num_tries: Number of tries before a question without a valid answer counts as failed.
            sensors: The sensors that the agent needs, apart from colours.
        """
        model: DecisionModel = decision or TextMatch()
        self._shows_images = "images" in model.needs
        self._names_colours = not self._shows_images and "colours" in model.needs
        self.sensors = replace(sensors or SensorConfig(), needs_rgb=self._shows_images or self._names_colours)
        self._goal_input = model.goal_input
        self._navigator_config = config
        self._queries = QuerySession(model, num_tries=num_tries)
        self._candidates: tuple[int, ...] = ()
        """Ids of the entries that the last question offered."""
        self._round = Explanation()
        """The choice of the last round."""

    def forget_by(self, rule: str) -> None:
        """Choose the rule that decides which object entries are forgotten, before a task begins.

        Args:
            rule: A key of `evonav.memory.forgetting.RULES`.
        """
        self._navigator_config = replace(self._navigator_config, forgetting=rule)

    def begin_task(self, task: TaskInfo) -> None:
        """Forget everything."""
        self._task = task
        self._counters = Counter(dict.fromkeys(self._counted, 0))
        self._queries.counters.clear()
        self._navigator = self._new_navigator()

    def _new_navigator(self) -> Navigator:
        """Return an empty memory for the task."""
        return Navigator(
            self._task.map_frame,
            self._navigator_config,
            names_colours=self._names_colours,
            keeps_layouts=self._names_colours and self._goal_input != "text",
            keeps_detections=self._rereads_detections or self._shows_images or self._names_colours,
        )

    def _unseen_m2(self) -> float:
        """Return the area that the map does not know, if the rules look."""
        return self._navigator.unseen_m2() if self._names_colours else 0.0

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal; the memory stays."""
        self._goal = goal_as_given(goal, self._goal_input)
        self._navigator.begin_stage(goal.stage)

    @abstractmethod
    def act(self, observation: Observation) -> AgentAction:
        """Decide what to do in one decision round."""

    def _heading_view(self) -> Picture | None:
        """Return the heading view of the last round for a prompt, if the model looks at images."""
        view = self._navigator.round_views[-1]
        return picture_of(view, self._navigator.config.image_px) if self._shows_images else None

    def _shown(self, candidate: ObjectCandidate) -> ObjectCandidate:
        """Return a candidate with its images, if the model looks at images."""
        return self._navigator.with_images(candidate) if self._shows_images else candidate

    def _frontier_candidates(self, here: Point2) -> list[FrontierCandidate]:
        """Return all frontiers as questions describe them, with images if the model looks at them."""
        return self._navigator.frontier_candidates(here, with_images=self._shows_images)

    def _approach(self, target: NavigationTarget, reason: str = "") -> AgentAction:
        """Commit to a target and continue towards it."""
        self._record_round(f"object {target.entry_id}", reason, target.entry_id)
        self._navigator.target = target
        self._navigator.explorer.stop_exploring()
        return NavigateTo(target.goal_m, face_m=target.centre_m)

    def _go_to_frontier(self, frontier: Frontier, reason: str) -> AgentAction:
        """Continue towards a frontier, without a commitment."""
        self._record_round(f"frontier {frontier.id}", reason)
        position_m, face_m = self._navigator.explorer.go_to(frontier)
        return NavigateTo(position_m, face_m=face_m)

    def _stop(self, reason: str, entry_id: int | None = None) -> AgentAction:
        self._record_round("none" if entry_id is None else f"object {entry_id}", reason, entry_id)
        return Stop(reason)

    def _record_round(self, choice: str, reason: str, entry_id: int | None = None) -> None:
        """Store what was chosen for `explain`: the choice in the agent's own terms, and the chosen entry."""
        navigator = self._navigator
        entry = None if entry_id is None else navigator.objects.entry(entry_id)
        self._round = Explanation(
            choice=choice,
            chosen_entry=None if entry is None else entry_belief(entry),
            num_entries=len(navigator.objects),
            num_frontiers=len(navigator.explorer.frontiers),
            counters=dict(self._round_counters()),
            details=dict(self._round_details(reason)),
        )

    def _round_counters(self) -> Mapping[str, int]:
        """Return the cumulative counts for the records of a round."""
        return {**self._queries.counters, **self._counters}

    def _round_details(self, reason: str) -> Mapping[str, Any]:
        """Return further values for the records of a round."""
        return {"reason": reason} if reason else {}

    def explain(self) -> Explanation:
        """Return the choice of the last round, and how to describe the memory."""
        return replace(
            self._round,
            map=self._navigator.explorer.map,
            objects=self._entry_beliefs,
            candidate_ids=self._candidates,
            questions=tuple(self._queries.log),
        )

    def _entry_beliefs(self) -> Sequence[EntryBelief]:
        """Return the object memory as records state it."""
        return [entry_belief(entry) for entry in self._navigator.objects.entries]
