"""EvolvingNav's belief: where the target is, over the sites that are known, and what is not known yet."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

MIN_WEIGHT = 1e-3
"""Smallest weight of a site's evidence: nothing is excluded for good."""


@dataclass(frozen=True, slots=True)
class BeliefConfig:
    """The paper's constants, and ours where it gives none."""

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


@dataclass(frozen=True, slots=True)
class SeenSite:
    """A place where an object of the goal's name was seen."""

    ratio: float
    """Likelihood of its description if it is the target, relative to that if the target was never seen."""
    num_stages: int
    """Number of stages since it was last seen; 0 if it was seen in this one."""


class Coverage:
    """The share of each site's surface that this stage's looks have shown, and the evidence of finding nothing there.

    The evidence of a site without a detection is the product of 1 - recall x new coverage over all rounds.
    """

    def __init__(self, config: BeliefConfig) -> None:
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


@dataclass(frozen=True, slots=True)
class Belief:
    """Probabilities that sum to 1."""

    sites: Mapping[int, float]
    unknown: float
    """Probability of all that is not a known site."""

    def chance(self, site: int, coverage: Coverage, config: BeliefConfig) -> float:
        """Return the probability that the target is at a site and a visit finds it: p q.

        A visit finds it on the surface that was not seen yet. An inspected site is worth another look while its
        probability is at least `reopen`: there it can still be on the part that is new, or what was seen was wrong.
        """
        p, left = self.sites.get(site, 0.0), 1.0 - coverage.share(site)
        if coverage.share(site) < config.inspected:
            return p * config.recall * left
        return p * config.recall * max(left, config.min_new_coverage) if p >= config.reopen else 0.0


def belief_of(
    seen: Mapping[int, SeenSite],
    places: Mapping[int, float],
    unknown_share: float,
    coverage: Coverage,
    config: BeliefConfig,
) -> Belief:
    """Return the posterior over all sites and the unknown.

    Args:
        seen: Sites where an object of the goal's name was seen.
        places: Other sites, and how likely an object of its kind is there, relative to one another.
        unknown_share: Share of the home that the agent does not know, 0 to 1.
    """
    total_ratio = 1.0 + sum(one.ratio for one in seen.values())  # 1: the target was never seen
    prior = {site: one.ratio / total_ratio * config.persistence**one.num_stages for site, one in seen.items()}
    rest = 1.0 - sum(prior.values())
    sum_places = sum(places.values())
    share = 1.0 - unknown_share if sum_places > 0.0 else 0.0
    for site, likely in places.items():
        prior[site] = prior.get(site, 0.0) + rest * share * likely / sum_places if sum_places > 0.0 else 0.0
    posterior = {site: p * coverage.weight(site) for site, p in prior.items()}
    unknown = rest * (1.0 - share)
    total = sum(posterior.values()) + unknown
    if total <= 0.0:
        return Belief(posterior, 1.0 if not posterior else 0.0)
    return Belief({site: p / total for site, p in posterior.items()}, unknown / total)


def p_present(num_stages: int, weight: float, config: BeliefConfig) -> float:
    """Return the probability that an object is still where it was seen.

    Args:
        num_stages: Number of stages since it was last seen.
        weight: The likelihood of this stage's looks if it is there, relative to that if it is not.
    """
    prior = config.persistence**num_stages
    return prior * weight / (prior * weight + (1.0 - prior))


def best_of(chances: Sequence[tuple[int, float, float]], inspect_m: float) -> int | None:
    """Return the index of the option with the largest chance a metre; `None` if none has a chance.

    Args:
        chances: Number, chance and way in metres of each option.
        inspect_m: Added to all ways: what a look itself costs.
    """
    rates = [(chance / (way_m + inspect_m), -way_m, -number) for number, chance, way_m in chances]
    best = max(range(len(rates)), key=lambda index: rates[index], default=None)
    return best if best is not None and rates[best][0] > 0.0 else None
