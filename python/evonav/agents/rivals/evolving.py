"""EvolvingNav's filter (arXiv 2609.39166): looks where most of the belief is found a metre."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import AgentAction, EntryBelief
from evonav.agents.frontier_update.fail_then_update import FailThenUpdateIdentity, IdentityConfig
from evonav.agents.grid import NO_GROUP, CoarseFrame, owners_of
from evonav.agents.navigator import WITH_FALLBACK, NavigationTarget, NavigatorConfig
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


MIN_WEIGHT = 1e-3
"""Smallest weight of a site's evidence: nothing is excluded for good."""


@dataclass(frozen=True, slots=True)
class EvolvingConfig(IdentityConfig):
    """Constants of the filter and of the search; ours where the paper gives none."""

    navigator: NavigatorConfig = WITH_FALLBACK
    persistence: float = 0.8
    """Probability that an object is still where it was last seen, a stage later (rho); ours."""
    recall: float = 0.9
    """Probability that a look at all of a site finds the target if it is there (as the rule `bayes`); ours."""
    min_new_coverage: float = 0.05
    """Smallest share of a site's surface that must be new in a round to count as evidence."""
    inspected: float = 0.70
    """Share of a site's surface from which the site is inspected."""
    reopen: float = 0.10
    """Probability from which an inspected site is worth another look."""
    inspect_m: float = 1.0
    """Cost of a look, as a way (lambda); ours."""
    num_sites: int = 8
    """Largest number of sites that are compared by their ways; ours."""


@dataclass(frozen=True, slots=True)
class Belief:
    """Probabilities that sum to 1."""

    sites: Mapping[int, float]
    unknown: float
    """Probability of all that is not a known site."""


class Coverage:
    """The share of each site's surface that this stage's looks have shown, and the evidence of finding nothing there.

    The evidence of a site without a detection is the product of 1 - recall x new coverage over all rounds.
    """

    def __init__(self, config: EvolvingConfig) -> None:
        self._config = config
        self._shares: dict[int, float] = {}
        self._weights: dict[int, float] = {}

    def look(self, site: int, share: float) -> None:
        """Take in that a round showed a share of a site's surface, and nothing of the goal's name there."""
        new = share - self._shares.get(site, 0.0)
        if new > self._config.min_new_coverage:
            self._shares[site] = share
            self._lower(site, self._config.recall * new)

    def fail(self, site: int) -> None:
        """Take in that the agent went to a site and did not find the target there."""
        self._shares[site] = 1.0
        self._lower(site, self._config.recall)

    def find(self, site: int) -> None:
        """Take in that the object of a site was detected: what was missed before does not count."""
        self._shares.pop(site, None)
        self._weights.pop(site, None)

    def share(self, site: int) -> float:
        """Return the share of a site's surface that this stage has shown."""
        return self._shares.get(site, 0.0)

    def weight(self, site: int) -> float:
        """Return the likelihood of what was seen of a site, if the target is there."""
        return self._weights.get(site, 1.0)

    def _lower(self, site: int, rate: float) -> None:
        self._weights[site] = max(MIN_WEIGHT, self.weight(site) * (1.0 - rate))

    def chance(self, site: int, p: float) -> float:
        """Return the probability that the target is at a site, with the probability `p`, and a visit finds it: p q.

        A visit finds it on the surface that was not seen yet. An inspected site is worth another look while its
        probability is at least `reopen`: there it can still be on the part that is new, or what was seen was wrong.
        """
        config, left = self._config, 1.0 - self.share(site)
        if self.share(site) < config.inspected:
            return p * config.recall * left
        return p * config.recall * max(left, config.min_new_coverage) if p >= config.reopen else 0.0

    def belief(
        self, seen: Mapping[int, tuple[float, int]], places: Mapping[int, float], unknown_share: float
    ) -> Belief:
        """Return the posterior over all sites and the unknown.

        Args:
            seen: Sites where an object of the goal's name was seen: the likelihood of its description if it is the
                target, relative to that if the target was never seen, and the number of stages since it was last seen.
            places: Other sites, and how likely an object of its kind is there, relative to one another.
            unknown_share: Share of the home that the agent does not know, 0 to 1.
        """
        total_ratio = 1.0 + sum(ratio for ratio, _ in seen.values())  # 1: the target was never seen
        kept = self._config.persistence
        prior = {site: ratio / total_ratio * kept**num_stages for site, (ratio, num_stages) in seen.items()}
        rest = 1.0 - sum(prior.values())
        sum_places = sum(places.values())
        share = 1.0 - unknown_share if sum_places > 0.0 else 0.0
        for site, likely in places.items():
            prior[site] = prior.get(site, 0.0) + rest * share * likely / sum_places if sum_places > 0.0 else 0.0
        posterior = {site: p * self.weight(site) for site, p in prior.items()}
        unknown = rest * (1.0 - share)
        total = sum(posterior.values()) + unknown
        if total <= 0.0:
            return Belief(posterior, 1.0 if not posterior else 0.0)
        return Belief({site: p / total for site, p in posterior.items()}, unknown / total)


