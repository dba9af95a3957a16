"""Metric integrity: what a run says of itself, against a second implementation and against what is known beforehand."""

import json
import shutil
import sqlite3
from collections import Counter

import pytest
from second_scores import table

from evonav.errors import StoreError
from evonav.evaluation.metrics.stage_rows import read_stage_metrics
from evonav.evaluation.records.store import FILE_NAME, RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.report.run import load_run
from evonav.tasks.listing import BUNDLED_TASKS, task_files

AGENTS = ("fu", "random-walk", "nearest-frontier", "stay-still")


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory):
    """A real run: four agents on three houses."""
    out = tmp_path_factory.mktemp("reference") / "run"
    evaluate(AGENTS, task_files(BUNDLED_TASKS, 3), out, num_workers=0)
    return out


def test_a_second_implementation_has_the_same_scores(run_dir):
    summary = json.loads((run_dir / "summary.json").read_text())["agents"]
    second = table(run_dir / FILE_NAME)
    assert set(second) == set(AGENTS)
    for agent, told in summary.items():
        mine = second[agent]
        assert {state: n for state, n in told["counts"].items() if n} == mine["states"]
        n, sr, spl, soft_spl = mine["means"]["all"]
        assert (told["n"], told["sr"], told["spl"]) == (n, pytest.approx(sr, abs=1e-12), pytest.approx(spl, abs=1e-12))
        assert told["soft_spl"] == pytest.approx(soft_spl, abs=1e-12)
        for name in ("stage_1", "relocated", "not_relocated"):
            if name not in mine["means"]:
                assert name not in told["splits"]
                continue
            n, sr, spl, _ = mine["means"][name]
            split = told["splits"][name]
            assert (split["n"], split["sr"]) == (n, pytest.approx(sr, abs=1e-12))
            assert split["spl"] == pytest.approx(spl, abs=1e-12)


def test_a_second_implementation_has_the_same_causes_and_rows(run_dir):
    second = table(run_dir / FILE_NAME)
    with RunStore(run_dir) as store:
        rows = read_stage_metrics(store)
    for agent in AGENTS:
        own = [row for row in rows if row.agent == agent]
        assert Counter(row.cause for row in own) == second[agent]["causes"]
        n, sr, spl, soft_spl = second[agent]["means"]["all"]
        assert len(own) == n
        assert sum(row.success for row in own) / n == pytest.approx(sr, abs=1e-12)
        assert sum(row.spl for row in own) / n == pytest.approx(spl, abs=1e-12)
        assert sum(row.soft_spl for row in own) / n == pytest.approx(soft_spl, abs=1e-12)
        assert Counter(row.stratum for row in own) == {k: v[0] for k, v in second[agent]["means"].items() if k != "all"}
    # The causes of a run are more than one, or this holds nothing to anything.
    assert len({row.cause for row in rows}) > 3


def test_the_walk_to_the_target_is_perfect_on_all_bundled_tasks(tmp_path):
    tasks = task_files(BUNDLED_TASKS)
    (summary,) = evaluate(["shortest-path"], tasks, tmp_path, num_workers=0)
    assert (summary.n, summary.sr) == (sum(task.num_stages for task in tasks), 1.0)
    with RunStore(tmp_path) as store:
        rows = read_stage_metrics(store)
    assert all(row.is_baseline for row in rows)
    # It walks the reference path and no more; what is missing is the rounding of sums.
    assert min(row.spl for row in rows) == pytest.approx(1.0, abs=1e-9)


def tampered(run_dir, tmp_path, *statements):
    out = tmp_path / "run"
    shutil.copytree(run_dir, out)
    with sqlite3.connect(out / FILE_NAME) as db:
        for statement, values in statements:
            db.execute(statement, values)
    return out


def test_a_report_refuses_stages_that_the_run_has_not(run_dir, tmp_path):
    with sqlite3.connect(run_dir / FILE_NAME) as db:
        text = db.execute("SELECT record FROM stages WHERE agent = 'fu' AND stage = 1").fetchone()[0]
    record = {**json.loads(text), "stage": 9}
    row = ("fu", record["task_id"], 9, record["state"], json.dumps(record))
    out = tampered(run_dir, tmp_path, ("INSERT INTO stages VALUES (?, ?, ?, ?, ?)", row))
    with pytest.raises(StoreError, match=r"stage 9 of .* by fu is no stage of this run"):
        load_run(out)


def test_a_report_refuses_a_stage_that_stands_in_anothers_place(run_dir, tmp_path):
    """The same record twice, under two keys: counted twice, and another one dropped."""
    query = "SELECT task_id, record FROM stages WHERE agent = 'fu' AND stage = 1"
    with sqlite3.connect(run_dir / FILE_NAME) as db:
        task_id, text = db.execute(query).fetchone()
    change = "UPDATE stages SET record = ? WHERE agent = 'fu' AND task_id = ? AND stage = 2"
    out = tampered(run_dir, tmp_path, (change, (text, task_id)))
    with pytest.raises(StoreError, match="holds the record of fu"):
        load_run(out)


def test_missing_stages_are_counted_as_not_run(run_dir, tmp_path):
    out = tampered(run_dir, tmp_path, ("DELETE FROM stages WHERE agent = 'fu' AND stage = 2", ()))
    fu = next(summary for summary in load_run(out).summaries if summary.agent == "fu")
    assert fu.counts["not_run"] == 3
    assert fu.is_incomplete
    assert sum(fu.counts.values()) == fu.num_stages
