"""What a question to a decision model is: a prompt, a grammar for its answer, and a type for what the answer means.

A rule, a recording, a script and a VLM are interchangeable behind `DecisionModel`. Nothing in a question is oracle
data: candidates are what the agent itself remembers, images what it saw.
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, Protocol, TypeVar

from evonav.decision.prompts import Prompt
from evonav.errors import DecisionError
from evonav.tasks.public import StageInput

if TYPE_CHECKING:
    from evonav.decision.text.matcher import Matcher

A = TypeVar("A")
"""What an answer means."""

Fault = Literal["invalid", "refusal", "lost"]
"""Why there is no answer: one that is against the grammar or names no candidate; the model would not; none came."""


class AnswerError(DecisionError):
    """A model gave no usable answer to this question; asking again may help."""

    def __init__(self, fault: Fault, message: str, text: str = "") -> None:
        """An error.

        Args:
            fault: Why.
            message: In words.
            text: What came instead of an answer.
        """
        super().__init__(f"{fault}: {message}")
        self.fault: Fault = fault
        self.text = text


@dataclass(frozen=True, slots=True)
class Reply(Generic[A]):
    """An answer, and the words that it came in."""

    answer: A
    text: str
    """The whole answer: the line that was read, then reasons."""


class Question(ABC, Generic[A]):
    """One purpose. Subclasses are frozen dataclasses of what the agent knows, with `kind` and a `goal`."""

    kind: ClassVar[str]
    """Its name in records, counters and pictures, such as `choose`."""
    goal: StageInput

    @abstractmethod
    def prompt(self) -> Prompt:
        """What a model is given, its answer's grammar included. Same question, same prompt."""

    @abstractmethod
    def parse(self, text: str) -> A:
        """Reads an answer strictly: the answer proper comes first, reasons on later lines.

        Raises:
            AnswerError: `invalid`: against the grammar, or it names no candidate.
        """

    @abstractmethod
    def answer_text(self, answer: A) -> str:
        """An answer as a model should have put it: `parse(words(answer)) == answer`."""

    def answer_schema(self) -> Mapping[str, Any]:
        """JSON Schema of what `parse` reads, for servers that hold a model to one: a line, or an array of lines."""
        return {"type": "string"}

    def alternatives(self, answer: A) -> Sequence[A]:
        """The other valid answers, in a fixed order: what a model that errs could have said."""
        return ()

    def by_rule(self, matcher: "Matcher") -> tuple[A, str]:
        """Return the text matcher's answer and the reason for it.

        Args:
            matcher: Compares goals with what the agent remembers.

        Raises:
            AnswerError: Nothing fits, and there is nothing to choose.
            DecisionError: The question has no rule.
        """
        raise DecisionError(f"the text matcher has no rule for {type(self).__name__}: ask a model")


class ClosedQuestion(Question[A]):
    """A question whose valid answers can be listed."""

    @abstractmethod
    def choices(self) -> Sequence[A]:
        """All valid answers, in a fixed order."""

    def answer_schema(self) -> Mapping[str, Any]:
        """One of the choices."""
        return {"type": "string", "enum": [self.answer_text(choice) for choice in self.choices()]}

    def alternatives(self, answer: A) -> Sequence[A]:
        """Every other choice."""
        return [choice for choice in self.choices() if choice != answer]


class YesNoQuestion(ClosedQuestion[bool]):
    """A question that is answered by `yes` or `no`."""

    def choices(self) -> Sequence[bool]:
        """Yes and no."""
        return (True, False)

    def parse(self, text: str) -> bool:
        """A first line that begins with the word `yes` or `no`, whatever the case."""
        match = re.match(r"(yes|no)\b", first_line(text), re.IGNORECASE)
        if match is None:
            raise AnswerError("invalid", f"neither yes nor no: {first_line(text)[:80]!r}", text)
        return match[1].lower() == "yes"

    def answer_text(self, answer: bool) -> str:
        """`yes` or `no`."""
        return "yes" if answer else "no"


class DecisionModel(Protocol):
    """Answers questions."""

    @property
    def needs_images(self) -> bool:
        """Whether questions should hold images; agents then ask for colours, which cost rendering time."""
        ...

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """The answer to a question.

        Args:
            question: What is asked.
            attempt: How often the same question was asked before without use.

        Raises:
            AnswerError: There is no usable answer this time.
            DecisionError: There will be none: no key, no money left, not recorded. The stage cannot go on.
        """
        ...


def first_line(text: str) -> str:
    """The first line that is not empty, without surrounding space; empty if there is none."""
    return next((line.strip() for line in text.splitlines() if line.strip()), "")


def lines_of(text: str) -> list[str]:
    """The lines that are not empty, without surrounding space."""
    return [line.strip() for line in text.splitlines() if line.strip()]
