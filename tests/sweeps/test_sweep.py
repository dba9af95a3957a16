"""Sweeps on disk: resumption, refusal, money, and what is written about them."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from io import StringIO
from pathlib import Path

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.decision.vlm.account import Ledger
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.errors import EvonavError, StoreError
from evonav.evaluation.metrics.navigation import rates
from evonav.evaluation.metrics.stage_metrics import metrics_of
from evonav.evaluation.records.store import RunStore
from evonav.sweeps.summary import sweep_rows
from vlm_stub import KEY, serving

EXAMPLES = Path(__file__).parents[2] / "examples" / "sweeps"
TWO_BY_TWO = """
agents = ["fu", "ftu"]
tasks = ["bundled:2"]
decisions = {right = "text", wrong = "text:wrong=0.3"}
seeds = [0, 1]
workers = 2
isolation = "none"
[protocol]
max_rounds = 2
"""
CELLS = [f"gt__{decision}__bundled-2__s{seed}" for decision in ("right", "wrong") for seed in (0, 1)]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A sweep that nobody disturbed."""
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "sweep.toml").write_text(TWO_BY_TWO)
    done = run("sweep", folder / "sweep.toml", "--out", folder / "out")
    assert done.exit_code == 0, done.output
    return folder / "out"


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(TWO_BY_TWO)
    return path


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def texts(out, cells=CELLS):
    found = {}
    for cell in cells:
        with RunStore(out / "runs" / cell) as store:
            found[cell] = [*store.record_texts(), *(plan.model_dump_json() for plan in store.floor_plans())]
    return found


def num_recorded(out):
    num = 0
    for path in out.glob("runs/*/records.sqlite"):
        try:
            with RunStore(path.parent) as store:
                num += len(store.states())
        except StoreError:  # being made
            continue
    return num


def small(file, out, *more):
    """One cell of two shortest paths."""
    changes = ("agents=shortest-path", "decisions=text", "seeds=0", "workers=0", "tasks=bundled:1")
    return run("sweep", file, *(word for change in changes for word in ("--set", change)), "--out", out, *more)


@pytest.mark.slow
def test_a_sweep_that_was_interrupted_goes_on_to_the_same_records(whole, file, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "evonav", "sweep", str(file), "--out", str(out), "--workers", "2"]
    child = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline_s = time.monotonic() + 120
    while num_recorded(out) < 9:
        assert child.poll() is None
        assert time.monotonic() < deadline_s
        time.sleep(0.05)
    os.killpg(child.pid, signal.SIGINT)  # as a terminal does: workers get it, too
    _, told = child.communicate(timeout=60)
    assert child.returncode == 130, told
    before = num_recorded(out)
    assert 9 <= before < 56
    assert f"to resume: evonav sweep {file} --out {out} --workers 2" in told
    assert "Traceback" not in told
    # The summary of what there is says what there is not.
    summary = json.loads((out / "summary.json").read_text())
    assert summary["is_incomplete"]
    assert sum(row["n"] for row in summary["rows"] if row["cell"]) == before
    assert "incomplete" in (out / "summary.md").read_text()

    done = run("sweep", file, "--out", out, "--workers", 2)
    assert done.exit_code == 0, done.output
    assert texts(out) == texts(whole)
    for name in ("summary.json", "summary.csv"):
        assert (out / name).read_bytes() == (whole / name).read_bytes()


