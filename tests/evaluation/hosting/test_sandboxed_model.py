"""An agent in a sandbox asks the run's model through the evaluator, and reaches nothing else of it."""

import os
import sqlite3
from pathlib import Path

import asking_agent
import pytest
from short_tasks import short_tasks
from toy_run import NEEDS_SANDBOX

from evonav.component import Component
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.evaluation.hosting.isolation import AgentHosting, Isolation
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.tasks.listing import BUNDLED_TASKS
from vlm_stub import KEY, check_request, serving

PRICE = [2.0, 8.0]


def run(folder: Path, agents: list[str], url: str | None, *, isolation: Isolation, num_stages: int = 1) -> RunStore:
    """Evaluate agents with a model at an address; without one, with what is cached."""
    host = {
        "server": {"base_url": url or "http://127.0.0.1:9/v1", "timeout_s": 20.0, "max_retries": 0},
        "cache": str(folder.parent / f"{folder.name}.exchanges"),
        "ledger": str(folder.parent / f"{folder.name}.spending"),
        "price": PRICE,
        "mode": "auto" if url else "replay",
    }
    decision = Component("evonav.decision.backends:vlm", {"model": "gpt-4o"}, host)
    hosting = AgentHosting(isolation, timeout_s=60.0)
    tasks, reader = short_tasks(BUNDLED_TASKS, num_stages)
    backend = Backend(tasks=reader, decision=decision)
    config = RunConfig(backend=backend, protocol=ProtocolConfig(max_rounds=6), hosting=hosting)
    evaluate(agents, tasks, folder, config=config, num_workers=1)
    return RunStore(folder)


def contents(path: Path) -> list[str]:
    db = sqlite3.connect(path)
    found = sorted(db.iterdump())
    db.close()
    return found


@pytest.mark.slow
@NEEDS_SANDBOX
def test_a_model_is_asked_for_an_agent_in_a_sandbox_as_for_any_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Records, exchanges and spending are the same, also where the model fails now and then."""
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    found = {}
    isolations: tuple[Isolation, ...] = ("process", "sandbox")
    for isolation in isolations:
        numbers = iter(range(10**6))
        replies = {3: {"status": 500, "raw": b"down"}, 5: {"text": ""}, 7: {"message": {"refusal": "no"}}}
        with serving(lambda request, n=numbers, r=replies: r.get(next(n), {"text": mock_answer(request)})) as stub:  # type: ignore[misc]
            stub.check = check_request
            with run(tmp_path / isolation, ["fu", "msgnav"], stub.url, isolation=isolation) as store:
                texts, costs = list(store.record_texts()), store.costs()
            assert stub.num_requests > 5
        spent, exchanges = (contents(tmp_path / f"{isolation}.{kind}") for kind in ("spending", "exchanges"))
        tokens = {key: (one["input_tokens"], one["output_tokens"], one["cost_usd"]) for key, one in costs.items()}
        found[isolation] = (texts, spent, exchanges, tokens)
    assert found["sandbox"] == found["process"]
    with run(tmp_path / "sandbox", ["fu", "msgnav"], None, isolation="sandbox") as store:  # already complete
        assert list(store.record_texts()) == found["process"][0]


@pytest.mark.slow
@NEEDS_SANDBOX
def test_an_agent_reaches_the_model_and_nothing_else_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    agent = f"{asking_agent.__file__}:Asking"
    with (
        serving(lambda _: {"text": "2"}) as stub,
        run(tmp_path / "run", [agent], stub.url, isolation="sandbox", num_stages=3) as store,
    ):
        first, second, third = store.records()
        assert stub.keys == {f"Bearer {KEY}"}
    details = first.trace[0].details
    assert details["answer"] == "2"
    assert (details["first cached"], details["none cached"], details["key"]) == (1, 1, None)
    assert details["held"] == ["_descriptor", "never_asks"]
    assert "must be at most" in details["large"]
    assert details["server"] == "PermissionError"
    assert second.trace[0].details["broken"] == "DecisionError"
    # The connection is lost for good; the agent's next stage fails, and nothing else.
    assert third.error is not None
    assert third.error.kind.value == "decision"
    assert "connection to the model is lost" in third.error.message
    assert os.path.getsize(tmp_path / "run.exchanges") > 0  # noqa: PTH202
