"""Define questions to a decision model: a prompt, a grammar for the answer, and a type for the answer's meaning.

A rule, a recording, a script and a VLM are interchangeable behind `DecisionModel`. Nothing in a question is oracle
data: candidates are what the agent itself remembers, images what it saw.
"""

import re
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, TypeVar

from evonav.decision.goal_input import GoalInput
from evonav.decision.prompts import Prompt
from evonav.errors import DecisionError
from evonav.tasks.public import Goal

if TYPE_CHECKING:
    from evonav.decision.text.matcher import Matcher

A = TypeVar("A")
"""Type of a parsed answer."""

Fault = Literal["invalid", "refusal", "lost"]
"""The reason for a missing answer: invalid (against the grammar, or no candidate), refused, or lost on the way."""


class AnswerError(DecisionError):
    """A model gave no usable answer to this question; asking again may help."""

    def __init__(self, fault: Fault, message: str, text: str = "") -> None:
        """Create an error; `text` is the model's text, which is no valid answer."""
        super().__init__(f"{fault}: {message}")
        self.fault: Fault = fault
        self.text = text


@dataclass(frozen=True, slots=True)
class Reply(Generic[A]):
    """An answer, and the text in which it came."""

    answer: A
    text: str
    """The whole text: the line that was parsed, then reasons."""
    counter: str | None = None
    """Name under which the records count this answer, such as that of a mistake on purpose."""


class Question(ABC, Generic[A]):
    """A question of one kind. Subclasses are frozen dataclasses of the agent's knowledge, with `kind` and a `goal`."""

    kind: ClassVar[str]
    """The question's name in records, counters and pictures, such as `choose`."""
    goal: Goal

    @abstractmethod
    def prompt(self) -> Prompt:
        """Return what the model is given, the answer's grammar included; equal questions have equal prompts."""

    @abstractmethod
    def parse(self, text: str) -> A:
        """Parse an answer strictly: the answer proper comes first, reasons on later lines.

        Raises:
            AnswerError: `invalid`: against the grammar, or it names no candidate.
        """

    def answer_text(self, answer: A) -> str:
        """Return an answer as a model should give it: `parse(answer_text(answer)) == answer`; by default its `str`."""
        return str(answer)

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the JSON Schema of an answer: one line, or an array of lines."""
        return {"type": "string"}

    def alternatives(self, answer: A) -> Sequence[A]:
        """Return the other valid answers, in a fixed order: those that a mistaken model could give."""
        return ()

    def namesakes(self, answer: A, matcher: "Matcher") -> Sequence[tuple[A, float]]:
        """Return the answers that go to other remembered objects of the goal's class, each with the matcher's score.

        Args:
            answer: The answer that is left out, and with it all answers that go to the same object.
        """
        return ()

    def exploring(self, answer: A, matcher: "Matcher") -> A | None:
        """Return the answer that explores in place of one that goes to an object, as if the goal was not seen yet.

        Returns:
            `None` if the answer explores already, or there is nothing to explore.
        """
        return None

    def by_rule(self, matcher: "Matcher") -> tuple[A, str]:
        """Return the text matcher's answer and the reason for it.

        Raises:
            AnswerError: Nothing fits, and there is nothing to choose.
            DecisionError: The question has no rule.
        """
        raise DecisionError(f"the text matcher has no rule for {type(self).__name__}: ask a model")


class ClosedQuestion(Question[A]):
    """A question whose valid answers can be listed."""

    @abstractmethod
    def choices(self) -> Sequence[A]:
        """Return all valid answers, in a fixed order."""

    def parse(self, text: str) -> A:
        """Read a first line that spells a choice; case, spaces, leading zeros and a final dot do not count."""
        line = first_line(text)
        for choice in self.choices():
            if _spelling(self.answer_text(choice)) == _spelling(line):
                return choice
        raise AnswerError("invalid", f"none of the possible answers: {line[:80]!r}", text)

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of one of the choices."""
        return {"type": "string", "enum": [self.answer_text(choice) for choice in self.choices()]}

    def alternatives(self, answer: A) -> Sequence[A]:
        """Return every other choice."""
        return [choice for choice in self.choices() if choice != answer]


