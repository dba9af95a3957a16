"""Controlled mistakes: how much does an agent depend on its model being right? Measured without asking one.

    model = Noisy(TextMatch(), NoiseRates(wrong=0.1, unparsable=0.05), seed=0)

What goes wrong is drawn per question from a stream of its own, named by the seed, the kind of question, how many of
that kind the episode has asked, and the attempt: not by when or where it is asked.
"""

import hashlib
import math
import random
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, TypeVar

from evonav.decision.question import AnswerError, DecisionModel, Question, Reply
from evonav.errors import InvalidArgumentError

A = TypeVar("A")

GARBAGE = (
    "",
    "I am sorry, but the images are too dark to tell.",
    '{"answer": "Obj',
    "?",
    "As a language model, I would first look around in the kitchen, and then decide.",
)
"""What comes instead of an answer; it goes through the question's grammar, which may yet find an answer in it."""


@dataclass(frozen=True, slots=True)
class NoiseRates:
    """Shares of tries that go wrong; at most one thing goes wrong with a try."""

    wrong: float = 0.0
    """Another of the question's valid answers, each as likely; questions without another keep theirs."""
    unparsable: float = 0.0
    """Words against the grammar."""
    refusal: float = 0.0
    """The model would not answer."""
    lost: float = 0.0
    """No answer came."""
    delay: float = 0.0
    """Seconds that every try takes longer; changes no answer."""

    def __post_init__(self) -> None:
        """Checks the shares.

        Raises:
            InvalidArgumentError: One is not within 0 to 1, they add up to more than 1, or the delay is not finite.
        """
        shares = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "delay"}
        for name, share in shares.items():
            if not 0.0 <= share <= 1.0:
                raise InvalidArgumentError(f"noise {name}: expected a share from 0 to 1, got {share!r}")
        if sum(shares.values()) > 1.0 + 1e-9:
            raise InvalidArgumentError(f"noise: shares add up to {sum(shares.values()):g}, more than 1")
        if not (math.isfinite(self.delay) and self.delay >= 0.0):
            raise InvalidArgumentError(f"noise delay: expected seconds, 0 or more, got {self.delay!r}")

    @classmethod
    def read(cls, options: Mapping[str, Any]) -> "NoiseRates":
        """Rates by name, as JSON.

        Raises:
            InvalidArgumentError: A name is unknown, or a rate makes no sense.
        """
        names = [field.name for field in fields(cls)]
        for name, value in options.items():
            if name not in names or isinstance(value, bool) or not isinstance(value, int | float):
                raise InvalidArgumentError(f"noise {name} = {value!r}: expected numbers for {', '.join(names)}")
        return cls(**options)


class Noisy:
    """Any decision model, with mistakes. One an episode: it counts questions."""

    def __init__(
        self, model: DecisionModel, rates: NoiseRates, seed: int, *, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        """A model that errs.

        Args:
            model: Answers.
            rates: How often what goes wrong.
            seed: Of the episode's agent.
            sleep: Waits so many seconds.
        """
        self.model = model
        self.rates = rates
        self.counts: Counter[str] = Counter()
        """What went wrong, by name; `no_other` counts wrong answers that there were none of."""
        self._seed = seed
        self._sleep = sleep
        self._num_asked: Counter[str] = Counter()

    @property
    def needs_images(self) -> bool:
        """As the model does."""
        return self.model.needs_images

    def check(self) -> None:
        """As the model does."""
        check = getattr(self.model, "check", None)
        if check is not None:
            check()

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """The model's answer, or what comes in its place. A lost or refused question does not reach the model.

        Raises:
            AnswerError: There is no usable answer this time.
            DecisionError: There will be none.
        """
        if attempt == 0:
            self._num_asked[question.kind] += 1
        draws = self._draws(question.kind, attempt)
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
        return reply if mistake is None else self._wrong(question, reply, draws)

    def _mistake(self, share: float) -> str | None:
        """What goes wrong with a try, if anything does."""
        for name in ("lost", "refusal", "unparsable", "wrong"):
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

    def _draws(self, kind: str, attempt: int) -> random.Random:
        name = f"noise\0{self._seed}\0{kind}\0{self._num_asked[kind]}\0{attempt}"
        return random.Random(hashlib.sha256(name.encode()).digest())  # noqa: S311 - not for secrets
