"""Parts of prompts that all questions share: said once, the same for every agent."""

from collections.abc import Iterable

from evonav.decision.prompts import Part, Picture, Text
from evonav.decision.questions.candidates import Pixels
from evonav.tasks.public import StageInput


def goal_parts(goal: StageInput) -> tuple[Part, ...]:
    """The goal as the reported experiments give it: the unified instruction alone (paper, Sec. C.1)."""
    return (Text(f"Goal of the robot: {goal.unified_instruction}"),)


def titled(title: str, image: Pixels | None) -> tuple[Part, ...]:
    """A line, and the image that it is about if there is one."""
    return (Text(title),) if image is None else (Text(title), Picture(image))


def merged(parts: Iterable[Part]) -> tuple[Part, ...]:
    """Parts with neighbouring texts joined by line breaks."""
    joined: list[Part] = []
    for part in parts:
        last = joined[-1] if joined else None
        if isinstance(part, Text) and isinstance(last, Text):
            joined[-1] = Text(f"{last.text}\n{part.text}")
        else:
            joined.append(part)
    return tuple(joined)
