"""Mistakes on purpose: as often as stated, the same for the same episode, and never silent."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from bundled_run import bundled_run
from scripted_model import Scripted

from evonav.component import Component
from evonav.decision.noisy import GARBAGE, NoiseRates, Noisy
from evonav.decision.prompts import Prompt
from evonav.decision.query import QuerySession
from evonav.decision.question import AnswerError, Question, Reply
from evonav.errors import InvalidArgumentError
from evonav.evaluation.run.components import Backend
from evonav.tasks.public import Goal

GOAL = Goal(1, "Mug", "Find the mug.", "Find the mug.", "Find the mug.", np.zeros((1, 1, 3), np.uint8))


@dataclass(frozen=True)
class Letter(Question[str]):
    """One of some letters."""

    kind: ClassVar[str] = "letter"
    letters: str = "abcde"
    goal: Goal = GOAL

    def prompt(self) -> Prompt:
        return Prompt.of(f"One of {self.letters}?")

    def parse(self, text: str) -> str:
        if len(text) != 1 or text not in self.letters:
            raise AnswerError("invalid", "no letter", text)
        return text

    def answer_text(self, answer: str) -> str:
        return answer

    def alternatives(self, answer: str) -> list[str]:
        return [letter for letter in self.letters if letter != answer]


def outcomes(rates: NoiseRates, num: int, seed: int = 0, letters: str = "abcde") -> list[str]:
    """What came of so many questions that are rightly answered with `a`."""
    model = Noisy(Scripted(lambda _: "a"), rates, seed)
    found = []
    for _ in range(num):
        try:
            found.append(model.answer(Letter(letters)).answer)
        except AnswerError as error:
            found.append(error.fault if error.fault != "invalid" or error.text in GARBAGE else "other words")
    return found


def test_rates_are_kept() -> None:
    rates = NoiseRates(wrong=0.2, unparsable=0.1, refusal=0.05, lost=0.02)
    num = 20_000
    counts = Counter(outcomes(rates, num))
    expected = {"a": 0.63, "b": 0.05, "c": 0.05, "d": 0.05, "e": 0.05, "invalid": 0.1, "refusal": 0.05, "lost": 0.02}
    assert set(counts) == set(expected)
    for outcome, share in expected.items():
        error = (share * (1 - share) / num) ** 0.5
        assert abs(counts[outcome] / num - share) < 4.5 * error, outcome


def test_streams_are_named_by_seed_kind_number_and_attempt() -> None:
    rates = NoiseRates(wrong=0.5)
    assert outcomes(rates, 200) == outcomes(rates, 200)
    assert outcomes(rates, 200) != outcomes(rates, 200, seed=1)
    # Asking another kind in between makes no difference, nor does trying again.
    model = Noisy(Scripted(lambda question: "a"), rates, 0)
    mixed = []
    for _ in range(200):
        mixed.append(model.answer(Letter()).answer)
        model.answer(Other())
        model.answer(Letter(), 1)
    assert mixed == outcomes(rates, 200)


@dataclass(frozen=True)
class Other(Letter):
    """Another kind."""

    kind: ClassVar[str] = "other"


def test_without_another_answer_the_right_one_stays() -> None:
    model = Noisy(Scripted(lambda _: "a"), NoiseRates(wrong=1.0), 0)
    assert model.answer(Letter("a")).answer == "a"
    assert model.counts == {"wrong": 1, "no_other": 1}
    reply = model.answer(Letter("ab"))
    assert reply == Reply("b", "b\nA wrong answer on purpose (noise).")


def test_lost_and_refused_questions_reach_no_model_and_delays_are_waited() -> None:
    inner = Scripted(lambda _: "a", needs_images=True)
    waits: list[float] = []
    model = Noisy(inner, NoiseRates(lost=0.5, refusal=0.5, delay=0.25), 0, sleep=waits.append)
    asker = QuerySession(model)
    assert asker.ask(Letter()) is None
    assert inner.questions == []
    assert waits == [0.25] * 3
    assert asker.counters["failed_decisions"] == 1
    assert asker.counters["lost_answers"] + asker.counters["refusals"] == 3
    assert "images" in model.needs


@pytest.mark.parametrize(
    ("rates", "words"),
    [
        ({"wrong": 1.5}, r"noise: wrong = 1\.5: Input should be less than or equal to 1"),
        ({"wrong": 0.7, "lost": 0.4}, "add up to 1.1"),
        ({"delay": -1.0}, "noise: delay = .*: Input should be"),
        ({"delay": float("nan")}, "noise: delay = .*: Input should be"),
        ({"wrng": 0.1}, "noise has no option 'wrng'; did you mean wrong?"),
        ({"wrong": "much"}, "noise: wrong = 'much'"),
    ],
)
def test_rates_that_make_no_sense_are_told(rates: dict[str, float], words: str) -> None:
    with pytest.raises(InvalidArgumentError, match=words):
        NoiseRates(**rates)


@pytest.mark.slow
def test_a_noisy_run_counts_mistakes_and_follows_its_seed(tmp_path: Path) -> None:
    noise = {"noise": {"wrong": 0.2, "unparsable": 0.3, "refusal": 0.2}}
    backend = Backend(decision=Component("evonav.decision.backends:text_match", noise))
    here, other = (
        bundled_run(tmp_path / str(seed), ["fu", "ftu"], backend, seed=seed, max_rounds=3) for seed in range(2)
    )
    assert not any(record.error for record in here)
    counted = Counter[str]()
    for record in here:
        counted.update(record.trace[-1].counters)
    assert counted["invalid_answers"] > 0
    assert counted["refusals"] > 0
    assert here != other
