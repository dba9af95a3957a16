"""Controlled mistakes measure how much an agent depends on the correctness of its model.

    model = Noisy(TextMatch(), NoiseRates(wrong=0.1, unparsable=0.05), seed=0)

Each question's mistake is drawn from a stream of its own, named by the seed, the kind of question, the number of
questions of that kind in the episode so far, and the attempt. Time and place of asking make no difference.
"""

import hashlib
import random
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Annotated, TypeVar

from pydantic import Field, model_validator

from evonav.decision.question import AnswerError, DecisionModel, ModelWrapper, Question, Reply
from evonav.errors import InvalidArgumentError
from evonav.records import Options, Share

A = TypeVar("A")

GARBAGE = (
    "",
    "I am sorry, but the images are too dark to tell.",
    '{"answer": "Obj',
    "?",
    "As a language model, I would first look around in the kitchen, and then decide.",
)
"""Texts in place of an answer; they go through the question's grammar, which may find an answer in one."""


class NoiseRates(Options):
    """Shares of tries that go wrong; at most one mistake happens in a try."""

    of = "noise"
    wrong: Share = 0.0
    """Share of wrong answers: another valid answer, each as likely; a question without another keeps its answer."""
    unparsable: Share = 0.0
    """Share of answers against the grammar."""
    refusal: Share = 0.0
    """Share of refusals."""
    lost: Share = 0.0
    """Share of lost answers."""
    confused: Share = 0.0
    """Share of answers that take another object of the goal's class for the goal, by the score of the model's rules."""
    delay: Annotated[float, Field(ge=0.0)] = 0.0
    """Seconds added to every try; they change no answer."""

    @model_validator(mode="after")
    def _check(self) -> "NoiseRates":
        total = sum(self.model_dump(exclude={"delay"}).values())
        if total > 1.0 + 1e-9:
            raise ValueError(f"shares add up to {total:g}, more than 1")
        return self


class Noisy(ModelWrapper):
    """A decision model with mistakes. It counts questions, so each episode needs its own.

    A confused answer goes to another remembered object of the goal's class, each as likely as the model's rules score
    it, and all alike if they score none. Without another object, an answer that goes to one explores instead, as if
    the goal was not seen yet. Else, and where the question offers no objects, the answer stays. The records count
    these as `confused_objects`, `confused_unseen` and `confused_kept`.
    """

    def __init__(
        self, model: DecisionModel, rates: NoiseRates, seed: int, *, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        """Create a model that makes mistakes.

        Args:
            sleep: Waits for a number of seconds.

        Raises:
            InvalidArgumentError: Answers are to be confused, but the model has no rules whose scores tell how likely.
        """
        if rates.confused and model.matcher is None:
            raise InvalidArgumentError(
                f"noise confused = {rates.confused:g}: needs a model that scores objects by rules, text or looks"
            )
        super().__init__(model)
        self.rates = rates
        self.counts: Counter[str] = Counter()
        """Number of mistakes by name; `no_other` counts questions without another answer."""
        self._seed = seed
        self._sleep = sleep
        self._num_asked: Counter[str] = Counter()

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Return the model's answer, or a mistake; a lost or refused question does not reach the model.

        Raises:
            AnswerError: There is no usable answer this time.
            DecisionError: There will be none.
        """
        if attempt == 0:
            self._num_asked[question.kind] += 1
        name = f"noise\0{self._seed}\0{question.kind}\0{self._num_asked[question.kind]}\0{attempt}"
        draws = random.Random(hashlib.sha256(name.encode()).digest())  # noqa: S311 - not for secrets
        if self.rates.delay:
            self._sleep(self.rates.delay)
        mistake = self._mistake(draws.random())
        if mistake is not None:
            self.counts[mistake] += 1
        if mistake == "lost":
            raise AnswerError("lost", "no answer came (noise)")
        if mistake == "refusal":
            raise AnswerError("refusal", "the model would not answer (noise)")
        if mistake == "unparsable":
            garbage = draws.choice(GARBAGE)
            return Reply(question.parse(garbage), garbage)
        reply = self.model.answer(question, attempt)
        if mistake == "confused":
            return self._confused(question, reply, draws)
        return reply if mistake is None else self._wrong(question, reply, draws)

    def _mistake(self, share: float) -> str | None:
        """Return the mistake of a try, if there is one."""
        for name in ("lost", "refusal", "unparsable", "wrong", "confused"):
            rate: float = getattr(self.rates, name)
            if share < rate:
                return name
            share -= rate
        return None

    def _wrong(self, question: Question[A], reply: Reply[A], draws: random.Random) -> Reply[A]:
        others = question.alternatives(reply.answer)
        if not others:
            self.counts["no_other"] += 1
            return reply
        other = others[draws.randrange(len(others))]
        return Reply(other, f"{question.answer_text(other)}\nA wrong answer on purpose (noise).")

    def _confused(self, question: Question[A], reply: Reply[A], draws: random.Random) -> Reply[A]:
        assert self.matcher is not None, "checked when it was made"
        rated = question.namesakes(reply.answer, self.matcher)
        if rated:
            answers, scores = zip(*rated, strict=True)
            (other,) = draws.choices(answers, scores if any(scores) else None)
            return _mistaken(question, other, "confused_objects")
        unseen = question.exploring(reply.answer, self.matcher)
        if unseen is not None:
            return _mistaken(question, unseen, "confused_unseen")
        return replace(reply, counter="confused_kept")


def _mistaken(question: Question[A], answer: A, counter: str) -> Reply[A]:
    return Reply(answer, f"{question.answer_text(answer)}\nA confusion on purpose (noise).", counter)


def read_rates(text: str, known: Iterable[str]) -> dict[str, float]:
    """Read rates as people write them: `wrong=0.1,lost=0.01`.

    Raises:
        InvalidArgumentError: A name is unknown, occurs twice, or has no number.
    """
    rates: dict[str, float] = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        name, _, value = item.partition("=")
        if name not in known or name in rates:
            raise InvalidArgumentError(f"{item}: expected each of {', '.join(known)} once, as name=number")
        try:
            rates[name] = float(value)
        except ValueError:
            raise InvalidArgumentError(f"{item}: expected a number after {name}=") from None
    return rates