class Evolving(FailThenUpdateIdentity):
    """Keeps the belief over sites in each stage, and stops only at a verified match."""

    config: EvolvingConfig = EvolvingConfig()
    _counted: ClassVar[tuple[str, ...]] = (*FailThenUpdateIdentity._counted, "sites_inspected")

    def __init__(self, config: EvolvingConfig | None = None, decision: DecisionModel | None = None) -> None:
        super().__init__(config, decision)
        self._matcher = self._queries.model.matcher or Matcher()

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal: sites can be looked at again, and things may have moved."""
        super().begin_stage(goal)
        self._parsed = self._matcher.parsed(self._goal)
        self._coarse = CoarseFrame.over(self._task.map_frame)
        self._coverage = Coverage(self.config)
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
        return entry is not None and self._matcher.names_goal(
            self._parsed, self._navigator.candidate(entry, with_looks=False)
        )

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
        self._belief = belief = self._coverage.belief(
            self._seen(remembered, entries), self._likely_places(remembered), unknown_share
        )
        if not self._accepts_any and observation.num_rounds_left <= self.config.reserve_rounds:
            self._accepts_any = True
        chances = {one: self._coverage.chance(one, p) for one, p in belief.sites.items()}
        sites = sorted(chances, key=lambda one: (-chances[one], one))[: self.config.num_sites]
        self._candidates = tuple(sites)
        targets = [self._target(entries[one]) for one in sites]
        places_m = [*(one.goal_m for one in targets), *(one.position_m for one in frontiers)]
        ways_m = navigator.explorer.ways_m(here, places_m, UNREACHED)
        shares = [belief.unknown * share for share in hidden]
        best = best_of([*(chances[one] for one in sites), *shares], ways_m, self.config.inspect_m)
        if best is None:
            return self._without_chance(entries, here)
        if best >= len(targets):
            return self._go_to_frontier(frontiers[best - len(targets)], f"unknown {belief.unknown:.0%}")
        target = targets[best]
        return self._approach(target, f"{belief.sites[target.entry_id]:.0%} likely here")

    def _seen(
        self, remembered: list[ObjectCandidate], entries: Mapping[int, ObjectEntry]
    ) -> dict[int, tuple[float, int]]:
        """Return the sites where an object of the goal's name was seen, as `Coverage.belief` takes them."""
        named = [one for one in remembered if self._matcher.names_goal(self._parsed, one)]
        appearances = self._matcher.appearance_ratios(self._parsed, named)
        contexts = self._matcher.context_ratios(self._parsed, named, remembered)
        return {
            one.entry_id: (appearance * context, self._goal.stage - entries[one.entry_id].last_seen_stage)
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
        return p_present(self._goal.stage - entry.last_seen_stage, weight, self.config.persistence)

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


def p_present(num_stages: int, weight: float, persistence: float) -> float:
    """Return the probability that an object is still where it was seen.

    Args:
        num_stages: Number of stages since it was last seen.
        weight: The likelihood of this stage's looks if it is there, relative to that if it is not.
        persistence: The probability that it stays from one stage to the next.
    """
    prior = persistence**num_stages
    return prior * weight / (prior * weight + (1.0 - prior))


def best_of(chances: Sequence[float], ways_m: Sequence[float], inspect_m: float) -> int | None:
    """Return the index of the option with the largest chance a metre; `None` if none has a chance.

    Args:
        inspect_m: Added to all ways: what a look itself costs.
    """
    rates = [
        (chance / (way_m + inspect_m), -way_m, -number)
        for number, (chance, way_m) in enumerate(zip(chances, ways_m, strict=True))
    ]
    best = max(rates, default=None)
    return -best[2] if best is not None and best[0] > 0.0 else None
