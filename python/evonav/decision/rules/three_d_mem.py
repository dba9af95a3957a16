"""Rules for what 3D-Mem asks: the same knowledge as for Frontier-Update, over what its prefilter leaves."""

from collections.abc import Callable
from typing import Any

from evonav.decision.matching import Matcher
from evonav.decision.questions.frontier_update import ChooseQuestion
from evonav.decision.questions.three_d_mem import PrefilterQuestion, SnapshotChoice, SnapshotQuestion
from evonav.decision.ranking import rank_entries
from evonav.decision.rules.frontier_update import choose


def prefilter(matcher: Matcher, question: PrefilterQuestion) -> tuple[tuple[str, ...], str]:
    """The classes that the instruction speaks of: the goal's own first, then what it should be on or near.

    Where the list holds none of them, none is named, and no snapshot is left: only frontiers are.
    """
    goal = matcher.parsed(question.goal)
    scores = {name: matcher.label_score(goal, name) for name in question.class_names}
    ranked = sorted((name for name in scores if scores[name] > 0.0), key=lambda name: (-scores[name], name))
    return tuple(ranked[: question.max_kept]), f"{len(ranked)} of {len(scores)} classes are spoken of"


def choose_snapshot(matcher: Matcher, question: SnapshotQuestion) -> tuple[SnapshotChoice, str]:
    """What Frontier-Update would choose among the objects of all snapshots, best first by its own ranking.

    Raises:
        AnswerError: No object has to do with the goal, and there is no frontier.
    """
    places = [choice for choice in question.choices() if choice.snapshot is not None]
    objects = [candidate for snapshot in question.snapshots for candidate in snapshot.objects]
    ranked = rank_entries(matcher, question.goal, objects, question.position_m)
    choice, reason = choose(
        matcher,
        ChooseQuestion(
            goal=question.goal,
            position_m=question.position_m,
            objects=[objects[index] for index in ranked],
            frontiers=question.frontiers,
            surroundings=question.surroundings,
            num_rounds_left=question.num_rounds_left,
        ),
    )
    if choice.kind == "object":
        return places[ranked[choice.index]], reason
    return SnapshotChoice(None, choice.index), reason


RULES: dict[type, Callable[[Matcher, Any], tuple[Any, str]]] = {
    PrefilterQuestion: prefilter,
    SnapshotQuestion: choose_snapshot,
}
