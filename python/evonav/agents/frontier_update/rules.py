"""Rules for what Frontier-Update and its variants ask."""

from typing import TYPE_CHECKING

from evonav.decision.candidates import Choice
from evonav.decision.text.choosing import choose_candidate
from evonav.decision.text.language import canonical
from evonav.decision.text.matcher import Matcher

if TYPE_CHECKING:
    from evonav.agents.frontier_update.questions import ChooseQuestion, VerifyQuestion


def choose(matcher: Matcher, question: "ChooseQuestion") -> tuple[Choice, str]:
    """Choose an object that the instruction fits; else a frontier; else what the goal should be on or near.

    Raises:
        AnswerError: No object has to do with the goal, and there is no frontier.
    """
    return choose_candidate(
        matcher,
        question.goal,
        question.objects,
        question.frontiers,
        question.surroundings,
        num_rounds_left=question.num_rounds_left,
    )


def verify(matcher: Matcher, question: "VerifyQuestion") -> tuple[bool, str]:
    """Answer yes if something with the entry's label is seen at the entry's place."""
    entry, config = question.entry, matcher.config
    if question.image_share < config.min_image_share:
        return True, "too small to be told from here"
    for seen in question.seen:
        is_here = seen.overlap > config.min_overlap or seen.distance_m < config.same_place_m
        if is_here and canonical(seen.label) == canonical(entry.label):
            return True, f"{seen.label} seen {seen.distance_m:.2f} m from the remembered middle"
    return False, f"no {entry.label} seen at the remembered place"
