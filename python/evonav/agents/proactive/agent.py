"""Belief-Weighted Search: goes where most of the posterior over the target's place is found a metre."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import AgentAction, NavigateTo, Stop
from evonav.agents.explorer import nearest_frontier
from evonav.agents.frontier_update.questions import identity_question
from evonav.agents.navigator import Navigator
from evonav.agents.navigator_agent import NavigatorAgent
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.posterior import Posterior, Surroundings, posterior_of
from evonav.agents.proactive.presence import PresenceBelief
from evonav.agents.proactive.rooms import NO_ROOM, box_slices, rooms_of
from evonav.agents.proactive.search import (
    Option,
    best_option,
    frontier_gains,
    is_same,
    places_to_search,
    shown_from,
    with_ways,
)
from evonav.agents.proactive.searched import SearchedCells
from evonav.decision.candidates import ObjectCandidate, Point2
from evonav.decision.question import DecisionModel
from evonav.decision.text.matcher import matcher_of
from evonav.memory.objects import ObjectEntry
from evonav.memory.presence import Presence, judge_presence
from evonav.sensors.observation import MapFrame, Observation
from evonav.tasks.public import Goal

ALIKE = 0.8
"""An entry with at least this share of the largest weight is as good as the best one."""
FURNITURE_M = 0.3
"""Distance from an object's box within which its room is looked up."""
SAME_SPOT_M = 0.5
"""Distance within which the agent has stood at a place."""


