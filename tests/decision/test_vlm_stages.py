"""Whole stages with a model behind real HTTP: what is asked, what goes wrong and is counted, and its replay."""

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from short_tasks import short_tasks

from evonav.component import Component
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.decision.vlm.mock_server import FAULTS, MockReply, faulty, without_schemas
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.tasks.listing import BUNDLED_TASKS
from vlm_stub import KEY, Stub, check_request, images_in, serving

AGENTS = ["fu", "ftu"]


def answers(request: dict[str, Any]) -> MockReply:
    return {"text": mock_answer(request)}


class Run:
    """Runs the first stages of a bundled task against a server, or against what was kept of it."""

    def __init__(self, folder: Path, *, max_rounds: int = 8) -> None:
        self.folder = folder
        self.max_rounds = max_rounds
        self.max_actions = 500
        self.num_stages = 1

    def __call__(
        self,
        name: str,
        url: str | None,
        *,
        agents: list[str] | None = None,
        num_workers: int = 0,
        server: dict[str, Any] | None = None,
        **options: Any,
    ) -> list[str]:
        """Records as stored; without a `url` in mode `replay`."""
        host = {
            "server": {
                "base_url": url or "http://127.0.0.1:9/v1",
                "timeout_s": 20.0,
                "max_retries": 2,
                **(server or {}),
            },
            "cache": str(self.folder / "exchanges.sqlite"),
            "mode": "auto" if url else "replay",
        }
        protocol = ProtocolConfig(max_rounds=self.max_rounds, max_actions=self.max_actions)
        decision = Component("evonav.decision.backends:vlm", {"model": "gpt-4o", **options}, host)
        tasks, reader = short_tasks(BUNDLED_TASKS, self.num_stages)
        config = RunConfig(backend=Backend(tasks=reader, decision=decision), protocol=protocol)
        evaluate(agents or AGENTS, tasks, self.folder / name, config=config, num_workers=num_workers)
        with RunStore(self.folder / name) as store:
            return list(store.record_texts())


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    return Run(tmp_path)


def records(texts: list[str]) -> list[StageRecord]:
    return [StageRecord.model_validate_json(text) for text in texts]


def counters(text: str) -> Counter[str]:
    """Of a stage's last round, which are of the whole task so far."""
    return Counter(records([text])[0].trace[-1].counters)


@pytest.mark.slow
def test_whole_stages_ask_what_the_api_takes_with_images_that_can_be_seen(run: Run, tmp_path: Path) -> None:
    run.max_rounds, run.num_stages = 12, 2
    with serving(answers) as stub:
        first = run("first", stub.url)
    assert not [record.error for record in records(first) if record.error]
    assert any(record.state is EndState.SUCCESS for record in records(first))
    assert sum((counters(text) for text in first), Counter())["invalid_answers"] == 0
    assert stub.keys == {f"Bearer {KEY}"}
    assert stub.requests
    assert all(images_in(request) for request in stub.requests)
    for request in stub.requests:
        check_request(request)  # the server has done so too, and answered 400 if it was not valid
        assert {**request, "messages": 0, "response_format": 0} == {
            "model": "gpt-4o",
            "messages": 0,
            "temperature": 0.7,
            "top_p": 0.95,
            "max_tokens": 4096,
            "seed": 0,
            "response_format": 0,
        }
    assert run("again", None) == first
    for file in tmp_path.rglob("*"):
        assert not file.is_file() or (
            KEY.encode() not in file.read_bytes() and stub.url.encode() not in file.read_bytes()
        )


