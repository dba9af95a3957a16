"""Agents' questions and goals' texts answered by a real language model on this machine: `make test-llm`."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from measure_llm import read_log
from serve_llm import NAME
from short_tasks import short_tasks

from evonav.component import Component
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.records.schema import EndState
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.tasks import load_tasks
from evonav.tasks.listing import BUNDLED_TASKS

ROOT = Path(__file__).parents[2]
SERVER_PYTHON = os.environ.get("EVONAV_LLM_PYTHON")
pytestmark = pytest.mark.skipif(SERVER_PYTHON is None, reason="needs a real language model: make test-llm")

KINDS = {
    "prefilter",
    "choose_snapshot",
    "subgraph",
    "graph",
    "goal-objects",
    "goal-relations",
    "category",
}


@pytest.fixture(scope="session")
def base_url() -> Iterator[str]:
    assert SERVER_PYTHON is not None
    command = [SERVER_PYTHON, ROOT / "scripts" / "studies" / "serve_llm.py", "--port", "0"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        assert server.stdout is not None
        told = server.stdout.readline()
        assert told.startswith(NAME), "the model could not be served: run scripts/studies/serve_llm.py by hand"
        yield told.split()[-1]
        server.terminate()


@pytest.fixture(autouse=True)
def key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "none")


def test_an_agent_is_evaluated_with_the_model_and_replayed(base_url: str, tmp_path: Path) -> None:
    options = {"model": NAME, "images": False, "request": {"max_tokens": 300}}
    cache = str(tmp_path / "exchanges.sqlite")
    hosts = {
        "asked": {"server": {"base_url": base_url, "timeout_s": 600.0}, "cache": cache, "mode": "record"},
        "replayed": {"cache": cache, "mode": "replay"},
    }
    texts = {}
    tasks, reader = short_tasks(BUNDLED_TASKS, num_stages=1)
    for name, host in hosts.items():
        decision = Component("evonav.decision.backends:vlm", options, host)
        config = RunConfig(backend=Backend(tasks=reader, decision=decision), hosting=AgentHosting("none"))
        evaluate(["fu"], tasks, tmp_path / name, config=config, num_workers=0)
        with RunStore(tmp_path / name) as store:
            texts[name] = list(store.record_texts())
            (record,) = store.records()
    assert record.state in (EndState.SUCCESS, EndState.FAILURE)
    counters = record.trace[-1].counters
    assert counters["decisions"] > counters.get("failed_decisions", 0)
    assert texts["asked"] == texts["replayed"]


def test_each_kind_of_question_is_answered(base_url: str, tmp_path: Path) -> None:
    script = ROOT / "scripts" / "studies" / "measure_llm.py"
    options = ["--tasks", BUNDLED_TASKS, "--num-tasks", "1", "--limit", "2", "--stride", "3", "--base-url", base_url]
    agents = ["--agent", "3d-mem,msgnav,evonav_studies.variants:unigoal_as_published", "--out", tmp_path]
    variables = {**os.environ, "PYTHONPATH": str(ROOT / "examples" / "studies" / "src")}
    subprocess.run([sys.executable, script, *options, *agents], check=True, cwd=ROOT, env=variables)
    rows = read_log(tmp_path / "answers.jsonl")
    assert {row["kind"] for row in rows} >= KINDS
    valid = {row["kind"] for row in rows if not row["fault"]}
    assert len(valid) >= 5, rows
    assert {row["fault"] for row in rows} <= {"", "invalid"}


def test_goal_texts_are_written(base_url: str, tmp_path: Path) -> None:
    houses = ROOT / "python" / "evonav" / "data" / "houses.jsonl.gz"
    command = [sys.executable, "-m", "evonav", "tasks"]
    generate = ["generate", "--houses", houses, "--limit", "1", "--num-stages", "3", "--out", tmp_path / "tasks"]
    subprocess.run([*command, *generate], check=True)
    write = ["write", tmp_path / "tasks", "--set", "decision.images=false", "--model", NAME, "--base-url", base_url]
    subprocess.run([*command, *write, "--set", f"decision.exchanges={tmp_path / 'goals.sqlite'}"], check=True)
    (task,) = load_tasks(tmp_path / "tasks")
    assert task.num_stages == 3
    for stage in task.public_stages:
        assert stage.writer == f"vlm:{NAME}, without images"
        assert len(stage.unified_instruction.split()) >= 5