class Proactive(NavigatorAgent):
    """Keeps the belief in everything remembered, and searches with it."""

    def __init__(self, config: ProactiveConfig | None = None, decision: DecisionModel | None = None) -> None:
        self.config = config or ProactiveConfig()
        super().__init__(self.config.navigator, decision, num_tries=3)
        self._matcher = matcher_of(self._queries.model)

    def _new_navigator(self) -> Navigator:
        navigator = super()._new_navigator()
        self._presence = PresenceBelief(self.config)
        self._searched = SearchedCells(self._task.map_frame, self.config)
        navigator.observers.append(self._presence.see)
        navigator.observers.append(lambda objects, view, update: self._searched.see(view))
        self._here: Point2 | None = None
        self._path: list[Point2] = []
        """Places of the agent in this stage."""
        return navigator

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal, and let things have moved."""
        super().begin_stage(goal)
        self._parsed = self._matcher.parsed(self._goal)
        self._factors: dict[int, float] = {}
        self._last: Option | None = None
        self._abandoned: list[Option] = []
        self._is_final = False
        """Whether the agent goes to an entry because nothing else is left, or no time."""
        self._summary: dict[str, Any] = {}
        self._searched.begin_stage()
        if goal.stage > 1:
            around = self._surroundings()
            visited = frozenset(_room_at(around.rooms, self._task.map_frame, place) for place in self._path)
            here = NO_ROOM if self._here is None else _room_at(around.rooms, self._task.map_frame, self._here)
            self._presence.begin_stage(goal.stage, around.room_of, visited, here)
        self._path = []

    def act(self, observation: Observation) -> AgentAction:
        """Look, update all beliefs, and stop or go on."""
        self._queries.begin_round()
        self._candidates = ()
        navigator, last = self._navigator, self._last
        navigator.observe(observation)
        here = self._here = (observation.pose.x_m, observation.pose.z_m)
        self._path.append(here)
        is_done = observation.has_arrived or not observation.is_action_success
        arrived_at = None
        around = self._surroundings()
        if last is not None and last.kind == "place" and is_done:
            radius_m = self.config.search_radius_m
            shown = shown_from(last.position_m, self._searched.coarse, around.rooms, radius_m)
            self._searched.give_up(shown, self.config.searched)
            self._last = None
        if last is not None and last.kind == "object" and last.is_reached and is_done:
            arrived_at = navigator.views.resolve(last.key)
        self._presence.update()
        posterior = self._posterior(around)
        stopped = self._stop_in_reach(posterior, observation, arrived_at)
        if stopped is not None:
            return stopped
        if arrived_at is not None:
            self._leave(arrived_at, observation)
        if self._queries.log or arrived_at is not None:  # an identity was denied, or a way was in vain
            posterior = self._posterior(around)
        return self._go(self._chosen(posterior, around, observation), posterior, here)

    def _leave(self, entry_id: int, observation: Observation) -> None:
        """Take in that the agent stands at an entry's place, does not detect it, and does not stop."""
        navigator = self._navigator
        if navigator.objects.entry(entry_id) is None or navigator.is_detected(entry_id):
            return
        view = observation.views[-1]
        (evidence,) = navigator.objects.depth_evidence([entry_id], view)
        self._presence.see_nothing_on_arrival(navigator.objects, entry_id, view, evidence)
        self._presence.update()
        self._factors[entry_id] = self.config.unfit

    def _is_empty(self, entry_id: int, observation: Observation) -> bool:
        """Return whether the view towards an entry sees through its place."""
        (evidence,) = self._navigator.objects.depth_evidence([entry_id], observation.views[-1])
        return judge_presence(evidence, is_detected=False) is Presence.NO

    def _surroundings(self) -> Surroundings:
        navigator = self._navigator
        remembered = [navigator.candidate(entry) for entry in navigator.objects.entries]
        cells = navigator.explorer.map.cells
        rooms = rooms_of(cells, self._task.map_frame, remembered)
        room_of = {one.entry_id: _room_by(rooms, self._task.map_frame, one) for one in remembered}
        return Surroundings(cells, rooms, remembered, room_of, bool(navigator.explorer.frontiers))

    def _posterior(self, around: Surroundings) -> Posterior:
        return posterior_of(
            self._parsed,
            self._matcher,
            around,
            self._presence,
            self._searched,
            {self._navigator.views.resolve(entry_id): factor for entry_id, factor in self._factors.items()},
            self._replaced_entries(around),
            self.config,
        )

    def _replaced_entries(self, around: Surroundings) -> frozenset[int]:
        """Return the entries whose objects were found elsewhere: each newer namesake explains the least believed."""
        presence = self._presence
        named = [one.entry_id for one in around.remembered if self._matcher.names_goal(self._parsed, one)]
        replaced: set[int] = set()
        for newer in sorted(named):
            gone = [
                older
                for older in named
                if presence.first_stage(older) < presence.first_stage(newer)
                and presence.p_present(older) < 0.5
                and older not in replaced
            ]
            if gone:
                replaced.add(min(gone, key=lambda one: (presence.p_present(one), one)))
        return frozenset(replaced)

    def _is_settled(self, entry_id: int, posterior: Posterior) -> bool:
        """Return whether no search is worth more than to stop at an entry, if it is there."""
        weight = posterior.entries[entry_id]
        others = (w for one, w in posterior.entries.items() if one != entry_id and not self._presence.is_verified(one))
        is_best = weight >= ALIKE * max(posterior.entries.values())
        return is_best and weight >= self.config.commit_share * (weight + posterior.elsewhere + math.fsum(others))

    def _stop_in_reach(self, posterior: Posterior, observation: Observation, arrived_at: int | None) -> Stop | None:
        """Stop at an entry that is near and may be the goal; `None` to go on.

        It is near if it is detected within `stop_within_m`, or the agent stands where it can be looked at, and its
        place is not seen empty: what is small or half hidden may not be detected.
        """
        navigator, here = self._navigator, (observation.pose.x_m, observation.pose.z_m)
        for entry_id in sorted(posterior.entries, key=lambda one: (-posterior.entries[one], one)):
            entry = navigator.objects.entry(entry_id)
            if entry is None:
                continue
            is_near = math.dist((entry.centre_m[0], entry.centre_m[2]), here) < self.config.stop_within_m
            is_detected = navigator.is_detected(entry_id)
            has_arrived = entry_id == arrived_at and (is_detected or not self._is_empty(entry_id, observation))
            if not has_arrived and not (is_near and is_detected):
                continue
            last = self._last
            is_chosen = self._is_final and last is not None and navigator.views.resolve(last.key) == entry_id
            if is_chosen or (self._is_settled(entry_id, posterior) and self._may_be_goal(entry)):
                self._note(posterior)
                self._record_round(f"object {entry_id}", "identified" if is_detected else "at its place", entry_id)
                return Stop("identified" if is_detected else "at its place")
        return None

    def _may_be_goal(self, entry: ObjectEntry) -> bool:
        """Ask whether an entry contradicts the goal; if it does, it hardly counts for the rest of the stage."""
        if not self.config.checks_identity:
            return True
        self._counters["identity_checks"] += 1
        question = identity_question(self._goal, entry, self._navigator, with_images=self._shows_images)
        answer = self._queries.ask(question)
        if answer is False:
            self._counters["identities_denied"] += 1
            self._factors[entry.id] = self.config.unfit
        return answer is not False

    def _chosen(self, posterior: Posterior, around: Surroundings, observation: Observation) -> Option | None:
        """Return where to go; `None` if nothing is left."""
        config, here = self.config, (observation.pose.x_m, observation.pose.z_m)
        likely = sorted(posterior.entries, key=lambda one: (-posterior.entries[one], one))[: config.num_entries]
        entries = [self._entry_option(entry_id, posterior.entries[entry_id]) for entry_id in likely]
        frontiers = self._navigator.explorer.frontiers
        gains = frontier_gains(posterior, self._searched.coarse, around.cells, frontiers)
        options = [Option("frontier", one.id, one.position_m, one.position_m, gains[one.id], 0.0) for one in frontiers]
        places = places_to_search(posterior, self._searched.coarse, around.cells, around.rooms, config)
        options += [Option("place", number, eye, face, gain, 0.0) for number, eye, face, gain in places]
        reached = with_ways(self._navigator.explorer.map, here, [*entries, *options])
        entries, options = reached[: len(entries)], [one for one in reached[len(entries) :] if one.is_reached]
        self._candidates = tuple(one.key for one in sorted(entries, key=lambda one: (-one.gain, one.key))[:5])
        best = self._best_entry(entries)
        if best is not None:
            rounds = math.ceil(best.way_m / self.sensors.max_travel_m) + config.reserve_rounds
            if config.keeps_reserve and observation.num_rounds_left <= rounds:
                self._is_final = True
                return best
            self._is_final = False
            is_verified = self._presence.is_verified(best.key)
            if posterior.share(best.key) >= config.commit_share or (
                is_verified and self._is_settled(best.key, posterior)
            ):
                return best
        options += [one for one in entries if not self._presence.is_verified(one.key)]
        found = best_option(options, self._last, self._abandoned, config)
        if found is None or found.gain <= 0.0:
            self._is_final = True
            return best or self._related(around, here)
        return found

    def _entry_option(self, entry_id: int, weight: float) -> Option:
        entry = self._navigator.objects.entry(entry_id)
        assert entry is not None, "the posterior has present entries only"
        centre_m = (entry.centre_m[0], entry.centre_m[2])
        return Option(
            "object", entry_id, self._navigator.observation_point(centre_m) or centre_m, centre_m, weight, 0.0
        )

    def _best_entry(self, entries: list[Option]) -> Option | None:
        """Return the nearest of the entries with about the largest weight."""
        top = max((one.gain for one in entries), default=0.0)
        good = [one for one in entries if one.gain >= ALIKE * top and one.gain > 0.0]
        return min(good, key=lambda one: (one.way_m, one.key), default=None)

    def _related(self, around: Surroundings, here: Point2) -> Option | None:
        """Return the nearest thing that the goal should be on or near."""
        near = [one for one in around.remembered if self._matcher.label_score(self._parsed, one.label) > 0.0]
        options = with_ways(self._navigator.explorer.map, here, [self._entry_option(o.entry_id, 0.0) for o in near])
        return min(options, key=lambda one: (one.way_m, one.key), default=None)

    def _go(self, option: Option | None, posterior: Posterior, here: Point2) -> AgentAction:
        """Go to what was chosen; to an object that the map does not reach, by way of the frontier nearest to it."""
        self._note(posterior)
        last, self._last = self._last, option
        if last is not None and last.kind != "object" and (option is None or not is_same(option, last)):
            self._abandoned.append(last)
        if option is None:
            self._record_round("none", "nothing left to go to")
            return Stop("nothing left to go to")
        explorer = self._navigator.explorer
        if option.kind == "object":
            is_related = option.key not in posterior.entries
            if is_related and last is not None and last.key == option.key and option.way_m <= SAME_SPOT_M:
                self._record_round(f"object {option.key}", "the goal should be here", option.key)
                return Stop("nothing left to go to")
            frontier = None if option.is_reached else nearest_frontier(explorer.frontiers, option.position_m)
            reason = f"{posterior.share(option.key):.0%} likely at its place"
            self._record_round(f"object {option.key}", reason, option.key)
            if frontier is not None:
                position_m, face_m = explorer.go_to(frontier)
                return NavigateTo(position_m, face_m=face_m)
            explorer.stop_exploring()
            return NavigateTo(option.position_m, face_m=option.face_m)
        if option.kind == "frontier":
            return self._go_to_frontier(
                next(one for one in explorer.frontiers if one.id == option.key), "most likely a metre"
            )
        explorer.stop_exploring()
        self._summary["search_position_m"] = list(option.position_m)
        self._record_round("search", "most likely a metre")
        is_elsewhere = math.dist(option.face_m, option.position_m) > 1e-6
        return NavigateTo(option.position_m, face_m=option.face_m if is_elsewhere else None)

    def _note(self, posterior: Posterior) -> None:
        """Store the summary of the posterior for the records."""
        total = posterior.total or 1.0
        self._summary = {
            "p_entries": {str(one): round(weight / total, 4) for one, weight in sorted(posterior.entries.items())},
            "p_moved": round(float(posterior.moved.sum()) / total, 4),
            "p_unseen": round(float(posterior.unseen.sum()) / total, 4),
        }

    def _round_counters(self) -> Mapping[str, int]:
        return {**self._queries.counters, "identity_checks": 0, "identities_denied": 0, **self._counters}

    def _round_details(self, reason: str) -> Mapping[str, Any]:
        return {**super()._round_details(reason), **self._summary}


