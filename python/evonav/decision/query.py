"""Ask a decision model until it gives a valid answer, a limited number of times, and count every failure."""

from collections import Counter
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from evonav.decision.question import AnswerError, DecisionModel, Fault, Question

A = TypeVar("A")

_COUNTERS: dict[Fault, str] = {"invalid": "invalid_answers", "refusal": "refusals", "lost": "lost_answers"}


@dataclass(frozen=True, slots=True)
class QueryLogEntry:
    """A question and the outcome of one try to answer it, for pictures and diagnoses."""

    question: Question[Any]
    text: str
    """The model's unparsed answer."""
    outcome: Literal["answered", "invalid", "refusal", "lost"]


class QuerySession:
    """Puts an agent's questions to its decision model.

    Counters, cumulative over a task: `decisions` (tries), `invalid_answers`, `refusals`, `lost_answers` (timeouts, lost
    connections, a server's errors), `failed_decisions` (questions without a valid answer in any try: the agent then
    follows its fallback), and answers by their `Reply.counter`.
    """

    def __init__(self, model: DecisionModel, *, num_tries: int = 3) -> None:
        """Create a session that asks `model` each question at most `num_tries` times."""
        self.model = model
        self.num_tries = num_tries
        self.counters: Counter[str] = Counter()
        self.log: list[QueryLogEntry] = []
        """Every try since `begin_round`, in order."""

    def begin_round(self) -> None:
        """Clear the log of the last round."""
        self.log.clear()

    @property
    def reason(self) -> str:
        """The reason that the model gave with its last answer: all lines after the first."""
        return " ".join(self.log[-1].text.splitlines()[1:]) if self.log else ""

    def ask(self, question: Question[A], num_tries: int | None = None) -> A | None:
        """Return the first valid answer, or `None`, a failed decision, if no try gives one.

        Args:
            num_tries: Number of tries in place of the session's own, where it is part of an algorithm.

        Raises:
            DecisionError: Asking again would not help.
        """
        for attempt in range(self.num_tries if num_tries is None else num_tries):
            self.counters["decisions"] += 1
            try:
                reply = self.model.answer(question, attempt)
            except AnswerError as error:
                self.counters[_COUNTERS[error.fault]] += 1
                self.log.append(QueryLogEntry(question, error.text or str(error), error.fault))
                continue
            if reply.counter is not None:
                self.counters[reply.counter] += 1
            self.log.append(QueryLogEntry(question, reply.text, "answered"))
            return reply.answer
        self.counters["failed_decisions"] += 1
        return None
