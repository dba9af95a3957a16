"""EvolvingNav's filter (arXiv 2609.39166): looks where most of the belief is found a metre."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import AgentAction, EntryBelief
from evonav.agents.evolving.belief import Belief, BeliefConfig, Coverage, SeenSite, belief_of, best_of, p_present
from evonav.agents.explorer import AS_THREE_D_MEM_PLUS
from evonav.agents.frontier_update.fail_then_update import FailThenUpdateConfig
from evonav.agents.frontier_update.identity import RESERVE_ROUNDS, FailThenUpdateIdentity
from evonav.agents.grid import NO_GROUP, CoarseFrame, owners_of
from evonav.agents.navigator import NavigationTarget, NavigatorConfig
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.home_statistics import is_furniture, room_ratios
from evonav.decision.question import DecisionModel
from evonav.decision.text.matcher import Matcher
from evonav.memory import Frontier
from evonav.memory.objects import ObjectEntry
from evonav.memory.occupancy import BLOCKED, FREE, UNKNOWN
from evonav.points import Point2
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal

REACH_M = 3.0
"""Distance over unknown floor up to which it counts as behind a frontier."""
UNREACHED = 1.5
"""Factor of the straight line to what no known floor leads to."""


@dataclass(frozen=True, slots=True)
class EvolvingConfig(FailThenUpdateConfig):
    """Constants of the filter and of the search."""

    navigator: NavigatorConfig = field(default_factory=lambda: NavigatorConfig(explorer=AS_THREE_D_MEM_PLUS))
    belief: BeliefConfig = field(default_factory=BeliefConfig)
    inspect_m: float = 1.0
    """Cost of a look, as a way (lambda); ours."""
    reserve_rounds: int = RESERVE_ROUNDS
    """Number of remaining rounds from which identity is no longer checked."""
    num_sites: int = 8
    """Largest number of sites that are compared by their ways; ours."""


class Evolving(FailThenUpdateIdentity):
    """Keeps the belief over sites in each stage, and stops only at a verified match."""

    def __init__(self, config: EvolvingConfig | None = None, decision: DecisionModel | None = None) -> None:
        self._own = config or EvolvingConfig()
        super().__init__(self._own, decision, reserve_rounds=self._own.reserve_rounds)
        self._matcher = self._queries.model.matcher or Matcher()
        self._belief = Belief({}, 1.0)

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal: sites can be looked at again, and things may have moved."""
        super().begin_stage(goal)
        self._parsed = self._matcher.parsed(self._goal)
        self._coarse = CoarseFrame.over(self._task.map_frame)
        self._coverage = Coverage(self._own.belief)
        self._denied: list[int] = []
        """Objects of this stage that were not verified: to see them again says nothing new."""
        self._belief = Belief({}, 1.0)

    def _after_look(self, observation: Observation) -> None:
        """Take in what this round's views show of all sites; the next site is chosen again."""
        navigator = self._navigator
        navigator.target = None
        denied = {navigator.views.resolve(one) for one in self._denied}
        best: dict[int, float] = {}
        for view in observation.views:
            entry_ids = navigator.objects.in_view(view)
            for entry_id, one in zip(entry_ids, navigator.objects.depth_evidence(entry_ids, view), strict=True):
                total = one.num_in_view + one.num_out_of_view
                best[entry_id] = max(best.get(entry_id, 0.0), one.num_not_hidden / max(1, total))
        for entry_id, share in best.items():
            if self._is_named(entry_id) and navigator.is_detected(entry_id):
                if entry_id not in denied:
                    self._coverage.find(entry_id)
            else:
                self._coverage.look(entry_id, share)

    def _is_named(self, entry_id: int) -> bool:
        entry = self._navigator.objects.entry(entry_id)
        if entry is None:
            return False
        named = ObjectCandidate(entry.id, entry.label, entry.centre_m, entry.size_m, entry.num_detections)
        return self._matcher.names_goal(self._parsed, named)

    def _act_at_place(self, entry_id: int, observation: Observation) -> AgentAction | None:
        """Verify an object of the goal's name; at another site, what the look showed is all."""
        if not self._is_named(entry_id):
            self._counters["sites_inspected"] += 1
            self._coverage.fail(entry_id)
            return None
        action = super()._act_at_place(entry_id, observation)
        if action is None:
            self._denied.append(entry_id)
            self._coverage.fail(entry_id)
        return action

    def _reject(self, entry: ObjectEntry) -> None:
        """Keep an entry whose object is not at its place: the belief in it falls, and nothing is deleted."""
        self._counters["rejected_entries"] += 1

    def _decide(self, observation: Observation) -> AgentAction:
        """Go to the site or the frontier where the chance to find the target is largest a metre."""
        navigator, here = self._navigator, (observation.pose.x_m, observation.pose.z_m)
        entries = {entry.id: entry for entry in navigator.objects.entries}
        remembered = [navigator.candidate(entry) for entry in entries.values()]
        frontiers = navigator.explorer.frontiers
        hidden, unknown_share = hidden_behind(frontiers, navigator.explorer.map.cells, self._coarse)
        self._belief = belief = belief_of(
            self._seen(remembered, entries),
            self._likely_places(remembered),
            unknown_share,
            self._coverage,
            self._own.belief,
        )
        if not self._accepts_any and observation.num_rounds_left <= self._own.reserve_rounds:
            self._accepts_any = True
        chances = {one: belief.chance(one, self._coverage, self._own.belief) for one in belief.sites}
        sites = sorted(chances, key=lambda one: (-chances[one], one))[: self._own.num_sites]
        self._candidates = tuple(sites)
        targets = [self._target(entries[one]) for one in sites]
        shares = [belief.unknown * share for share in hidden]
        ways_m = self._ways_m(here, [*(one.goal_m for one in targets), *(one.position_m for one in frontiers)])
        options = [
            (number, chance, way_m)
            for number, (chance, way_m) in enumerate(
                zip([*(chances[one] for one in sites), *shares], ways_m, strict=True)
            )
        ]
        best = best_of(options, self._own.inspect_m)
        if best is None:
            return self._without_chance(entries, here)
        if best >= len(targets):
            return self._go_to_frontier(frontiers[best - len(targets)], f"unknown {belief.unknown:.0%}")
        target = targets[best]
        return self._approach(target, f"{belief.sites[target.entry_id]:.0%} likely here")

    def _seen(self, remembered: list[ObjectCandidate], entries: Mapping[int, ObjectEntry]) -> dict[int, SeenSite]:
        """Return the sites where an object of the goal's name was seen."""
        named = [one for one in remembered if self._matcher.names_goal(self._parsed, one)]
        appearances = self._matcher.appearance_ratios(self._parsed, named)
        contexts = self._matcher.context_ratios(self._parsed, named, remembered)
        return {
            one.entry_id: SeenSite(appearance * context, self._goal.stage - entries[one.entry_id].last_seen_stage)
            for one, appearance, context in zip(named, appearances, contexts, strict=True)
        }

    def _likely_places(self, remembered: list[ObjectCandidate]) -> dict[int, float]:
        """Return the furniture, and how likely a thing of the goal's kind is on it: by its room and its area."""
        ratios, signs = room_ratios(self._parsed.noun), self._matcher.room_signs(remembered)
        found = {}
        for one in remembered:
            if is_furniture(one.label) and not self._matcher.names_goal(self._parsed, one):
                room = self._matcher.room_of_signs(one.ground_m, signs)
                found[one.entry_id] = ratios.get(room or "", 1.0) * one.size_m[0] * one.size_m[2]
        return found

    def _target(self, entry: ObjectEntry) -> NavigationTarget:
        centre_m = (entry.centre_m[0], entry.centre_m[2])
        return NavigationTarget(entry.id, self._navigator.observation_point(centre_m) or centre_m, centre_m)

    def _ways_m(self, here: Point2, places_m: list[Point2]) -> list[float]:
        if not places_m:
            return []
        ways_m = self._navigator.explorer.map.distances_m(here, np.array(places_m)).tolist()
        return [
            way_m if math.isfinite(way_m) else UNREACHED * math.dist(here, place_m)
            for way_m, place_m in zip(ways_m, places_m, strict=True)
        ]

    def _without_chance(self, entries: Mapping[int, ObjectEntry], here: Point2) -> AgentAction:
        """Go back to the likeliest object that was set aside; without one the target is not found."""
        named = [one for one in self._belief.sites if self._is_named(one)]
        best = max(named, key=lambda one: (self._belief.sites[one], -one), default=None)
        if best is None or self._accepts_any:
            return self._stop("not found")
        self._accepts_any = True
        return self._approach(self._target(entries[best]), "nothing else is left")

    def _entry_beliefs(self) -> Sequence[EntryBelief]:
        """Return the object memory, with the probability that each object is still where it was last seen."""
        return [replace(one, p_present=self._p_present(one.entry_id)) for one in super()._entry_beliefs()]

    def _p_present(self, entry_id: int) -> float | None:
        """Return that probability: only looks at objects of the goal's name count in a stage."""
        entry = self._navigator.objects.entry(entry_id)
        if entry is None:
            return None
        weight = self._coverage.weight(entry_id) if self._is_named(entry_id) else 1.0
        return p_present(self._goal.stage - entry.last_seen_stage, weight, self._own.belief)

    def _round_counters(self) -> Mapping[str, int]:
        return {"sites_inspected": 0, **super()._round_counters()}

    def _round_details(self, reason: str) -> Mapping[str, Any]:
        top = sorted(self._belief.sites.items(), key=lambda one: (-one[1], one[0]))[:5]
        return {
            **super()._round_details(reason),
            "p_sites": {str(site): round(p, 4) for site, p in top},
            "p_unknown": round(self._belief.unknown, 4),
        }


def hidden_behind(
    frontiers: Sequence[Frontier], cells: NDArray[np.uint8], coarse: CoarseFrame
) -> tuple[list[float], float]:
    """Return how much of what is unknown is behind each frontier, and the unknown share of the home.

    Args:
        coarse: A coarser grid over it, whose cells are counted.

    Returns:
        The share of each frontier, which sum to 1 where there are any, and the share of the unknown cells within
        `REACH_M` of a frontier among these and the free ones. A cell belongs to the frontier from which it is reached
        first without crossing a blocked cell.
    """
    blocks = coarse.taken(cells, BLOCKED)
    is_unknown = (blocks == UNKNOWN).any(axis=0) & (blocks != BLOCKED).all(axis=0)
    owners = owners_of(frontiers, is_unknown, coarse, REACH_M)
    counts = np.bincount(owners[owners != NO_GROUP], minlength=len(frontiers)).astype(np.float64)
    if len(frontiers) == 0:
        return [], 0.0
    num_free = int(((blocks == FREE).any(axis=0) & (owners == NO_GROUP)).sum())
    return (counts / counts.sum()).tolist(), float(counts.sum() / (counts.sum() + num_free))