@pytest.mark.slow
def test_ray_leaves_the_same_records(whole, file, tmp_path):
    pytest.importorskip("ray")
    file.write_text(f'engine = "ray"\n{TWO_BY_TWO}')
    done = run("sweep", file, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert texts(tmp_path / "out") == texts(whole)


def test_a_finished_sweep_runs_nothing(whole, file):
    before = {path: path.stat().st_mtime_ns for path in whole.glob("runs/*/*")}
    done = run("sweep", file, "--out", whole)
    assert done.exit_code == 0, done.output
    assert {path: path.stat().st_mtime_ns for path in whole.glob("runs/*/*")} == before


def test_the_summary_is_of_the_records(whole):
    rows = {(row.cell, row.agent): row for row in sweep_rows(whole) if row.cell}
    assert len(rows) == 4 * 2
    for cell in CELLS:
        summary = json.loads((whole / "runs" / cell / "summary.json").read_text())
        for agent in ("fu", "ftu"):
            row, alone = rows[cell, agent], summary["agents"][agent]
            assert (row.n, row.sr, row.spl) == (alone["n"], alone["sr"], alone["spl"])
            assert (row.sr_ci95 and list(row.sr_ci95)) == alone["sr_ci95"]
            with RunStore(whole / "runs" / cell) as store:
                states = Counter(state.value for (name, _, _), state in store.states().items() if name == agent)
            assert {state: num for state, num in row.counts.items() if num} == states
    pooled = [row for row in sweep_rows(whole) if not row.cell and row.decision == "right" and row.agent == "fu"]
    records = []
    for cell in CELLS[:2]:
        with RunStore(whole / "runs" / cell) as store:
            records += store.records("fu")
    expected = rates([metrics_of(record) for record in records])
    assert [(row.n, row.sr, row.sr_ci95, row.spl) for row in pooled] == [
        (14, expected.sr, expected.sr_ci95, expected.spl)
    ]
    lines = list(csv.DictReader((whole / "summary.csv").read_text().splitlines()))
    assert [line["cell"] for line in lines] == [cell for cell in CELLS for _ in range(2)] + [""] * 4
    assert {line["seed"] for line in lines} == {"0", "1", "all"}


def test_cells_are_ordinary_runs(whole):
    """What takes a run takes a cell, and of a sweep says which there are."""
    assert run("export", whole / "runs" / CELLS[0], "--out", whole / "stages.csv").exit_code == 0
    told = run("paper", whole)
    assert told.exit_code != 0
    assert f"{whole / 'runs' / CELLS[0]}" in str(told.exception)


def test_a_sweep_may_grow_but_what_has_begun_may_not_change(file, tmp_path):
    out = tmp_path / "out"
    assert small(file, out).exit_code == 0
    grown = small(file, out, "--set", "agents=shortest-path,random-walk", "--set", "seeds=[0,1]", "--dry-run")
    assert "12 stages" in grown.stdout or "16 stages" in grown.stdout, grown.output
    one = "gt__text__bundled-1__s0"
    before = texts(out, [one])[one]
    assert small(file, out, "--set", "agents=shortest-path,random-walk", "--only", "*s0").exit_code == 0
    assert [text for text in texts(out, [one])[one] if "random-walk" not in text] == before
    for change, words in (
        ("agents=random-walk", "without agent shortest-path"),
        ("seeds=1", f"cell {one} is not in the file"),
        ("protocol.max_rounds=9", "protocol.max_rounds: there 2, asked 9"),
    ):
        refused = small(file, out, "--set", "agents=shortest-path,random-walk", "--set", change)
        assert refused.exit_code == 1
        assert isinstance(refused.exception, StoreError)
        assert f"{out} holds another sweep" in str(refused.exception)
        assert words in str(refused.exception)


def test_what_has_not_begun_may_change(file, tmp_path):
    """A typing mistake that was found before anything ran costs no folder."""
    out = tmp_path / "out"
    failed = small(file, out, "--set", "agents=shortest-paht")
    assert isinstance(failed.exception, EvonavError)
    assert small(file, out).exit_code == 0


@pytest.mark.parametrize("version", ["2", "true", "null"])
def test_a_sweep_of_another_schema_is_refused(tmp_path, version):
    (tmp_path / "sweep.json").write_text(f'{{"schema_version": {version}, "cells": {{}}}}')
    with pytest.raises(StoreError, match="this evonav reads 1"):
        sweep_rows(tmp_path)


def test_a_part_of_a_sweep_can_be_run(file, tmp_path):
    out = tmp_path / "out"
    some = small(file, out, "--set", "seeds=[0,1]", "--only", "*__s1")
    assert some.exit_code == 0, some.output
    assert [path.name for path in (out / "runs").iterdir()] == ["gt__text__bundled-1__s1"]
    rows = {(row.cell, row.agent): row for row in sweep_rows(out)}
    assert rows["gt__text__bundled-1__s0", "shortest-path"].counts["not_run"] > 0
    assert not rows["gt__text__bundled-1__s1", "shortest-path"].is_incomplete


def test_an_errored_stage_makes_a_sweep_incomplete(file, tmp_path):
    out = tmp_path / "out"
    done = small(file, out, "--set", "agents=toy_agents:Raising")
    assert done.exit_code == 3
    assert "errored" in done.output
    assert "--retry-errored" in done.output


@pytest.mark.slow
def test_money_is_held_together_over_all_cells(file, tmp_path, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    prices = tmp_path / "prices.json"
    prices.write_text('{"m": {"input_usd": 1.0, "output_usd": 10.0}}')
    with serving(lambda request: {"text": mock_answer(request)}) as stub:
        decisions = {"kind": "vlm", "model": "m", "base_url": stub.url, "max_tokens": 100}
        changes = ("agents=fu", "decisions=" + json.dumps({"m": decisions}), "seeds=[0,1]", "tasks=bundled:1")
        options = [word for change in (*changes, "workers=0", f"prices={prices}") for word in ("--set", change)]
        out = tmp_path / "out"
        plan = run("sweep", file, *options, "--out", out, "--only", "*s0", "--dry-run")
        assert plan.exit_code == 0, plan.output
        assert "about $" in plan.stdout
        assert not stub.requests
        assert not out.exists()
        capped = run("sweep", file, *options, "--set", "max_cost=0.02", "--out", out)
        assert capped.exit_code == 3, capped.output
        spent = Ledger(out / "spending.sqlite").spending()
        assert 0.0 < sum(row.cost_usd for row in spent) <= 0.02
        done = run("sweep", file, *options, "--set", "max_cost=5", "--out", out, "--retry-errored")
        assert done.exit_code == 0, done.output
    costs = {row.model: row.cost_usd for row in Ledger(out / "spending.sqlite").spending()}
    assert set(costs) == {"gt__m__bundled-1__s0", "gt__m__bundled-1__s1"}
    assert all(f"${cost:.4f}" in done.stdout for cost in costs.values())
    assert stub.url not in (out / "sweep.json").read_text()
    # The answers are kept with their runs, and replay them without a server.
    replayed = run("sweep", file, *options, "--set", "decisions.m.mode=replay", "--out", out)
    assert replayed.exit_code == 0


def test_examples(tmp_path, monkeypatch):
    plan = run("sweep", EXAMPLES / "noise.toml", "--dry-run")
    assert plan.exit_code == 0, plan.output
    monkeypatch.chdir(EXAMPLES.parents[1])
    two = ("--set", "tasks.test-90=bundled:2", "--only", "*rules*")
    plan = run("sweep", "examples/sweeps/paper-gt.toml", *two, "--dry-run")
    assert plan.exit_code == 0, plan.output
    assert "gt__rules__test-90__s0" in plan.stdout
    assert "42 stages" in plan.stdout
    out = tmp_path / "out"
    quick = ("--set", "agents=fu", "--set", "tasks=bundled:1", "--set", "seeds=0", "--set", "protocol.max_rounds=3")
    done = run("sweep", EXAMPLES / "noise.toml", *quick, "--workers", 0, "--out", out)
    assert done.exit_code == 0, done.output


def test_the_schema_is_printed():
    assert json.loads(run("sweep", "--schema").stdout)["title"] == "evonav sweep"


def test_a_live_table_shows_every_cell(whole, monkeypatch):
    from rich.console import Console

    from evonav.cli.run.sweep_display import MAX_ROWS, SweepProgress, _CellState, duration

    progress = SweepProgress(whole, {cell: _CellState(14, num_done=14) for cell in CELLS})
    progress.cells["next"] = _CellState(14, num_done=5, num_failed=2, num_new=5, began_s=0.0, ended_s=8.0)
    console = Console(width=100, record=True, file=StringIO())
    console.print(progress.table())
    shown = console.export_text()
    assert all(cell in shown for cell in CELLS)
    assert "5/14" in shown
    assert "0.50" in shown  # four stages after the first, in 8 s
    assert "61 of 70 stages in 4 of 5 cells, 2 failed" in shown
    progress.cells |= {f"later-{i}": _CellState(1) for i in range(40)}
    names, num_before, num_after = progress._shown()
    assert len(names) == MAX_ROWS
    assert "next" in names
    assert num_before + num_after + MAX_ROWS == len(progress.cells)
    assert [duration(seconds) for seconds in (5.0, 600.0, 7200.0, float("inf"))] == ["5 s", "10 min", "2.0 h", "?"]
