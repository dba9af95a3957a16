"""Models of one's own: what they need to have, and that they are kept and replayed like any other."""

import subprocess
import sys
from pathlib import Path

import pytest
from test_noisy import Letter

from evonav.decision.backends import custom
from evonav.decision.custom_model import CustomClient
from evonav.decision.options import AskedOptions
from evonav.decision.prompts import Prompt
from evonav.decision.question import AnswerError, DecisionModel, Question, Reply
from evonav.decision.vlm.caching_client import ResponseCache
from evonav.decision.vlm.decision import VlmDecision
from evonav.decision.vlm.errors import VlmError
from evonav.errors import DecisionError, InvalidArgumentError
from evonav.evaluation.records.store import RunStore

EXAMPLES = Path(__file__).parents[2] / "examples"


class Asking:
    """Counts how often it is asked."""

    needs = frozenset()

    def __init__(self, seed: int = -1) -> None:
        self.seed = seed
        self.prompts: list[str] = []

    def ask(self, prompt: Prompt) -> str:
        self.prompts.append(prompt.text)
        return "abc"[len(self.prompts) - 1]


class Answering(DecisionModel):
    """A whole decision model."""

    needs = frozenset()

    def answer(self, question: Question[str], attempt: int = 0) -> Reply[str]:
        return Reply(question.parse("b"), "b")


class Neither:
    """Nothing of a model."""


class Failing:
    """Raises what it is told to."""

    def __init__(self, error: BaseException) -> None:
        self.error = error
        self.num = 0

    def ask(self, prompt: Prompt) -> str:
        self.num += 1
        raise self.error


def test_asked_once_and_kept_by_attempt(tmp_path: Path) -> None:
    store = ResponseCache(tmp_path / "e.sqlite")
    asking = Asking()
    model = VlmDecision(CustomClient("mine", asking, store=store), AskedOptions(structured="off"))
    assert [model.answer(Letter(), attempt).answer for attempt in (0, 0, 1, 0)] == ["a", "a", "b", "a"]
    assert len(asking.prompts) == 2
    replay = VlmDecision(CustomClient("mine", asking, store=store, mode="replay"), AskedOptions(structured="off"))
    assert replay.answer(Letter(), 1).answer == "b"
    for client in (replay.client, CustomClient("other", asking, store=store, mode="replay")):
        with pytest.raises(VlmError, match="not_recorded"):
            client.ask(Prompt.of("never asked"))


def test_lost_answers_are_lost_and_kept_and_bugs_are_told(tmp_path: Path) -> None:
    store = ResponseCache(tmp_path / "e.sqlite")
    failing = Failing(TimeoutError("too slow"))
    model = VlmDecision(CustomClient("mine", failing, store=store), AskedOptions(structured="off"))
    for _ in range(2):
        with pytest.raises(AnswerError, match="too slow") as caught:
            model.answer(Letter())
        assert caught.value.fault == "lost"
    assert failing.num == 1
    broken = VlmDecision(CustomClient("mine", Failing(KeyError("x")), store=store), AskedOptions(structured="off"))
    with pytest.raises(DecisionError, match="mine: KeyError"):
        broken.answer(Letter(), 1)
    assert len(store) == 0


def test_objects_are_made_by_import_path() -> None:
    asking = custom(7, path="test_own:Asking")
    assert asking.needs == frozenset()
    assert asking.answer(Letter()).answer == "a"
    assert custom(7, path="test_own:Answering").answer(Letter()).answer == "b"
    for path, words in (
        ("test_own:Neither", "no evonav.decision.DecisionModel and has no `ask`"),
        ("test_own:Nobody", "Nobody"),
        ("no_such_module:X", "no_such_module"),
    ):
        with pytest.raises(InvalidArgumentError, match=words):
            custom(0, path=path)


class Heavy:
    """Takes long to load."""

    num_made = 0
    needs = frozenset()

    def __init__(self) -> None:
        Heavy.num_made += 1

    def ask(self, prompt: Prompt) -> str:
        return "a"


def test_models_are_loaded_once_and_only_to_be_asked(tmp_path: Path) -> None:
    path = str(tmp_path / "e.sqlite")
    models = [custom(seed, path="test_own:Heavy", cache=path) for seed in range(2)]
    assert models[0].needs == frozenset()
    assert Heavy.num_made == 0
    assert [model.answer(Letter(), attempt).answer for attempt, model in enumerate(models)] == ["a", "a"]
    assert Heavy.num_made == 1
    replay = custom(5, path="test_own:Heavy", cache=path, mode="replay")
    assert replay.answer(Letter(), 1).answer == "a"
    assert Heavy.num_made == 1


@pytest.mark.slow
def test_the_example_runs_and_replays_without_its_model(tmp_path: Path) -> None:
    """As docs/decision.md tells a user to; the replay finds no picture to look at."""
    command = [sys.executable, "-m", "evonav", "evaluate", "--decision", "own_vlm:OwnVlm", "--agent", "fu"]
    common = [*command, "--limit", "1", "--workers", "0", "--set", f"decision.exchanges={tmp_path / 'e.sqlite'}"]
    for extra in (["--out", str(tmp_path / "a")], ["--out", str(tmp_path / "b"), "--set", "decision.mode=replay"]):
        done = subprocess.run([*common, *extra], cwd=EXAMPLES, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    texts = []
    for name in "ab":
        with RunStore(tmp_path / name) as run:
            texts.append(list(run.record_texts()))
    assert texts[0] == texts[1]
    assert "questions asked" in done.stdout
    assert '"invalid_answers":0' in texts[0][0] or "invalid_answers" not in texts[0][0]
