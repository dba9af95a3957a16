"""Build prompts: text and images in turns."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from evonav.tasks.public import StageInput


@dataclass(frozen=True, slots=True)
class Text:
    """A text in a prompt."""

    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """An image in a prompt."""

    pixels: NDArray[np.uint8]
    """`(H, W, 3)` RGB."""


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
        return "\n".join(part.text if isinstance(part, Text) else "<image>" for part in self.parts)

    def then(self, answer: str, reply: str) -> "Prompt":
        """Return the prompt that follows an answer."""
        turns = (*self.turns, Turn("assistant", (Text(answer),)), Turn("user", (Text(reply),)))
        return Prompt(turns, self.schema)


def goal_parts(goal: StageInput) -> tuple[Part, ...]:
    """Return the goal as the reported experiments give it: the unified instruction alone (paper, Sec. C.1)."""
    return (Text(f"Goal of the robot: {goal.unified_instruction}"),)


def titled(title: str, image: NDArray[np.uint8] | None) -> tuple[Part, ...]:
    """Return a line, and the image that it describes if there is one."""
    return (Text(title),) if image is None else (Text(title), Picture(image))


def merged(parts: Iterable[Part]) -> tuple[Part, ...]:
    """Join neighbouring texts by line breaks."""
    joined: list[Part] = []
    for part in parts:
        last = joined[-1] if joined else None
        if isinstance(part, Text) and isinstance(last, Text):
            joined[-1] = Text(f"{last.text}\n{part.text}")
        else:
            joined.append(part)
    return tuple(joined)
