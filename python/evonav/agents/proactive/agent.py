"""Belief-Weighted Search: goes where most of the posterior over the target's place is found a metre."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

from evonav.agents.agent import AgentAction, EntryBelief, NavigateTo, PlaceBelief, Stop
from evonav.agents.explanation import Explanation
from evonav.agents.explorer import nearest_frontier
from evonav.agents.frontier_update.questions import IdentityQuestion
from evonav.agents.navigator import Navigator
from evonav.agents.navigator_agent import NavigatorAgent
from evonav.agents.proactive.belief import TargetBelief
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.maps import shown_from
from evonav.agents.proactive.posterior import NAMED, Posterior, Surroundings, place_belief, visible_range_m
from evonav.agents.proactive.search import (
    ALIKE,
    SAME_PLACE_M,
    Option,
    Placed,
    best_entry,
    best_option,
    covered,
    frontier_gains,
    is_same,
    likeliest_places,
    place_by,
    places_before,
    places_to_search,
    with_ways,
)
from evonav.agents.proactive.sightings import FarSighting
from evonav.decision.question import DecisionModel
from evonav.decision.text.language import similarity
from evonav.decision.text.matcher import Matcher
from evonav.memory.objects import ObjectEntry
from evonav.memory.presence import DepthEvidence, Presence, judge_presence
from evonav.points import Point2
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal

BESIDE_M = 1.5
"""Largest distance between two entries that an agent can stop at together."""
SAME_SPOT_M = 0.5
"""Distance within which the agent has stood at a place."""


class Proactive(NavigatorAgent):
    """Keeps the belief in everything remembered, and searches with it."""

    _counted: ClassVar[tuple[str, ...]] = ("identity_checks", "identities_denied", "maps_forgotten")

    def __init__(self, config: ProactiveConfig | None = None, decision: DecisionModel | None = None) -> None:
        self.config = config or ProactiveConfig()
        super().__init__(self.config.navigator, decision, num_tries=3)
        self._matcher = self._queries.model.matcher or Matcher()

    def _new_navigator(self) -> Navigator:
        navigator = super()._new_navigator()
        self._belief = TargetBelief(navigator, self._task.map_frame, self._matcher, self.config)
        return navigator

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal, and let things have moved."""
        super().begin_stage(goal)
        self._parsed = self._matcher.parsed(self._goal)
        range_m = visible_range_m(self._parsed.noun)
        self._radius_m = min(max(range_m, self.config.min_radius_m), self.config.search_radius_m)
        self._inspected: set[int] = set()
        """Entries that the agent has stood before in this stage."""
        self._last: Option | None = None
        self._abandoned: list[Option] = []
        self._hope = math.inf
        """Weight of what can still be found elsewhere in this stage, at most."""
        self._is_final = False
        """Whether the agent goes to an entry because nothing else is left, or no time."""
        self._summary: dict[str, Any] = {}
        self._posterior_now: tuple[Posterior, Placed] | None = None
        """The last round's posterior, and the places of what it names, for records and pictures."""
        self._searched_from: list[Point2] = []
        """Places from which the agent has searched in this stage."""
        self._belief.begin_stage(self._parsed, goal.stage)

    def act(self, observation: Observation) -> AgentAction:
        """Look, update all beliefs, and stop or go on."""
        navigator, here = self._navigator, (observation.pose.x_m, observation.pose.z_m)
        self._queries.begin_round()
        self._candidates = ()
        self._belief.begin_round(here)
        navigator.observe(observation)
        around = self._belief.surroundings()
        # Where the way of the last round has ended, there may be an entry, a place that is now searched, or a sighting.
        ended = self._last if observation.has_arrived or not observation.is_action_success else None
        arrived_at = sighting = None
        if ended is not None and ended.kind == "object":
            # Else it is at a frontier on the way to the entry.
            if ended.is_reached or math.dist(here, ended.face_m) < self.config.stop_within_m:
                arrived_at = navigator.views.resolve(ended.key)
                self._inspected.add(arrived_at)
        elif ended is not None and ended.kind == "place":
            self._give_up(ended, around)
        elif ended is not None and ended.kind == "sighting" and ended.is_reached:
            sighting = ended
        # Stop at what is likely the goal.
        self._belief.presence.update()
        posterior = self._belief.posterior(around)
        stopped = self._stop_in_reach(posterior, around, observation, arrived_at)
        if stopped is None and sighting is not None:
            stopped = self._stop_at_sighting(posterior, sighting, observation)
        if stopped is not None:
            return stopped
        # Take in that something was denied, or a way was in vain.
        if arrived_at is not None:
            self._leave(arrived_at, observation)
        if self._queries.log or sighting is not None or arrived_at is not None:
            posterior = self._belief.posterior(around)
        # Go where most is found a metre; if nothing is left to go to, search all again.
        chosen = self._chosen(posterior, around, observation)
        if self._may_have_missed(chosen, observation):
            self._counters["maps_forgotten"] += 1
            navigator.explore_anew(observation)
            self._belief.searched.forget()
            self._searched_from.clear()
            around = self._belief.surroundings()
            posterior = self._belief.posterior(around)
            chosen = self._chosen(posterior, around, observation)
        return self._go(chosen, posterior, around, here)

    def _give_up(self, place: Option, around: Surroundings) -> None:
        """Take a place that the agent went to for searched, with all that it shows."""
        shown = shown_from(place.position_m, around.coarse, around.walls, self._radius_m)
        self._belief.searched.give_up(*shown, self.config.searched)
        self._searched_from.append(place.position_m)
        self._last = None

    def _may_have_missed(self, chosen: Option | None, observation: Observation) -> bool:
        """Return whether nothing is left to go to but what was denied, while there is time to search all again."""
        if observation.num_rounds_left <= self.config.anew_rounds or chosen is None:
            return observation.num_rounds_left > self.config.anew_rounds
        return chosen.kind == "object" and self._is_final and (chosen.key in self._belief.factors or chosen.gain <= 0.0)

    def _stop_at_sighting(self, posterior: Posterior, last: Option, observation: Observation) -> Stop | None:
        """Stop where something with the goal's name is detected, near, and too small to remember; else forget it."""
        here = (observation.pose.x_m, observation.pose.z_m)
        for one, weight in posterior.sightings:
            if math.dist(one.ground_m, last.face_m) > SAME_PLACE_M:
                continue
            others = math.fsum(w for _, w in posterior.sightings) - weight + math.fsum(posterior.entries.values())
            rest = others + float(posterior.moved.sum() + posterior.unseen.sum())
            is_near = math.dist(one.ground_m, here) < self.config.stop_within_m
            is_near &= self._belief.sightings.is_current(one) and similarity(self._parsed.noun, one.label) >= NAMED
            if is_near and weight >= self.config.commit_share * (weight + rest):
                self._note(posterior)
                self._record_round("sighting", "seen, and too small to remember")
                return Stop("sighted")
            self._belief.sightings.drop(one)
        return None

    def _leave(self, entry_id: int, observation: Observation) -> None:
        """Take in that the agent stands at an entry's place, does not detect it, and does not stop."""
        navigator = self._navigator
        if navigator.objects.entry(entry_id) is None or navigator.is_detected(entry_id):
            return
        view, evidence = observation.views[-1], self._evidence(entry_id, observation)
        self._belief.presence.see_nothing_on_arrival(navigator.objects, entry_id, view, evidence)
        self._belief.presence.update()
        self._belief.factors[entry_id] = self.config.unfit

    def _evidence(self, entry_id: int, observation: Observation) -> DepthEvidence:
        """Return what the view towards an entry shows at its place."""
        return self._navigator.objects.depth_evidence([entry_id], observation.views[-1])[0]

    def _is_settled(self, entry_id: int, posterior: Posterior) -> bool:
        """Return whether no search is worth more than to stop at an entry, and at those beside it, if they are there.

        It is compared with what can still be found elsewhere, not with other entries that are known to be there: a
        search does not tell these apart.
        """
        weight, beside = posterior.entries[entry_id], 0.0
        entry = self._navigator.objects.entry(entry_id)
        rest = min(posterior.elsewhere, self._hope)
        for one, other in posterior.entries.items():
            known = self._navigator.objects.entry(one)
            if one == entry_id or known is None or entry is None:
                continue
            if math.dist(known.centre_m, entry.centre_m) <= BESIDE_M:
                beside += other
            elif not self._belief.presence.is_verified(one):
                rest += other
        is_best = weight >= ALIKE * max(posterior.entries.values())
        return is_best and weight + beside >= self.config.commit_share * (weight + beside + rest)

    def _stop_in_reach(
        self, posterior: Posterior, around: Surroundings, observation: Observation, arrived_at: int | None
    ) -> Stop | None:
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
            seen = judge_presence(self._evidence(entry_id, observation), is_detected=is_detected)
            has_arrived = entry_id == arrived_at and seen is not Presence.NO
            if not has_arrived and not (is_near and is_detected):
                continue
            if entry_id != arrived_at and not self._is_well_placed(entry, posterior, around, here):
                continue
            last = self._last
            is_chosen = self._is_final and last is not None and navigator.views.resolve(last.key) == entry_id
            if is_chosen or (self._is_settled(entry_id, posterior) and self._may_be_goal(entry, around)):
                self._note(posterior)
                self._record_round(f"object {entry_id}", "identified" if is_detected else "at its place", entry_id)
                return Stop("identified" if is_detected else "at its place")
        return None

    def _entry_places(self, posterior: Posterior) -> list[tuple[Point2, float]]:
        """Return the middles of the entries with the goal's name, and their weights."""
        found = ((self._navigator.objects.entry(one), weight) for one, weight in posterior.entries.items())
        return [((one.centre_m[0], one.centre_m[2]), weight) for one, weight in found if one is not None]

    def _is_well_placed(self, entry: ObjectEntry, posterior: Posterior, around: Surroundings, here: Point2) -> bool:
        """Return whether no place by an entry has clearly more of the posterior within reach than the agent's own."""
        placed = self._entry_places(posterior)
        if len(placed) == 1:
            return True
        place = self._place_by((entry.centre_m[0], entry.centre_m[2]), placed, around, here)
        return place is None or covered(placed, here) >= ALIKE * covered(placed, place)

    def _place_by(self, centre_m: Point2, placed: Placed, around: Surroundings, here: Point2) -> Point2 | None:
        """Return where to stand by an entry; `None` if no known floor leads there."""
        places = places_before(centre_m, around, self.config.stand_within_m)
        return place_by(places, placed, self._navigator.explorer.map, here)

    def _may_be_goal(self, entry: ObjectEntry, around: Surroundings) -> bool:
        """Ask whether an entry contradicts the goal; if it does, it hardly counts for the rest of the stage."""
        if not self.config.checks_identity:
            return True
        self._counters["identity_checks"] += 1
        candidate = self._shown(self._navigator.candidate(entry))
        answer = self._queries.ask(IdentityQuestion(self._goal, candidate, around.remembered))
        if answer is False:
            self._counters["identities_denied"] += 1
            self._belief.factors[entry.id] = self.config.unfit
        return answer is not False

    def _chosen(self, posterior: Posterior, around: Surroundings, observation: Observation) -> Option | None:
        """Return where to go; `None` if nothing is left."""
        config, here = self.config, (observation.pose.x_m, observation.pose.z_m)
        likely = sorted(posterior.entries, key=lambda one: (-posterior.entries[one], one))[: config.num_entries]
        entries = [self._entry_option(entry_id, posterior.entries[entry_id]) for entry_id in likely]
        frontiers = around.frontiers
        gains = frontier_gains(posterior, around)
        options = [Option("frontier", one.id, one.position_m, one.position_m, gains[one.id]) for one in frontiers]
        places = places_to_search(posterior.moved + posterior.unseen, around, self._radius_m, config)
        options += [
            Option("place", number, eye, face, gain)
            for number, eye, face, gain in places
            if all(math.dist(eye, other) > SAME_PLACE_M for other in self._searched_from)
        ]
        options += [
            self._sighting_option(number, one, w, around) for number, (one, w) in enumerate(posterior.sightings)
        ]
        reached = with_ways(self._navigator.explorer.map, here, [*entries, *options])
        entries, options = reached[: len(entries)], reached[len(entries) :]
        options = [one for one in options if one.is_reached or one.kind == "sighting"]
        max_way_m = observation.num_rounds_left * self.sensors.max_travel_m
        self._hope = math.fsum(one.gain for one in options if one.way_m <= max_way_m)
        self._candidates = tuple(one.key for one in sorted(entries, key=lambda one: (-one.gain, one.key))[:5])
        best = best_entry(entries)
        if best is not None:
            rounds = math.ceil(best.way_m / self.sensors.max_travel_m) + config.reserve_rounds
            if config.keeps_reserve and observation.num_rounds_left <= rounds:
                self._is_final = True
                return best
        if config.keeps_reserve and observation.num_rounds_left <= config.last_rounds:
            last_place = self._likeliest_place(posterior, around, observation)
            if last_place is not None:
                self._is_final = True
                return last_place
        is_verified = self._belief.presence.is_verified
        if best is not None:
            self._is_final = False
            if posterior.share(best.key) >= config.commit_share or (
                is_verified(best.key) and self._is_settled(best.key, posterior)
            ):
                return best
        # An entry that is not verified, or was only seen in passing, is worth a look: what is around it tells more.
        options += [one for one in entries if not is_verified(one.key) or one.key not in self._inspected]
        found = best_option(options, self._last, self._abandoned, config)
        if found is None or found.gain <= 0.0:
            self._is_final = True
            return best or self._related(around, here)
        return found

    def _likeliest_place(self, posterior: Posterior, around: Surroundings, observation: Observation) -> Option | None:
        """Return where to be when the rounds run out: by the largest part of the posterior that is within reach."""
        here = (observation.pose.x_m, observation.pose.z_m)
        placed = self._entry_places(posterior) + [(one.ground_m, weight) for one, weight in posterior.sightings]
        places = likeliest_places(posterior, placed, around)
        max_way_m = (observation.num_rounds_left - 1) * self.sensors.max_travel_m
        ways = with_ways(self._navigator.explorer.map, here, places)
        near = [one for one in ways if one.is_reached and one.way_m <= max_way_m]
        return max(near, key=lambda one: (one.gain, -one.way_m, -one.key), default=None)

    def _entry_option(self, entry_id: int, weight: float) -> Option:
        entry = self._navigator.objects.entry(entry_id)
        assert entry is not None, "the posterior has present entries only"
        centre_m = (entry.centre_m[0], entry.centre_m[2])
        return Option("object", entry_id, self._navigator.observation_point(centre_m) or centre_m, centre_m, weight)

    def _sighting_option(self, number: int, one: FarSighting, weight: float, around: Surroundings) -> Option:
        """Return the place nearest to a sighting that no known wall hides from it, or the sighting's own."""
        places = places_before(one.ground_m, around, self.config.stand_within_m)
        place = min(places, key=lambda place: (math.dist(place, one.ground_m), place), default=one.ground_m)
        return Option("sighting", number, place, one.ground_m, weight)

    def _related(self, around: Surroundings, here: Point2) -> Option | None:
        """Return the nearest thing that the goal should be on or near."""
        near = [one for one in around.remembered if self._matcher.label_score(self._parsed, one.label) > 0.0]
        options = with_ways(self._navigator.explorer.map, here, [self._entry_option(o.entry_id, 0.0) for o in near])
        return min(options, key=lambda one: (one.way_m, one.key), default=None)

    def _go(self, option: Option | None, posterior: Posterior, around: Surroundings, here: Point2) -> AgentAction:
        """Go to what was chosen; to an object that the map does not reach, by way of the frontier nearest to it."""
        self._note(posterior)
        last, self._last = self._last, option
        if last is not None and last.kind != "object" and (option is None or not is_same(option, last)):
            self._abandoned.append(last)
        if option is None:
            self._record_round("none", "nothing left to go to")
            return Stop("nothing left to go to")
        explorer, position_m = self._navigator.explorer, option.position_m
        if option.kind == "frontier":
            chosen = next(one for one in explorer.frontiers if one.id == option.key)
            return self._go_to_frontier(chosen, "most likely a metre")
        if option.kind == "object":
            is_related = option.key not in posterior.entries
            if is_related and last is not None and last.key == option.key and option.way_m <= SAME_SPOT_M:
                self._record_round(f"object {option.key}", "the goal should be here", option.key)
                return Stop("nothing left to go to")
            self._record_round(f"object {option.key}", f"{posterior.share(option.key):.0%} likely here", option.key)
            if not is_related:
                placed = self._entry_places(posterior)
                position_m = self._place_by(option.face_m, placed, around, here) or position_m
        elif option.kind == "sighting":
            self._record_round("sighting", "seen from afar")
        else:
            self._summary["search_position_m"] = list(position_m)
            self._record_round("search", "most likely a metre")
        frontier = None if option.is_reached else nearest_frontier(explorer.frontiers, position_m)
        if frontier is not None:
            position_m, face_m = explorer.go_to(frontier)
            return NavigateTo(position_m, face_m=face_m)
        explorer.stop_exploring()
        is_elsewhere = math.dist(option.face_m, position_m) > 1e-6
        return NavigateTo(position_m, face_m=option.face_m if is_elsewhere else None)

    def _note(self, posterior: Posterior) -> None:
        """Store the summary of the posterior for the records."""
        sightings = [(one.ground_m, weight) for one, weight in posterior.sightings]
        self._posterior_now = posterior, [*self._entry_places(posterior), *sightings]
        self._summary = posterior.summary()

    def _places(self) -> PlaceBelief | None:
        """Return where the target is believed to be, as of the last round."""
        now = self._posterior_now
        return None if now is None else place_belief(*now, self._belief.searched.coarse.frame)

    def explain(self) -> Explanation:
        """Return the choice, and how to describe the memory and the belief of where the target is."""
        return replace(super().explain(), places=self._places)

    def _entry_beliefs(self) -> Sequence[EntryBelief]:
        """Return the object memory, with the probability that each object is still there."""
        p_present = self._belief.presence.p_present
        return [replace(entry, p_present=p_present(entry.entry_id)) for entry in super()._entry_beliefs()]

    def _round_details(self, reason: str) -> Mapping[str, Any]:
        return {**super()._round_details(reason), **self._summary}
