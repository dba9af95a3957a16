"""Asking until there is an answer: a stated number of times, every failure counted."""

from collections import Counter
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from evonav.decision.question import AnswerError, DecisionModel, Fault, Question

A = TypeVar("A")

_COUNTERS: dict[Fault, str] = {"invalid": "invalid_answers", "refusal": "refusals", "lost": "lost_answers"}


@dataclass(frozen=True, slots=True)
class Asked:
    """A question and what came of one try at it, for pictures and diagnoses."""

    question: Question[Any]
    text: str
    """The answer as it came."""
    outcome: Literal["answered", "invalid", "refusal", "lost"]


class Asker:
    """Puts an agent's questions to its decision model.

    Counters, cumulative over a task: `decisions` (tries), `invalid_answers`, `refusals`, `lost_answers` (timeouts, lost
    connections, a server's errors), `failed_decisions` (questions given up: the agent then follows its fallback).
    """

    def __init__(self, model: DecisionModel, *, num_tries: int = 3) -> None:
        """Asks `model`, at most `num_tries` times a question."""
        self.model = model
        self.num_tries = num_tries
        self.counters: Counter[str] = Counter()
        self.asked: list[Asked] = []
        """Since `begin_round`."""

    def begin_round(self) -> None:
        """Forgets what was asked in the last round."""
        self.asked.clear()

    @property
    def reason(self) -> str:
        """Why the model last answered as it did, in its words: what follows the first line."""
        return " ".join(self.asked[-1].text.splitlines()[1:]) if self.asked else ""

    def ask(self, question: Question[A], num_tries: int | None = None) -> A | None:
        """The first valid answer; `None`, a failed decision, when there is none in all tries.

        Args:
            question: What is asked.
            num_tries: Instead of the asker's own, for a question whose number of tries is part of the algorithm.

        Raises:
            DecisionError: Asking again would not help.
        """
        for attempt in range(self.num_tries if num_tries is None else num_tries):
            self.counters["decisions"] += 1
            try:
                reply = self.model.answer(question, attempt)
            except AnswerError as error:
                self.counters[_COUNTERS[error.fault]] += 1
                self.asked.append(Asked(question, error.text or str(error), error.fault))
                continue
            self.asked.append(Asked(question, reply.text, "answered"))
            return reply.answer
        self.counters["failed_decisions"] += 1
        return None
