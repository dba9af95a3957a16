"""Frontier-Update and Stage-Reset (paper, Sec. C.4).

Frontier-Update keeps object entries and a map over all stages, and rebuilds the map when it is contradicted.
Stage-Reset searches from scratch in every stage.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import AgentAction, NavigateTo
from evonav.agents.explorer import nearest_frontier
from evonav.agents.frontier_update.questions import ChooseQuestion
from evonav.agents.navigator import NavigationTarget, NavigatorConfig
from evonav.agents.navigator_agent import NavigatorAgent
from evonav.agents.viewpoint import widest_direction_rad
from evonav.decision.candidates import FrontierCandidate, ObjectCandidate
from evonav.decision.question import DecisionModel
from evonav.decision.text.language import is_structure
from evonav.decision.text.matcher import Matcher
from evonav.decision.text.minilm import encoder
from evonav.decision.text.ranking import rank_by_feature, rank_by_text, rank_entries
from evonav.memory.objects import ObjectEntry
from evonav.memory.occupancy import FREE
from evonav.points import Point2
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo


@dataclass(frozen=True, slots=True)
class FrontierUpdateConfig:
    """The paper's constants, and values that the paper leaves open."""

    navigator: NavigatorConfig = field(default_factory=NavigatorConfig)
    num_candidates: int = 5
    """Number of object entries that the decision model is shown."""
    num_tries: int = 3
    """Number of tries before a question without a valid answer counts as failed."""
    on_failed_decision: Literal["nearest_frontier", "abort"] = "nearest_frontier"
    """The action without a valid answer: explore on (the paper leaves it open), or end the stage as 3D-Mem does."""
    explore_towards: Literal["object", "agent"] = "object"
    """An object that the map does not reach leads to the frontier nearest to the object, or nearest to the agent."""
    ranking: Literal["words", "text"] = "words"
    """Rank entries by the instruction's words or by its meaning (extra `evonav[text]`), if images have no features."""