class ProactiveBlind(Proactive):
    """Belief-Weighted Search that knows nothing of how homes change."""

    def __init__(self, config: ProactiveConfig | None = None, decision: DecisionModel | None = None) -> None:
        super().__init__(config or ProactiveConfig(prior="blind"), decision)


class ProactiveOracleTheta(Proactive):
    """Belief-Weighted Search that knows by which probabilities homes change, not what changed."""

    def __init__(self, config: ProactiveConfig | None = None, decision: DecisionModel | None = None) -> None:
        super().__init__(config or ProactiveConfig(prior="oracle-theta"), decision)


def _room_at(rooms: NDArray[np.int32], frame: MapFrame, place_m: Point2) -> int:
    row = math.floor((place_m[1] - frame.corner_m[1]) / frame.cell_m)
    col = math.floor((place_m[0] - frame.corner_m[0]) / frame.cell_m)
    return int(rooms[row, col]) if 0 <= row < frame.rows and 0 <= col < frame.cols else NO_ROOM


def _room_by(rooms: NDArray[np.int32], frame: MapFrame, one: ObjectCandidate) -> int:
    """Return the room of most cells under and around an object."""
    numbers = rooms[box_slices(one, frame, FURNITURE_M)]
    numbers = numbers[numbers != NO_ROOM]
    return int(np.bincount(numbers).argmax()) if numbers.size else NO_ROOM
