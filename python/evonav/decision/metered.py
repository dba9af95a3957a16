"""Measure what a decision model costs: time, questions, tokens and money."""

import time
from typing import TypeVar

from evonav.decision.question import DecisionModel, ModelWrapper, Question, Reply

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
        """Return the costs so far, with those that the model knows."""
        return {
            "decision_wall_s": self._wall_s,
            "decision_cpu_s": self._cpu_s,
            "num_questions": self._num_questions,
            **self.model.costs(),
        }
