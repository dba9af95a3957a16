"""A decision model, and what it costs: time, questions, tokens and money."""

import time
from typing import Any, TypeVar

from evonav.decision.question import DecisionModel, Question, Reply
from evonav.decision.vlm.account import Account

A = TypeVar("A")


class Metered:
    """Answers what another model answers, and adds up."""

    def __init__(self, model: DecisionModel) -> None:
        """Meters `model`."""
        self.model = model
        self._wall_s = 0.0
        self._cpu_s = 0.0
        self._num_questions = 0

    @property
    def needs_images(self) -> bool:
        """The model's."""
        return self.model.needs_images

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """The model's answer."""
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        self._num_questions += 1
        try:
            return self.model.answer(question, attempt)
        finally:
            self._wall_s += time.perf_counter() - wall_s
            self._cpu_s += time.process_time() - cpu_s

    def costs(self) -> dict[str, float]:
        """So far; tokens and money of a model that keeps an account."""
        costs: dict[str, float] = {
            "decision_wall_s": self._wall_s,
            "decision_cpu_s": self._cpu_s,
            "num_questions": self._num_questions,
        }
        account = _account_of(self.model)
        if account is not None:
            costs["num_replayed"] = account.num_replayed
            costs["input_tokens"] = account.usage.input_tokens
            costs["output_tokens"] = account.usage.output_tokens
            if account.cost_usd is not None:
                costs["cost_usd"] = account.cost_usd
        return costs


def _account_of(model: Any) -> Account | None:  # noqa: ANN401 - of whatever wraps what
    """The account of a model, or of the one that it wraps."""
    while model is not None:
        account = getattr(getattr(model, "client", None), "account", None)
        if isinstance(account, Account):
            return account
        model = getattr(model, "model", None)
    return None
