"""Give agents that ask a decision model the goal as a sentence, as the reference image, or as both.

The paper's input is the sentence (Sec. C.1), and every agent's `Goal` also holds the image. A decision model's
`goal_input` says which of them its agents go by.
"""

from dataclasses import dataclass, fields
from typing import Literal, get_args

from evonav.errors import InvalidArgumentError
from evonav.tasks.language import noun_of
from evonav.tasks.public import Goal

GoalInput = Literal["text", "image", "both"]
GOAL_INPUTS: tuple[GoalInput, ...] = get_args(GoalInput)


@dataclass(frozen=True, slots=True)
class PictureGoal(Goal):
    """A goal whose reference image counts: prompts show it, and rules that look compare views with it."""


def goal_as_given(goal: Goal, goal_input: GoalInput) -> Goal:
    """Return a goal as agents go by it: with `image`, its sentences say no more than the category."""
    if goal_input == "text":
        return goal
    given = {field.name: getattr(goal, field.name) for field in fields(Goal)}
    if goal_input == "image":
        sentence = f"Please navigate to the {noun_of(goal.category).lower()}."
        names = ("basic_instruction", "appearance_instruction", "unified_instruction")
        given |= dict.fromkeys(names, sentence)
    return PictureGoal(**given)


def check_goal_input(goal_input: GoalInput, *, sees_images: bool) -> None:
    """Check that a model can go by a goal.

    Args:
        goal_input: Form of the goal that its agents go by.
        sees_images: Whether it can make use of the reference image.

    Raises:
        InvalidArgumentError: There is no such input, or the model cannot see it.
    """
    if goal_input not in GOAL_INPUTS:
        raise InvalidArgumentError(f"goal_input = {goal_input!r}: expected one of {', '.join(GOAL_INPUTS)}")
    if goal_input != "text" and not sees_images:
        raise InvalidArgumentError(f"goal_input = {goal_input!r}: needs a model that sees images, looks or vlm")
