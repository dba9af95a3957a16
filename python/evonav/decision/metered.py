"""Measure what a decision model costs: time, questions, tokens and money."""

import time
from typing import Any, TypeVar

from evonav.decision.question import DecisionModel, Question, Reply
from evonav.decision.vlm.account import Account
from evonav.decision.wrapper import ModelWrapper

A = TypeVar("A")


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
        """Return the costs so far; tokens and money only if the model has an account."""
        costs: dict[str, float] = {
            "decision_wall_s": self._wall_s,
            "decision_cpu_s": self._cpu_s,
            "num_questions": self._num_questions,
        }
        account = _account_of(self.model)
        return costs if account is None else {**costs, **account_costs(account)}


def account_costs(account: Account) -> dict[str, float]:
    """Return the tokens of an account, and money if it knows prices."""
    costs: dict[str, float] = {
        "num_replayed": account.num_replayed,
        "input_tokens": account.usage.input_tokens,
        "output_tokens": account.usage.output_tokens,
    }
    return costs if account.cost_usd is None else {**costs, "cost_usd": account.cost_usd}


def _account_of(model: Any) -> Account | None:  # noqa: ANN401 - any wrapper
    """Return the account of a model, or of the model that it wraps."""
    while model is not None:
        account = getattr(getattr(model, "client", None), "account", None)
        if isinstance(account, Account):
            return account
        model = getattr(model, "model", None)
    return None