class YesNoQuestion(ClosedQuestion[bool]):
    """A question that is answered by `yes` or `no`."""

    def choices(self) -> Sequence[bool]:
        """Return yes and no."""
        return (True, False)

    def parse(self, text: str) -> bool:
        """Read a first line that begins with the word `yes` or `no`, in any case."""
        match = re.match(r"(yes|no)\b", first_line(text), re.IGNORECASE)
        if match is None:
            raise AnswerError("invalid", f"neither yes nor no: {first_line(text)[:80]!r}", text)
        return match[1].lower() == "yes"

    def answer_text(self, answer: bool) -> str:
        """Return `yes` or `no`."""
        return "yes" if answer else "no"


Need = Literal["images", "colours"]
"""Contents of questions besides words: views and crops, or the names of the colours in them."""


class DecisionModel(ABC):
    """A model that answers questions. A subclass needs `answer`; the rest has defaults."""

    needs: frozenset[Need] = frozenset()
    """Contents that questions should have; agents then ask the simulator for colours, which cost rendering time."""
    goal_input: GoalInput = "text"
    """Form of the goal that agents who ask the model go by."""
    matcher: "Matcher | None" = None
    """The rules by which it answers, if it does; agents and simulated mistakes use their scores."""

    @abstractmethod
    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Answer a question.

        Args:
            attempt: Number of earlier tries of this question without a valid answer.

        Raises:
            AnswerError: There is no usable answer this time.
            DecisionError: There will be none: no key, no money left, not recorded. The stage cannot go on.
        """

    def check(self) -> None:  # noqa: B027 - by default there is nothing to check
        """Check before the first question that the model can be asked; ask nothing.

        Raises:
            DecisionError: The model cannot be asked; the message says what to do.
        """

    def costs(self) -> dict[str, float]:
        """Return the tokens and the money that this process has spent so far; empty for a model without costs."""
        return {}


class ModelWrapper(DecisionModel):
    """Says of itself what another model says; subclasses answer by it."""

    def __init__(self, model: DecisionModel) -> None:
        """Store the other model."""
        self.model = model
        self.needs = model.needs
        self.goal_input = model.goal_input
        self.matcher = model.matcher

    def check(self) -> None:
        """Check the other model."""
        self.model.check()

    def costs(self) -> dict[str, float]:
        """Return the other model's costs."""
        return self.model.costs()


class Metered(ModelWrapper):
    """Answers as another model does, and adds up the costs."""

    def __init__(self, model: DecisionModel) -> None:
        """Measure the costs of `model`."""
        super().__init__(model)
        self._wall_s = 0.0
        self._cpu_s = 0.0
        self._num_questions = 0

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Return the measured model's answer."""
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        self._num_questions += 1
        try:
            return self.model.answer(question, attempt)
        finally:
            self._wall_s += time.perf_counter() - wall_s
            self._cpu_s += time.process_time() - cpu_s

    def costs(self) -> dict[str, float]:
        """Return the costs so far, with those that the model knows."""
        return {
            "decision_wall_s": self._wall_s,
            "decision_cpu_s": self._cpu_s,
            "num_questions": self._num_questions,
            **self.model.costs(),
        }


def _spelling(line: str) -> str:
    line = re.sub(r"\b0+(?=\d)", "", line.lower().rstrip(".: "))
    return " ".join(line.replace(",", " , ").split())


def first_line(text: str) -> str:
    """Return the first line that is not empty, without surrounding space; empty if there is none."""
    return next((line.strip() for line in text.splitlines() if line.strip()), "")


def lines_of(text: str) -> list[str]:
    """Return the lines that are not empty, without surrounding space."""
    return [line.strip() for line in text.splitlines() if line.strip()]
