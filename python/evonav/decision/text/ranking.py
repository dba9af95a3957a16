"""Rank remembered objects for a decision model."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from evonav.decision.candidates import ObjectCandidate, Point2
from evonav.decision.text.features import similarity_of_label
from evonav.decision.text.matcher import Matcher
from evonav.tasks.public import StageInput


def rank_entries(
    matcher: Matcher, goal: StageInput, entries: Sequence[ObjectCandidate], position_m: Point2
) -> list[int]:
    """Return the indices of all entries, those whose label the instruction mentions first.

    Stands for the paper's CLIP similarity (Sec. C.4), which ground-truth perception lacks. Ties go to more detections,
    then to the nearer entry, then to the older one.

    Args:
        matcher: Reads the goal.
        goal: The stage's goal.
        entries: All remembered objects.
        position_m: `(x, z)` of the agent.
    """
    parsed = matcher.parsed(goal)
    return _ranked({label: matcher.label_score(parsed, label) for label in _labels(entries)}, entries, position_m)


def rank_by_text(goal: StageInput, entries: Sequence[ObjectCandidate], position_m: Point2) -> list[int]:
    """Rank as `rank_entries` does, by the meaning of labels and instruction (extra `evonav[text]`).

    Args:
        goal: The stage's goal.
        entries: All remembered objects.
        position_m: `(x, z)` of the agent.

    Raises:
        InvalidArgumentError: The extra is missing or broken.
    """
    instruction = goal.unified_instruction
    scores = {label: similarity_of_label(instruction, label) for label in _labels(entries)}
    return _ranked(scores, entries, position_m)


def _labels(entries: Sequence[ObjectCandidate]) -> set[str]:
    return {entry.label for entry in entries}


def _ranked(scores: Mapping[str, float], entries: Sequence[ObjectCandidate], position_m: Point2) -> list[int]:
    keys = []
    for index, entry in enumerate(entries):
        keys.append(
            (-scores[entry.label], -entry.num_detections, math.dist(entry.ground_m, position_m), entry.entry_id, index)
        )
    return [key[-1] for key in sorted(keys)]


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
