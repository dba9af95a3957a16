"""Score the answers to the question where something is."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from evonav.evaluation.episode.staleness import distance_to_box_m
from evonav.memory_benchmark.protocol import FoundPlace
from evonav.world.simulator import SceneObject

HIT_M = 1.0
"""Distance from a place to an object's box up to which the place is a hit."""
NUM_PLACES = 5
"""Places that are asked for."""

QueryState = Literal["before", "after", "after_evidence"]
"""Whether an object of the label has changed so far, and whether there was evidence of all of these changes."""


@dataclass(slots=True)
class QueryCounts:
    """Counts of the questions of one state."""

    n: int = 0
    hits_at_1: int = 0
    hits_at_5: int = 0
    reciprocal_ranks: float = 0.0
    """Sum of 1 / rank of the first true place; 0 for an answer without one."""


@dataclass(slots=True)
class Queries:
    """Counts of all questions of a stream, by state."""

    of_state: dict[QueryState, QueryCounts] = field(
        default_factory=lambda: {"before": QueryCounts(), "after": QueryCounts(), "after_evidence": QueryCounts()}
    )

    def take(self, objects: Sequence[SceneObject], places: Sequence[FoundPlace], state: QueryState) -> None:
        """Add the answer to a question.

        Args:
            objects: All that the question names, where it stands now.
            places: The answer, the best first.
        """
        counts = self.of_state[state]
        counts.n += 1
        rank = true_rank(objects, places)
        if rank is not None:
            counts.hits_at_1 += rank == 1
            counts.hits_at_5 += rank <= NUM_PLACES
            counts.reciprocal_ranks += 1.0 / rank


def true_rank(objects: Sequence[SceneObject], places: Sequence[FoundPlace]) -> int | None:
    """Return the 1-based rank of the first place within `HIT_M` of an object; `None` if there is none."""
    for rank, place in enumerate(places, start=1):
        if any(distance_to_box_m(place.position_m, body) <= HIT_M for body in objects):
            return rank
    return None
