"""The options on who answers: what a run is given, what is refused, and what is printed."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import evonav
from evonav.cli import app
from evonav.decision.prompts import CHANGE_NOTICE, Prompt, Turn
from evonav.decision.vlm.client import VlmClient, VlmConfig
from evonav.decision.vlm.errors import VlmError
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.store import RunStore
from vlm_stub import KEY, check_request, serving

COMMON = ("--agent", "fu", "--limit", "1", "--workers", "0", "--isolation", "none")


def sets(**values: object) -> list[str]:
    """Return the options that set keys of `decision`."""
    return [word for key, value in values.items() for word in ("--set", f"decision.{key}={value}")]


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    return result.exit_code, result.output + str(result.exception or "")


@pytest.fixture
def prices(tmp_path: Path) -> Path:
    path = tmp_path / "prices.json"
    path.write_text('{"m": {"input_usd": 1.0, "output_usd": 10.0}}')
    return path


@pytest.mark.slow
def test_a_run_with_a_model_is_recorded_paid_for_and_replayed(
    tmp_path: Path, prices: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("EVONAV_VLM_MODEL", "m")
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    out, again = tmp_path / "out", tmp_path / "again"
    with serving(lambda request: {"text": mock_answer(request)}) as stub:
        options = ("--decision", "vlm", "--base-url", stub.url, "--prices", prices, "--max-cost", 5)
        warm = (*options, *sets(temperature=0.2))
        code, printed = run("evaluate", *COMMON, *warm, "--seed", 3, "--out", out)
        num_asked = len(stub.requests or [])
        # Going on asks nothing, and counts on.
        assert run("evaluate", *COMMON, *warm, "--seed", 3, "--out", out)[0] == 0
        assert len(stub.requests or []) == num_asked > 0
        for request in stub.requests or []:
            check_request(request)
            assert (request["temperature"], request["seed"]) == (0.2, 3)
        # Another temperature is another run.
        code_other, told = run("evaluate", *COMMON, *options, "--out", out, "--seed", 3)
    assert code == 0, printed
    assert f"m: {num_asked} questions asked" in printed
    assert f"${num_asked * 0.002:.4f}" in printed  # 1000 tokens in, 100 out
    assert code_other != 0
    assert "temperature" in told
    replay = ("--decision", "vlm", *sets(mode="replay", exchanges=out / "exchanges.sqlite", temperature=0.2))
    monkeypatch.delenv("OPENAI_API_KEY")
    code, printed = run("evaluate", *COMMON, *replay, "--seed", 3, "--out", again)
    assert code == 0, printed
    assert f"m: 0 questions asked, {num_asked} answered from exchanges" in printed
    with RunStore(out) as first, RunStore(again) as second:
        assert list(first.record_texts()) == list(second.record_texts())
        identity = json.dumps(first.meta("config"))
        assert KEY not in identity
        assert stub.url not in identity


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--decision", "vlm"), "--model is needed"),
        (("--decision", "gpt"), "expected text, looks, vlm or module:name"),
        (("--set", "decision.tell_of_change=true"), "decision.tell_of_change is of no use"),
        (("--set", "decision.temperature=0.5"), "decision.temperature is of no use"),
        (("--set", "decision.eagerness=0.5"), "decision.eagerness is of no use where text decides"),
        (("--decision", "looks", "--set", "decision.eagerness=2"), "expected a number from 0 to 1"),
        (("--decision", "looks", "--set", "decision.mistakes=-1"), "expected a temperature"),
        (("--decision", "own_vlm:OwnVlm", "--set", "decision.max_tokens=5"), "decision.max_tokens is of no use"),
        (("--decision", "nothing:Here"), "nothing"),
        (("--decision", "vlm", "--model", "m"), "OPENAI_API_KEY"),
        (("--decision", "vlm", "--model", "m", "--set", "decision.mode=replay"), "no exchanges here"),
        (("--decision", "vlm", "--model", "x", "--prices", "PRICES", "--base-url", "http://x/v1"), "no prices of"),
        (("--decision", "vlm", "--model", "m", "--max-cost", 1, "--base-url", "http://x"), "the model's prices"),
        (("--decision", "vlm", "--model", "m", *sets(temperature=9), "--base-url", "http://x/v1"), "temperature"),
        (("--set", "decision.noise.wrong=2"), "noise: wrong = 2"),
        (("--set", "decision.noise.wrnog=0.1"), "wrnog"),
        (("--set", "decision.noise.wrong=many"), "Input should be a valid number"),
        (("--dry-run",), "--dry-run is for --decision vlm"),
        (("--dry-run", "--decision", "own_vlm:OwnVlm"), "--dry-run is for --decision vlm"),
    ],
)
def test_options_that_make_no_sense_are_told(
    tmp_path: Path, prices: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[object, ...], words: str
) -> None:
    for name in ("OPENAI_API_KEY", "OPENAI_BASE_URL", "EVONAV_VLM_MODEL"):
        monkeypatch.delenv(name, raising=False)
    options = tuple(prices if option == "PRICES" else option for option in options)
    code, told = run("evaluate", *COMMON, *options, "--out", tmp_path / "out")
    assert code != 0
    assert words in " ".join(told.replace("│", " ").split())
    assert not (tmp_path / "out" / "records.sqlite").exists()


@pytest.mark.slow
def test_a_spent_budget_is_told_with_what_to_do(tmp_path: Path) -> None:
    prices = tmp_path / "prices.json"
    prices.write_text('{"m": {"input_usd": 1.0, "output_usd": 10.0}}')
    options = ("--decision", "vlm", "--model", "m", "--prices", prices, "--max-cost", 0.0001)
    with serving(lambda request: {"text": mock_answer(request)}) as stub:
        code, printed = run("evaluate", *COMMON, *options, "--base-url", stub.url, "--out", tmp_path / "out")
    assert code == 3
    assert "stages errored: budget reached" in printed
    assert "higher --max-cost and --retry-errored" in printed
    code, printed = run("evaluate", *COMMON, *options[:4], "--dry-run", "--out", tmp_path / "out")
    assert code == 0
    assert "0%" not in printed  # all tasks were run, which says nothing about a model
    assert "name a file of prices with --prices" in printed


@pytest.mark.slow
def test_recording_wants_a_new_file(tmp_path: Path) -> None:
    common = ("evaluate", *COMMON, "--decision", "vlm", "--model", "m", "--set", "decision.mode=record")
    with serving(lambda request: {"text": mock_answer(request)}) as stub:
        options = (*common, "--base-url", stub.url, "--set", f"decision.exchanges={tmp_path / 'e.sqlite'}")
        assert run(*options, "--out", tmp_path / "a")[0] == 0
        assert run(*options, "--out", tmp_path / "a")[0] == 0  # goes on with its own
        code, told = run(*options, "--out", tmp_path / "b")
    assert code != 0
    assert "holds exchanges already" in told


def _texts(requests: list[dict[str, Any]]) -> list[str]:
    """Return the first text of each request."""
    return [
        next(part["text"] for part in request["messages"][0]["content"] if part["type"] == "text")
        for request in requests
    ]


def _only_task(run_dir: Path) -> str:
    with RunStore(run_dir) as store:
        (task_id,) = {task_id for _, task_id, _ in store.states()}
    return task_id


@pytest.mark.slow
def test_a_model_is_told_of_changes_in_all_prompts_or_in_none(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with serving(lambda request: {"text": mock_answer(request)}) as stub:
        assert stub.requests is not None
        model = {"kind": "vlm", "model": "m", "base_url": stub.url}
        common: dict[str, Any] = {"limit": 1, "workers": 0, "protocol": ProtocolConfig(max_rounds=2)}
        told = {**model, "tell_of_change": True}
        evonav.evaluate("fu", "3d-mem", decision=told, out=tmp_path / "told", **common)
        assert all(text == CHANGE_NOTICE for text in _texts(stub.requests))
        with pytest.raises(evonav.EvonavError, match="tells_of_change"):
            evonav.evaluate("fu", decision=model, out=tmp_path / "told", **common)
        stub.requests.clear()
        evonav.evaluate("3d-mem", "ftu", decision=model, out=out, **common)
        assert not any("moved" in text for text in _texts(stub.requests))


def test_models_that_think_first_are_asked_as_they_want_to_be(tmp_path: Path) -> None:
    options = ("--decision", "vlm", "--model", "o9", *sets(reasoning="true", mode="live"), "--out", tmp_path / "out")
    with serving(lambda request: {"status": 401, "raw": b"{}"}) as stub:
        run("evaluate", *COMMON, *options, "--base-url", stub.url)
    request = (stub.requests or [])[0]
    check_request(request)
    assert request["max_completion_tokens"] == 4096
    assert not {"max_tokens", "temperature", "top_p"} & request.keys()
    assert not (tmp_path / "out" / "exchanges.sqlite").exists()


def test_the_stand_in_serves_until_it_is_stopped() -> None:
    options = ["--port", "0", "--faults", "refusal=1.0", "--no-schemas"]
    command = [sys.executable, "-m", "evonav.decision.vlm.mock_server", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout
        url = server.stdout.readline().split()[1].rstrip(";")
        client = VlmClient(VlmConfig("m", base_url=url, api_key=KEY))
        with pytest.raises(VlmError, match="refusal"):
            client.ask(Prompt.of("Well?"))
        with pytest.raises(VlmError, match="response_format"):
            client.ask(Prompt((Turn("user", ("Well?",)),), {"type": "object"}))
        server.send_signal(signal.SIGINT)
        assert server.wait(20) == 0
        assert "2 requests served" in server.stdout.read()


def test_noise_is_part_of_what_a_run_is(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run("evaluate", *COMMON, "--set", "decision.noise.wrong=0.5", "--out", out)[0] == 0
    with RunStore(out) as store:
        assert store.meta("config")["backend"]["decision_options"] == {"noise": {"wrong": 0.5}}
    code, told = run("evaluate", *COMMON, "--out", out)
    assert code != 0
    assert "noise" in told


def test_a_dry_run_asks_nothing_and_leaves_nothing(tmp_path: Path, prices: Path) -> None:
    options = ("--decision", "vlm", "--model", "m", "--base-url", "http://127.0.0.1:9/v1", "--prices", prices)
    code, printed = run("evaluate", *COMMON, *options, "--dry-run", "--out", tmp_path / "out")
    assert code == 0, printed
    assert "choose" in printed
    assert "+-" not in printed  # the one task is all of the run  # every task was run
    assert not (tmp_path / "out").exists()
