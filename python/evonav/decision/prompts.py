"""Build prompts: text and images in turns."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from evonav.decision.goal_input import PictureGoal
from evonav.decision.pictures import Picture as Picture
from evonav.tasks.public import Goal

CHANGE_NOTICE = "Things in this home may have been moved since the robot last saw them."
"""The sentence with which all prompts of an informed model begin, whatever the agent."""


Part = str | Picture
Role = Literal["system", "user", "assistant"]


@dataclass(frozen=True, slots=True)
class Turn:
    """One side's message in a conversation."""

    role: Role
    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True)
class Prompt:
    """A conversation that the model continues."""

    turns: tuple[Turn, ...]
    schema: Mapping[str, Any] | None = None
    """JSON Schema that the answer must follow (`response_format`), for servers that support it."""

    @classmethod
    def of(cls, *parts: Part) -> "Prompt":
        """Create a prompt of one turn."""
        return cls((Turn("user", parts),))

    @property
    def parts(self) -> list[Part]:
        """Texts and images of all turns, in order."""
        return [part for turn in self.turns for part in turn.parts]

    @property
    def pictures(self) -> list[Picture]:
        """The images alone."""
        return [part for part in self.parts if isinstance(part, Picture)]

    @property
    def text(self) -> str:
        """The texts alone; `<image>` stands for an image."""
        return "\n".join(part if isinstance(part, str) else "<image>" for part in self.parts)

    def then(self, answer: str, reply: str) -> "Prompt":
        """Return the prompt that follows an answer."""
        turns = (*self.turns, Turn("assistant", (answer,)), Turn("user", (reply,)))
        return Prompt(turns, self.schema)


def with_notice(prompt: Prompt, *, tells_of_change: bool) -> Prompt:
    """Return a prompt as a model is shown it: if it is informed of changes, `CHANGE_NOTICE` comes first.

    The paper's agents are not informed of changes (Sec. 4.1), so that by default no prompt says it.
    """
    if not tells_of_change:
        return prompt
    first, *others = prompt.turns
    return Prompt((Turn(first.role, (CHANGE_NOTICE, *first.parts)), *others), prompt.schema)


def goal_prompt(goal: Goal, *contents: str | tuple[str, Picture | None]) -> Prompt:
    """Return the prompt of a question about a goal.

    The goal is the unified instruction alone, as in the reported experiments (paper, Sec. C.1), unless agents go by its
    picture.

    Args:
        contents: Texts, and titles with the image below each, if there is one. Texts that follow each other without an
            image in between are joined by line breaks.
    """
    parts: list[Part] = []
    lines = [f"Goal of the robot: {goal.unified_instruction}"]
    if isinstance(goal, PictureGoal):
        contents = (("This picture shows it, in the middle:", Picture(goal.reference_image)), *contents)
    for content in contents:
        title, picture = (content, None) if isinstance(content, str) else content
        lines.append(title)
        if picture is not None:
            parts += ["\n".join(lines), picture]
            lines = []
    return Prompt.of(*parts, *(["\n".join(lines)] if lines else []))
