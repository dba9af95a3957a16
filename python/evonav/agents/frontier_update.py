"""Frontier-Update (paper, Sec. C.4): object entries and a map over all stages; the map is rebuilt when contradicted."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from evonav.agents.agent import AgentAction, EntryBelief, NavigateTo, RoundDiagnostics, Sensing, Stop
from evonav.agents.explorer import Explorer, ExplorerConfig, nearest_frontier
from evonav.agents.viewpoint import observation_point
from evonav.decision.questions import Choice, ChooseQuestion, DecisionModel, FrontierCandidate, ObjectCandidate
from evonav.decision.text_match import TextMatch
from evonav.memory import Frontier, ObjectMap, ObjectMapConfig
from evonav.memory.objects import ObjectEntry
from evonav.memory.occupancy import FREE
from evonav.sensors.observation import Observation
from evonav.tasks.public import StageInput, TaskInfo

Point2 = tuple[float, float]


@dataclass(frozen=True, slots=True)
class FrontierUpdateConfig:
    """What the paper says, and what it leaves open."""

    explorer: ExplorerConfig = field(default_factory=ExplorerConfig)
    objects: ObjectMapConfig = field(default_factory=ObjectMapConfig)
    num_candidates: int = 5
    """Object entries that the decision model is shown."""
    num_tries: int = 3
    """Questions asked before an invalid answer is given up on."""
    observation_distance_m: float = 1.5
    """Where to stand to look at an object."""
    aim_again_m: float = 0.25
    """The place to stand is chosen again when the middle of the entry has shifted by more than this."""


@dataclass(frozen=True, slots=True)
class _Target:
    """An object entry that the agent is committed to."""

    entry_id: int
    goal_m: Point2
    centre_m: Point2


class FrontierUpdate:
    """Walks to what it remembers, explores when it remembers nothing that fits, and believes its entries."""

    def __init__(self, config: FrontierUpdateConfig | None = None, decision: DecisionModel | None = None) -> None:
        self.config = config or FrontierUpdateConfig()
        self.sensing = Sensing()
        self._decision: DecisionModel = decision or TextMatch()
        self._task: TaskInfo | None = None
        self._goal: StageInput | None = None
        self._counters: Counter[str] = Counter()
        self._diagnostics = RoundDiagnostics()

    def begin_task(self, task: TaskInfo) -> None:
        """Forgets everything."""
        self._task = task
        self._counters.clear()
        self._forget(task)

    def _forget(self, task: TaskInfo) -> None:
        """A blank map and an empty object memory."""
        self._explorer = Explorer(task.map_frame, self.config.explorer)
        self._objects = ObjectMap(self.config.objects)

    def begin_stage(self, stage: StageInput) -> None:
        """A new goal; entries, map and frontiers stay."""
        self._goal = stage
        self._target: _Target | None = None
        self._objects.begin_stage(stage.stage)

    def act(self, observation: Observation) -> AgentAction:
        """Stops at the object it was committed to; else looks, decides and goes on."""
        reached = self._reached(observation)
        if reached is not None and self._stops_at_sight_of_place():
            return self._stop("arrived", reached.entry_id)
        if self._observe(observation):
            self._target = None
        if reached is not None:
            if self._is_confirmed(reached.entry_id, observation):
                return self._stop("verified", reached.entry_id)
            self._reject(reached.entry_id)
            self._target = None
        if self._target is not None:
            self._target = self._aimed(self._target)
            return self._approach(self._target)
        return self._decide(observation)

    def _aimed(self, target: _Target) -> _Target:
        """The target, with its place as far as it is known by now: the first glimpse of a table may be its corner."""
        entry = self._objects.entry(target.entry_id)
        if entry is None:
            return target
        centre_m = (entry.centre_m[0], entry.centre_m[2])
        if math.dist(centre_m, target.centre_m) <= self.config.aim_again_m:
            return target
        return _Target(entry.id, self._observation_point(centre_m) or target.goal_m, centre_m)

    def _observation_point(self, centre_m: Point2) -> Point2 | None:
        """Where to stand to look at a place; `None` where the map knows no free floor around it."""
        occupancy = self._explorer.map
        return observation_point(
            occupancy.cells == FREE, occupancy.map_frame, centre_m, self.config.observation_distance_m
        )

    def _stops_at_sight_of_place(self) -> bool:
        """Whether arriving at an entry's place ends the stage without another look."""
        return True

    def _is_confirmed(self, entry_id: int, observation: Observation) -> bool:
        """Whether the object of an entry whose place was reached is there."""
        return True

    def _reject(self, entry_id: int) -> None:
        """Revises an entry that was not confirmed."""

    def _reached(self, observation: Observation) -> _Target | None:
        """The committed target, if its place was reached, or cannot be any nearer."""
        if self._target is None or not (observation.has_arrived or not observation.is_action_success):
            return None
        return self._target

    def _observe(self, observation: Observation) -> bool:
        """Updates entries and map; whether the map was contradicted."""
        for view in observation.views:
            update = self._objects.update(view)
            if self._target is not None:
                self._follow(dict(update.merged), update.removed)
        return self._explorer.observe(observation)

    def _follow(self, merged: dict[int, int], removed: Sequence[int]) -> None:
        """Keeps the commitment when its entry was merged into another; drops it when the entry is gone."""
        target = self._target
        if target is None:
            return
        entry_id = target.entry_id
        while entry_id in merged:
            entry_id = merged[entry_id]
        if entry_id in removed:
            self._target = None
        elif entry_id != target.entry_id:
            self._target = _Target(entry_id, target.goal_m, target.centre_m)

    def _decide(self, observation: Observation) -> AgentAction:
        """Asks where to go: to one of the best entries, or to a frontier."""
        assert self._goal is not None, "begin_stage comes first"
        here = (observation.pose.x_m, observation.pose.z_m)
        remembered = [_candidate(entry) for entry in self._objects.entries]
        ranked = self._decision.rank(self._goal, remembered, here)[: self.config.num_candidates]
        frontiers = self._explorer.frontiers
        question = ChooseQuestion(
            goal=self._goal,
            position_m=here,
            objects=[remembered[index] for index in ranked],
            frontiers=[_frontier_candidate(frontier, here) for frontier in frontiers],
            surroundings=remembered,
            num_rounds_left=observation.num_rounds_left,
        )
        choice = self._ask(question)
        if choice is not None and choice.kind == "object":
            return self._go_to_object(question.objects[choice.index], frontiers, choice.reason)
        if choice is not None and choice.kind == "frontier":
            return self._go_to_frontier(frontiers[choice.index], choice.reason)
        nearest = nearest_frontier(frontiers, here)
        if nearest is not None:
            return self._go_to_frontier(nearest, "no valid answer")
        return self._stop("nothing to go to", None)

    def _ask(self, question: ChooseQuestion) -> Choice | None:
        """The first valid answer; `None` after too many invalid ones."""
        for _ in range(self.config.num_tries):
            self._counters["decisions"] += 1
            choice = self._decision.choose(question)
            if choice.is_valid(question):
                return choice
            self._counters["invalid_answers"] += 1
        return None

    def _go_to_object(self, chosen: ObjectCandidate, frontiers: list[Frontier], reason: str) -> AgentAction:
        """Commits to an entry whose surroundings the map knows; else explores towards it."""
        centre_m = (chosen.centre_m[0], chosen.centre_m[2])
        goal_m = self._observation_point(centre_m)
        if goal_m is None:
            self._counters["unsupported_choices"] += 1
            frontier = nearest_frontier(frontiers, centre_m)
            if frontier is not None:
                return self._go_to_frontier(frontier, f"towards object {chosen.entry_id}, which the map does not reach")
            goal_m = centre_m  # the planner ends at the nearest free point
        self._target = _Target(chosen.entry_id, goal_m, centre_m)
        return self._approach(self._target, reason)

    def _approach(self, target: _Target, reason: str = "") -> AgentAction:
        self._explorer.stop_exploring()
        self._tell(f"object {target.entry_id}", reason, target.entry_id)
        return NavigateTo(target.goal_m, face_m=target.centre_m)

    def _go_to_frontier(self, frontier: Frontier, reason: str) -> AgentAction:
        self._tell(f"frontier {frontier.id}", reason)
        position_m, face_m = self._explorer.go_to(frontier)
        return NavigateTo(position_m, face_m=face_m)

    def _stop(self, reason: str, entry_id: int | None) -> AgentAction:
        self._tell("none" if entry_id is None else f"object {entry_id}", reason, entry_id)
        return Stop(reason)

    def _tell(self, choice: str, reason: str, entry_id: int | None = None) -> None:
        """Notes a round for `diagnostics`."""
        entry = None if entry_id is None else self._objects.entry(entry_id)
        explorer = self._explorer
        self._diagnostics = RoundDiagnostics(
            choice=choice,
            chosen_entry=None if entry is None else _belief(entry),
            num_entries=len(self._objects),
            num_frontiers=len(explorer.frontiers),
            counters={
                **self._counters,
                "conflicts": explorer.num_conflicts,
                "cells_cleared": explorer.num_cells_cleared,
            },
            details={"reason": reason} if reason else {},
        )

    def diagnostics(self) -> RoundDiagnostics:
        """Choice and counters of the last round."""
        return self._diagnostics

    def entries(self) -> Sequence[EntryBelief]:
        """The object memory."""
        return [_belief(entry) for entry in self._objects.entries]


def _candidate(entry: ObjectEntry) -> ObjectCandidate:
    return ObjectCandidate(entry.id, entry.label, entry.centre_m, entry.size_m, entry.num_detections)


def _frontier_candidate(frontier: Frontier, here: Point2) -> FrontierCandidate:
    x_m, z_m = frontier.position_m
    return FrontierCandidate(frontier.id, (x_m, z_m), math.dist((x_m, z_m), here))


def _belief(entry: ObjectEntry) -> EntryBelief:
    return EntryBelief(entry.id, entry.label, entry.centre_m, entry.size_m, entry.num_detections)
