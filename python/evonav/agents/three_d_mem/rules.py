"""Rules for what 3D-Mem asks: the same knowledge as for Frontier-Update, over what its prefilter leaves."""

from typing import TYPE_CHECKING

from evonav.agents.three_d_mem.candidates import SnapshotChoice
from evonav.decision.text.choosing import choose_candidate
from evonav.decision.text.matcher import Matcher
from evonav.decision.text.ranking import rank_entries

if TYPE_CHECKING:
    from evonav.agents.three_d_mem.questions import PrefilterQuestion, SnapshotQuestion


def prefilter(matcher: Matcher, question: "PrefilterQuestion") -> tuple[tuple[str, ...], str]:
    """Name the classes that the instruction mentions: the goal's own first, then what it should be on or near.

    Where the list holds none of them, none is named, and no snapshot is left: only frontiers are.
    """
    goal = matcher.parsed(question.goal)
    scores = {name: matcher.label_score(goal, name) for name in question.class_names}
    ranked = sorted((name for name in scores if scores[name] > 0.0), key=lambda name: (-scores[name], name))
    return tuple(ranked[: question.max_classes]), f"{len(ranked)} of {len(scores)} classes are spoken of"


def choose_snapshot(matcher: Matcher, question: "SnapshotQuestion") -> tuple[SnapshotChoice, str]:
    """Choose as Frontier-Update would among the objects of all snapshots, ranked as it ranks them.

    Raises:
        AnswerError: No object has to do with the goal, and there is no frontier.
    """
    places = [choice for choice in question.choices() if choice.snapshot is not None]
    objects = [candidate for snapshot in question.snapshots for candidate in snapshot.objects]
    ranked = rank_entries(matcher, question.goal, objects, question.position_m)
    choice, reason = choose_candidate(
        matcher,
        question.goal,
        [objects[index] for index in ranked],
        question.frontiers,
        question.surroundings,
        num_rounds_left=question.num_rounds_left,
    )
    if choice.kind == "object":
        return places[ranked[choice.index]], reason
    return SnapshotChoice(None, choice.index), reason
