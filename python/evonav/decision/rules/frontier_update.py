"""Rules for what Frontier-Update and its kin ask."""

from collections.abc import Callable
from typing import Any

from evonav.decision.language import canonical
from evonav.decision.matching import Matcher
from evonav.decision.questions.frontier_update import Choice, ChooseQuestion, VerifyQuestion
from evonav.decision.questions.question import AnswerError


def choose(matcher: Matcher, question: ChooseQuestion) -> tuple[Choice, str]:
    """A candidate that the instruction fits; else a frontier; else what the goal should be on or near.

    Raises:
        AnswerError: There is no candidate that has to do with the goal, and no frontier.
    """
    goal = matcher.parsed(question.goal)
    config = matcher.config
    named = [
        (matcher.relations_held(goal, candidate, question.surroundings), index)
        for index, candidate in enumerate(question.objects)
        if matcher.names_goal(goal, candidate)
    ]
    if named:
        held, index = max(named, key=lambda pair: (pair[0], -pair[1]))
        is_last_chance = not question.frontiers or question.num_rounds_left <= config.hurry_rounds
        if held >= config.min_relations or is_last_chance:
            return Choice("object", index), f"{question.objects[index].label}, {held:.0%} of what is said fits"
    if question.frontiers:
        index = min(
            range(len(question.frontiers)),
            key=lambda i: (matcher.frontier_cost_m(goal, question.frontiers[i], question.surroundings), i),
        )
        return Choice("frontier", index), "relations do not hold" if named else "nothing remembered fits"
    for index, candidate in enumerate(question.objects):
        if matcher.label_score(goal, candidate.label) > 0.0:
            return Choice("object", index), f"{candidate.label} is where the {goal.noun} should be"
    raise AnswerError("invalid", "nothing to go to")


def verify(matcher: Matcher, question: VerifyQuestion) -> tuple[bool, str]:
    """Present if something of the entry's label is seen at the entry's place."""
    entry, config = question.entry, matcher.config
    if question.image_share < config.min_image_share:
        return True, "too small to be told from here"
    for seen in question.seen:
        is_here = seen.overlap > config.min_overlap or seen.distance_m < config.same_place_m
        if is_here and canonical(seen.label) == canonical(entry.label):
            return True, f"{seen.label} seen {seen.distance_m:.2f} m from the remembered middle"
    return False, f"no {entry.label} seen at the remembered place"


RULES: dict[type, Callable[[Matcher, Any], tuple[Any, str]]] = {ChooseQuestion: choose, VerifyQuestion: verify}