class FrontierUpdate(NavigatorAgent):
    """Walks to what it remembers, explores when it remembers nothing that fits, and believes its entries."""

    config: FrontierUpdateConfig = FrontierUpdateConfig()
    """The parameters; a subclass states its own default."""
    _counted: ClassVar[tuple[str, ...]] = ("unsupported_choices",)
    _rereads_detections = False
    _stops_at_sight_of_place = True
    """Whether arriving at an entry's place ends the stage without another look."""

    def __init__(self, config: FrontierUpdateConfig | None = None, decision: DecisionModel | None = None) -> None:
        self.config = config or self.config
        if self.config.ranking == "text":
            encoder()  # reports a missing extra before the episode
        super().__init__(self.config.navigator, decision, num_tries=self.config.num_tries)
        self._matcher = Matcher()

    def begin_task(self, task: TaskInfo) -> None:
        """Forget everything."""
        super().begin_task(task)
        self._details: dict[str, Any] = {}
        """Extras for the records, beside the reason of a choice."""

    def act(self, observation: Observation) -> AgentAction:
        """Stop at the committed object if it was reached; else look, decide and move on."""
        self._queries.begin_round()
        self._candidates = ()
        navigator = self._navigator
        reached = navigator.reached(observation)
        if reached is not None and self._stops_at_sight_of_place:
            return self._stop("arrived", reached.entry_id)
        navigator.observe(observation)
        self._after_look(observation)
        reached = reached or self._in_reach(observation)
        if reached is not None:
            navigator.target = None
            action = self._act_at_place(navigator.views.resolve(reached.entry_id), observation)
            if action is not None:
                return action
        if navigator.target is not None:
            navigator.aim()
            return self._approach(navigator.target)
        return self._decide(observation)

    def _after_look(self, observation: Observation) -> None:
        """Revise further beliefs by a look that map and object entries have taken in; here there are none."""

    def _in_reach(self, observation: Observation) -> NavigationTarget | None:
        """Return the committed target if the agent need not go any nearer, though it has not reached its place."""
        return None

    def _act_at_place(self, entry_id: int, observation: Observation) -> AgentAction | None:
        """Act at the reached place of an entry, after a look; `None` to decide again."""
        return self._stop("verified", entry_id)

    def _decide(self, observation: Observation) -> AgentAction:
        """Ask where to go: to one of the best entries, or to a frontier."""
        entries = self._believed()
        remembered = self._navigator.candidates(entries)
        return self._choose(self._ranked(entries, remembered, observation), remembered, observation)

    def _believed(self) -> Sequence[ObjectEntry]:
        """Return the entries whose objects the agent believes to be there."""
        return self._navigator.objects.entries

    def _choose(
        self, ranked: Sequence[ObjectCandidate], remembered: Sequence[ObjectCandidate], observation: Observation
    ) -> AgentAction:
        """Ask about the first of the objects, the best first, and the places to explore, and do what is answered."""
        here = (observation.pose.x_m, observation.pose.z_m)
        ranked = ranked[: self.config.num_candidates]
        places = self._places_to_explore(observation)
        if not ranked and not places:
            return self._without_candidates(observation)
        question = ChooseQuestion(
            goal=self._goal,
            position_m=here,
            objects=[self._shown(entry) for entry in ranked],
            frontiers=places,
            surroundings=remembered,
            num_rounds_left=observation.num_rounds_left,
            unseen_m2=self._unseen_m2(),
            heading_view=self._heading_view(),
        )
        self._candidates = tuple(candidate.entry_id for candidate in question.objects)
        choice = self._queries.ask(question)
        if choice is not None and choice.kind == "object":
            return self._go_to_object(question.objects[choice.index], here)
        if choice is not None:
            return self._explore(places[choice.index], self._queries.reason)
        if places and self.config.on_failed_decision == "nearest_frontier":
            nearest = min(places, key=lambda place: (math.dist(place.position_m, here), place.frontier_id))
            return self._explore(nearest, "no valid answer")
        return self._stop("no valid answer")

    def _places_to_explore(self, observation: Observation) -> Sequence[FrontierCandidate]:
        """Return the places that a question offers for exploring: all frontiers."""
        return self._frontier_candidates((observation.pose.x_m, observation.pose.z_m))

    def _explore(self, place: FrontierCandidate, reason: str) -> AgentAction:
        """Continue towards a place that was offered for exploring, without a commitment."""
        frontiers = self._navigator.explorer.frontiers
        return self._go_to_frontier(next(one for one in frontiers if one.id == place.frontier_id), reason)

    def _ranked(
        self, entries: Sequence[ObjectEntry], remembered: Sequence[ObjectCandidate], observation: Observation
    ) -> list[ObjectCandidate]:
        """Return the best entries that may be candidates, the best first: by image features, by words or by meaning."""
        here = (observation.pose.x_m, observation.pose.z_m)
        feature = self._goal_feature(observation)
        if feature is not None:
            order = rank_by_feature(feature, [entry.feature for entry in entries], [entry.id for entry in entries])
        elif self.config.ranking == "text":
            order = rank_by_text(self._goal, remembered, here)
        else:
            order = rank_entries(self._matcher, self._goal, remembered, here)
        offered = (remembered[index] for index in order if self._is_offered(entries[index]))
        return list(islice(offered, self.config.num_candidates))

    def _goal_feature(self, observation: Observation) -> NDArray[np.float32] | None:
        """Return the feature of the goal's sentence, if there is one and the agent goes by it."""
        return observation.goal_feature if self._goal_input != "image" else None

    def _is_offered(self, entry: ObjectEntry) -> bool:
        """Return whether an entry may be a candidate: a window never is."""
        return not is_structure(entry.label)

    def _without_candidates(self, observation: Observation) -> AgentAction:
        """Act when there is nothing to ask about: neither entries nor frontiers."""
        return self._stop("nothing to go to")

    def _go_to_object(self, chosen: ObjectCandidate, here: Point2) -> AgentAction:
        """Commit to an entry whose surroundings the map knows; else explore towards it."""
        goal_m = self._navigator.observation_point(chosen.ground_m)
        if goal_m is None:
            self._counters["unsupported_choices"] += 1
            near_m = chosen.ground_m if self.config.explore_towards == "object" else here
            frontier = nearest_frontier(self._navigator.explorer.frontiers, near_m)
            if frontier is not None:
                return self._go_to_frontier(frontier, f"towards object {chosen.entry_id}, which the map does not reach")
            goal_m = chosen.ground_m  # the planner ends at the nearest free point
        return self._approach(NavigationTarget(chosen.entry_id, goal_m, chosen.ground_m), self._queries.reason)

    def _round_counters(self) -> Mapping[str, int]:
        return {**self._queries.counters, **self._navigator.explorer.counters, **self._counters}

    def _round_details(self, reason: str) -> Mapping[str, Any]:
        return {**super()._round_details(reason), **self._details}


@dataclass(frozen=True, slots=True)
class StageResetConfig(FrontierUpdateConfig):
    """Values that the paper leaves open about a search from scratch."""

    on_nothing_found: Literal["widest_direction", "end"] = "widest_direction"
    """The action if a stage's first look finds neither objects nor frontiers: go where most floor is free, or end."""


class StageReset(FrontierUpdate):
    """Gains nothing from earlier stages, and loses nothing to stale entries."""

    config: StageResetConfig = StageResetConfig()

    def begin_stage(self, goal: Goal) -> None:
        """Forget entries, map, frontiers, views and ids; counters count over the whole task."""
        counters = self._navigator.explorer.counters
        self._navigator = self._new_navigator()
        self._navigator.explorer.counters = counters
        super().begin_stage(goal)

    def _without_candidates(self, observation: Observation) -> AgentAction:
        """Go where most floor is free if the stage's first look found nothing, as one into a corner does."""
        navigator = self._navigator
        if navigator.round == 0 and self.config.on_nothing_found == "widest_direction":
            here, travel_m = (observation.pose.x_m, observation.pose.z_m), self.sensors.max_travel_m
            occupancy = navigator.explorer.map
            bearing_rad = widest_direction_rad(occupancy.cells == FREE, occupancy.map_frame, here, travel_m)
            if bearing_rad is not None:
                self._record_round("widest direction", "neither objects nor frontiers in sight")
                return NavigateTo(
                    (here[0] + travel_m * math.sin(bearing_rad), here[1] + travel_m * math.cos(bearing_rad))
                )
        return super()._without_candidates(observation)