FAULTY = (
    # Passing faults of the way are the client's business: the agent never hears of them.
    ("rate_limit", 1, None),
    ("server_error", 1, None),
    ("disconnect", 1, None),
    # Lasting ones are lost answers, after as many retries as allowed.
    ("rate_limit", 3, "lost_answers"),
    ("server_error", 3, "lost_answers"),
    ("disconnect", 3, "lost_answers"),
    ("hang", 3, "lost_answers"),
    ("malformed", 1, "invalid_answers"),
    ("broken_json", 1, "invalid_answers"),
    ("truncated", 1, "invalid_answers"),
    ("empty", 1, "invalid_answers"),
    ("off_topic", 1, "invalid_answers"),
    ("refusal", 1, "refusals"),
    ("filtered", 1, "refusals"),
)
QUICK = {("server_error", 1), ("server_error", 3), ("malformed", 1), ("refusal", 1)}
"""One of each outcome."""


@pytest.mark.parametrize(
    ("fault", "num_times", "counter"),
    [pytest.param(*case, marks=() if case[:2] in QUICK else pytest.mark.slow) for case in FAULTY],
)
def test_faults_are_survived_counted_and_replayed(run: Run, fault: str, num_times: int, counter: str | None) -> None:
    run.max_rounds = 1
    reply = {**FAULTS[fault], "hang_s": 6.0} if fault == "hang" else dict(FAULTS[fault])
    if fault == "server_error":
        reply["headers"] = {"Retry-After-Ms": "5"}
    with serving(answers) as stub:
        stub.script = [reply] * num_times
        first = run("first", stub.url, agents=["fu"], server={"timeout_s": 3.0} if fault == "hang" else None)
    counted = counters(first[0])
    faults = {name: counted[name] for name in ("invalid_answers", "lost_answers", "refusals") if counted[name]}
    assert faults == ({} if counter is None else {counter: 1})
    assert counted["failed_decisions"] == 0
    assert all(record.state is not EndState.ERRORED for record in records(first))
    assert run("again", None, agents=["fu"]) == first


@pytest.mark.parametrize("fault", ["off_topic", "refusal", "malformed"])
def test_a_question_given_up_is_counted_and_the_fallback_followed(run: Run, fault: str) -> None:
    run.max_rounds = 1
    with serving(answers) as stub:
        stub.script = [FAULTS[fault]] * 3
        first = run("first", stub.url, agents=["fu"])
        seeds = [request["seed"] for request in (stub.requests or [])[:3]]
    (only,) = records(first)[0].trace
    assert only.counters["failed_decisions"] == 1
    assert only.counters["decisions"] == 3
    assert only.details["reason"] == "no valid answer"
    assert only.choice.startswith("frontier")
    assert seeds == [0, 1, 2]  # each try is another request, or its record would be another answer's
    assert run("again", None, agents=["fu"]) == first


def test_what_would_fail_every_question_ends_the_stage(run: Run) -> None:
    with serving(answers) as stub:
        stub.script = [{"status": 401, "raw": json.dumps({"error": {"message": f"wrong key {KEY}"}}).encode()}] * 9
        texts = run("first", stub.url, agents=["fu"])
    assert KEY not in "".join(texts)
    first = records(texts)[0]
    assert (first.state, first.error and first.error.kind) == (EndState.ERRORED, "decision")
    # Nothing of it was kept, and a replay has no answer to anything.
    replayed = records(run("again", None, agents=["fu"]))[0]
    assert replayed.error is not None
    assert (replayed.error.kind, "not_recorded" in replayed.error.message) == ("decision", True)


def test_a_server_without_schemas_is_asked_in_lines(run: Run) -> None:
    run.max_rounds = 2

    def check(request: dict[str, Any]) -> None:
        check_request(request)
        without_schemas(request)

    with serving(answers) as stub:
        stub.check = check
        first = run("first", stub.url, agents=["fu"])
        refused = [request for request in stub.requests or [] if "response_format" in request]
    assert len(refused) == 1
    assert len(stub.requests or []) > 2
    assert counters(first[-1])["invalid_answers"] == 0
    assert run("again", None, agents=["fu"]) == first
    with serving(answers) as stub:
        stub.check = check
        errored = records(run("on", stub.url, agents=["fu"], structured="on"))[0]
        assert errored.error is not None
        assert errored.error.kind == "decision"


