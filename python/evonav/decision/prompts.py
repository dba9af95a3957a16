"""Build prompts: text and images in turns."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from evonav.decision.goal_input import PictureGoal
from evonav.tasks.public import Goal


@dataclass(frozen=True, slots=True)
class Text:
    """A text in a prompt."""

    text: str


@dataclass(frozen=True, eq=False)
class Picture:
    """An image in a prompt."""

    pixels: NDArray[np.uint8]
    """`(H, W, 3)` RGB."""

    @cached_property
    def name(self) -> str:
        """Name of the image where a request is stored: `sha256:` and the hash of its shape and values.

        It is not the hash of its file, whose bytes depend on the compression.
        """
        height, width = self.pixels.shape[:2]
        values = f"{width}x{height} RGB\n".encode() + self.pixels.tobytes()
        return "sha256:" + hashlib.sha256(values).hexdigest()


Part = Text | Picture


@dataclass(frozen=True, slots=True)
class Turn:
    """One side's message in a conversation."""

    role: Literal["system", "user", "assistant"]
    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True)
class Prompt:
    """A conversation that the model continues."""

    turns: tuple[Turn, ...]
    schema: Mapping[str, Any] | None = None
    """JSON Schema that the answer must follow (`response_format`), for servers that support it."""

    @classmethod
    def of(cls, *parts: Part | str) -> "Prompt":
        """Create a prompt of one turn; a string stands for a `Text`."""
        return cls((Turn("user", tuple(Text(part) if isinstance(part, str) else part for part in parts)),))

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
        return "\n".join(part.text if isinstance(part, Text) else "<image>" for part in self.parts)

    def then(self, answer: str, reply: str) -> "Prompt":
        """Return the prompt that follows an answer."""
        turns = (*self.turns, Turn("assistant", (Text(answer),)), Turn("user", (Text(reply),)))
        return Prompt(turns, self.schema)


def goal_prompt(goal: Goal, *contents: str | tuple[str, NDArray[np.uint8] | None]) -> Prompt:
    """Return the prompt of a question about a goal.

    The goal is the unified instruction alone, as in the reported experiments (paper, Sec. C.1), unless agents go by its
    picture.

    Args:
        goal: The stage's goal.
        contents: Texts, and titles with the image below each, if there is one. Texts that follow each other without an
            image in between are joined by line breaks.
    """
    parts: list[Part] = []
    lines = [f"Goal of the robot: {goal.unified_instruction}"]
    picture = [("This picture shows it, in the middle:", goal.reference_image)] if isinstance(goal, PictureGoal) else []
    for content in (*picture, *contents):
        title, image = (content, None) if isinstance(content, str) else content
        lines.append(title)
        if image is not None:
            parts += [Text("\n".join(lines)), Picture(image)]
            lines = []
    return Prompt.of(*parts, *(["\n".join(lines)] if lines else []))
