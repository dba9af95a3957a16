"""Rank remembered objects for a decision model, and choose by rule between objects and frontiers."""

import math
from collections.abc import Callable, Sequence
from functools import cache, lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from evonav.decision.candidates import Choice, FrontierCandidate, ObjectCandidate
from evonav.decision.question import AnswerError
from evonav.decision.text.language import canonical
from evonav.decision.text.matcher import Matcher
from evonav.decision.text.minilm import encoder
from evonav.points import Point2
from evonav.tasks.public import Goal

_DECIMALS = 4
"""Decimals of a similarity: the number of threads changes a product in the seventh."""


def rank_entries(matcher: Matcher, goal: Goal, entries: Sequence[ObjectCandidate], position_m: Point2) -> list[int]:
    """Return the indices of all entries, those whose label the instruction mentions first.

    Stands for the paper's CLIP similarity (Sec. C.4), which ground-truth perception lacks. Ties go to more detections,
    then to the nearer entry, then to the older one.
    """
    return _ranked(partial(matcher.label_score, matcher.parsed(goal)), entries, position_m)


def rank_by_text(goal: Goal, entries: Sequence[ObjectCandidate], position_m: Point2) -> list[int]:
    """Rank as `rank_entries` does, by the meaning of labels and instruction (extra `evonav[text]`).

    It stands for CLIP's image features where a perception has none; the paper (Sec. C.4) compares images with text.

    Raises:
        InvalidArgumentError: The extra is missing or broken.
    """
    return _ranked(cache(partial(similarity_of_label, goal.unified_instruction)), entries, position_m)


def _ranked(score_of: Callable[[str], float], entries: Sequence[ObjectCandidate], position_m: Point2) -> list[int]:
    keys = [
        (
            -score_of(entry.label),
            -entry.num_detections,
            math.dist(entry.centre_m[::2], position_m),
            entry.entry_id,
            index,
        )
        for index, entry in enumerate(entries)
    ]
    keys.sort()
    return [key[-1] for key in keys]


def rank_by_feature(
    goal: NDArray[np.float32], features: Sequence[NDArray[np.float32] | None], entry_ids: Sequence[int]
) -> list[int]:
    """Return the indices of all entries, those that look most like the instruction first (paper, Sec. C.4).

    Args:
        goal: `(D,)` unit feature of the instruction.
        features: `(D,)` unit features of the entries; those without one come last.
        entry_ids: Ids of the entries: of equals, the older comes first.
    """
    scores = [-math.inf if feature is None else float(goal @ feature) for feature in features]
    return sorted(range(len(scores)), key=lambda index: (-scores[index], entry_ids[index]))


@lru_cache(maxsize=4096)
def text_feature(text: str) -> NDArray[np.float32]:
    """Return the `(384,)` unit feature of a sentence; `InvalidArgumentError` if the extra is missing or broken."""
    feature = encoder().encode(text)
    feature.setflags(write=False)
    return feature


def similarity_of_label(instruction: str, label: str) -> float:
    """Return the cosine between an instruction and a label, -1 to 1.

    Args:
        label: ProcTHOR's type or a detector's word.

    Raises:
        InvalidArgumentError: The extra is missing or broken.
    """
    return round(float(text_feature(instruction) @ text_feature(canonical(label))), _DECIMALS)


def best_frontier(
    matcher: Matcher, goal: Goal, frontiers: Sequence[FrontierCandidate], surroundings: Sequence[ObjectCandidate]
) -> int | None:
    """Return the index of the frontier that costs least, of equals the first; `None` without any."""
    costs_m = matcher.frontier_costs_m(matcher.parsed(goal), frontiers, surroundings)
    return costs_m.index(min(costs_m)) if costs_m else None


def choose_candidate(
    matcher: Matcher,
    stage: Goal,
    objects: Sequence[ObjectCandidate],
    frontiers: Sequence[FrontierCandidate],
    surroundings: Sequence[ObjectCandidate],
    *,
    num_rounds_left: int,
    unseen_m2: float = 0.0,
    is_final: bool = False,
) -> tuple[Choice, str]:
    """Choose an object that the instruction fits; else a frontier; else what the goal should be on or near.

    Args:
        objects: Remembered objects, the best first.
        surroundings: Everything remembered.
        unseen_m2: Area that the map does not know, for rules that look.
        is_final: Settle for the object that fits best if it is of the goal's kind, even if its relations do not hold;
            without frontiers, for whatever may help.

    Returns:
        The choice and the reason for it.

    Raises:
        AnswerError: No object has to do with the goal, and there is no frontier.
    """
    goal = matcher.parsed(stage)
    named = [index for index, candidate in enumerate(objects) if matcher.names_goal(goal, candidate)]
    if named:
        best = matcher.best(goal, [objects[index] for index in named], surroundings, unseen_m2)
        is_last_chance = not frontiers or num_rounds_left <= matcher.hurry_rounds
        if is_final or best.fits or is_last_chance:
            return Choice("object", named[best.index]), best.reason
    index = best_frontier(matcher, stage, frontiers, surroundings)
    if index is not None:
        return Choice("frontier", index), "relations do not hold" if named else "nothing remembered fits"
    for index, candidate in enumerate(objects):
        if matcher.label_score(goal, candidate.label) > 0.0 or (is_final and matcher.may_help(goal, candidate.label)):
            return Choice("object", index), f"{candidate.label} is where the {goal.noun} should be"
    raise AnswerError("invalid", "nothing to go to")