def test_a_server_that_overlooks_schemas_may_answer_in_lines(run: Run) -> None:
    def in_lines(request: dict[str, Any]) -> MockReply:
        return {"text": mock_answer(_plain(request))}

    run.max_rounds = 1
    with serving(in_lines) as stub:
        first = run("first", stub.url, agents=["fu"])
        strict = run("strict", stub.url, agents=["fu"], structured="on", request={"seed": 7})
    assert counters(first[0])["invalid_answers"] == 0
    assert counters(strict[0])["invalid_answers"] > 0


def _plain(request: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in request.items() if name != "response_format"}


def changing() -> Callable[[dict[str, Any]], MockReply]:
    """A model that never answers the same question twice the same way, and often badly."""
    return faulty({"off_topic": 0.2, "refusal": 0.1, "malformed": 0.1, "empty": 0.1}, seed=3)


@pytest.mark.slow
def test_workers_that_ask_the_same_have_the_same_answer_and_a_replay_is_the_run(run: Run) -> None:
    run.max_rounds, run.num_stages = 3, 2
    with serving(changing()) as stub:
        first = run("first", stub.url, num_workers=2)
    # Workers that have ended leave all that they stored in the file itself.
    assert sum(log.stat().st_size for log in run.folder.glob("exchanges.sqlite-wal")) == 0
    assert sum(counters(text)["invalid_answers"] for text in first) > 0
    assert run("again", None, num_workers=0) == first
    # Both agents begin with the same question: they were told the same.
    rounds = {record.agent: record.trace[0].choice for record in records(first) if record.stage == 1}
    assert rounds["fu"] == rounds["ftu"]


def test_a_run_gone_on_with_is_the_run_that_was_not_interrupted(run: Run, tmp_path: Path) -> None:
    run.max_rounds, run.num_stages = 4, 2
    with serving(changing()) as stub:
        first = run("first", stub.url, agents=["fu"])
    with RunStore(tmp_path / "first") as store:
        last = records(first)[-1]
        store.forget_episode(last.agent, last.task_id, last.stage)
    with serving(lambda _: {"text": "another model altogether"}) as stub:
        assert run("first", stub.url, agents=["fu"]) == first
        assert stub.requests == []


@pytest.mark.slow
@pytest.mark.parametrize("agent", ["3d-mem", "msgnav", "unigoal", "evonav_studies.variants:unigoal_as_published"])
def test_every_agent_asks_what_the_api_takes_and_goes_on_after_bad_answers(run: Run, agent: str) -> None:
    """With rules that follow every grammar nothing is invalid; with a bad model all is counted, and replayed."""
    run.max_rounds, run.max_actions, run.num_stages = 2, 40, 2
    with serving(answers) as stub:
        good = run("good", stub.url, agents=[agent])
    assert [record.error for record in records(good) if record.error] == []
    asked = counters(good[-1])
    assert asked["decisions"] > 0
    assert asked["invalid_answers"] + asked["refusals"] + asked["lost_answers"] == 0
    run.folder = run.folder / "bad"
    with serving(faulty({"off_topic": 0.3, "refusal": 0.2, "malformed": 0.2, "empty": 0.2}, seed=1)) as stub:
        bad = run("first", stub.url, agents=[agent])
    assert [record.error for record in records(bad) if record.error] == []
    faults = counters(bad[-1])
    assert faults["invalid_answers"] > 0
    assert faults["failed_decisions"] > 0
    assert run("again", None, agents=[agent]) == bad


def test_a_model_that_is_not_to_look_gets_no_images(run: Run) -> None:
    run.max_rounds = 2
    with serving(answers) as stub:
        run("blind", stub.url, agents=["fu"], images=False)
    assert stub.requests
    assert not any(images_in(request) for request in stub.requests)


def test_the_stub_itself_refuses(run: Run) -> None:
    """The server's check is no formality: a request that OpenAI would not take is a 400."""
    with serving(answers) as stub:
        assert stub.response({"model": "m"})["status"] == 400
        assert isinstance(stub, Stub)
