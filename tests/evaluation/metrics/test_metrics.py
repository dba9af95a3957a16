"""Measures against a second implementation, and the units of intervals."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_house import episode_spec

from evonav.errors import StoreError
from evonav.evaluation.episode.outcome import as_errored
from evonav.evaluation.metrics.navigation import (
    agent_pairs,
    rates,
    summarise,
    summary_json,
)
from evonav.evaluation.metrics.scoring import score_stage, stage_soft_spl, stage_spl
from evonav.evaluation.metrics.stage_metrics import metrics_of
from evonav.evaluation.records.encoded import encode_stage
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore

LENGTHS = st.floats(0.0, 100.0)


@given(st.booleans(), LENGTHS, LENGTHS)
def test_spl_is_the_papers_formula(is_success, path_m, reference_m):
    got = stage_spl(is_success, path_m, reference_m)
    assert 0.0 <= got <= 1.0
    if not is_success:
        assert got == 0.0
    elif max(path_m, reference_m) > 0.0:
        assert got == pytest.approx(reference_m / max(path_m, reference_m))
    else:
        assert got == 1.0


@given(LENGTHS, LENGTHS, LENGTHS, LENGTHS)
def test_soft_spl_is_a_share(start_m, end_m, path_m, reference_m):
    assert 0.0 <= stage_soft_spl(start_m, end_m, path_m, reference_m) <= 1.0


def test_a_stage_is_a_success_closer_than_the_radius() -> None:
    """Start 10 m away, end 1.5 m away after 12 m, with a reference path of 9 m."""
    score = score_stage((0.0, 0.0), (8.5, 0.0), (10.0, 0.0), path_length_m=12.0, reference_length_m=9.0)
    assert (score.is_success, score.start_distance_m, score.terminal_distance_m) == (True, 10.0, 1.5)
    assert (score.spl, score.soft_spl) == (9.0 / 12.0, pytest.approx(0.85 * 9.0 / 12.0))
    at_radius = score_stage((0.0, 0.0), (8.0, 0.0), (10.0, 0.0), path_length_m=8.0, reference_length_m=9.0)
    assert (at_radius.is_success, at_radius.spl) == (False, 0.0)


def test_a_stage_without_a_reference_path_has_no_spl() -> None:
    score = score_stage((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), path_length_m=1.0, reference_length_m=None)
    assert (score.is_success, score.spl, score.soft_spl) == (True, None, None)


def made(agent, successes):
    """Rows of `successes`: (task, stage, success, spl, is_relocated)."""
    return [metrics_of(record) for record in made_records(agent, successes)]


def made_records(agent, successes):
    blank = episode_spec("toy-moved").blank_record(agent, 1)
    return [
        blank.model_copy(
            update={
                "task_id": task,
                "stage": stage,
                "state": EndState.SUCCESS if success else EndState.FAILURE,
                "spl": spl if success else 0.0,
                "target": blank.target.model_copy(update={"is_relocated": moved}),
            }
        )
        for task, stage, success, spl, moved in successes
    ]


OUTCOMES = st.lists(
    st.tuples(st.sampled_from("abcd"), st.integers(1, 5), st.booleans(), st.floats(0.0, 1.0), st.booleans()),
    min_size=1,
    max_size=20,
    unique_by=lambda outcome: outcome[:2],
)


@settings(max_examples=25)
@given(OUTCOMES)
def test_a_summary_agrees_with_arithmetic(outcomes):
    summary = summarise("x", made("x", outcomes), num_stages=len(outcomes))
    assert summary.n == len(outcomes)
    assert not summary.is_incomplete
    assert summary.sr == pytest.approx(sum(o[2] for o in outcomes) / len(outcomes), abs=1e-12)
    assert summary.spl == pytest.approx(math.fsum(o[3] for o in outcomes if o[2]) / len(outcomes), abs=1e-12)
    later = [o for o in outcomes if o[1] > 1]
    for name, part in (
        ("stage_1", [o for o in outcomes if o[1] == 1]),
        ("relocated", [o for o in later if o[4]]),
        ("not_relocated", [o for o in later if not o[4]]),
    ):
        found = summary.splits.get(name)
        assert (found.n if found else 0) == len(part)
        if part:
            assert found.sr == pytest.approx(sum(o[2] for o in part) / len(part))


def test_errored_stages_are_no_failures():
    records = made_records("x", [("a", 1, True, 1.0, False), ("a", 2, True, 0.5, False)])
    records.append(as_errored(records[0].model_copy(update={"stage": 3}), ErrorKind.CRASH, "died"))
    rows = [metrics_of(record) for record in records]
    summary = summarise("x", rows, num_stages=5)
    assert (summary.sr, summary.n) == (1.0, 2)
    assert summary.counts == {"success": 2, "failure": 0, "errored": 1, "not_run": 2}
    assert summary.is_incomplete
    assert rates(rows[2:]).sr is None


def test_pairs_are_compared_on_common_stages():
    a = made("a", [("t", 1, True, 1.0, False), ("t", 2, False, 0.0, False), ("u", 1, True, 0.5, False)])
    b = made("b", [("t", 1, False, 0.0, False), ("t", 2, True, 0.8, False), ("v", 1, True, 0.5, False)])
    (pair,) = agent_pairs({"a": a, "b": b})
    assert (pair.n, pair.num_only_a, pair.num_only_b) == (2, 1, 1)
    assert pair.sr.difference == 0.0
    assert pair.spl.difference == pytest.approx(-0.1)


def failed(row):
    return replace(row, state="failure", success=False, spl=0.0)


def test_a_house_with_several_tasks_is_one_unit():
    """Tasks of one house are one piece of evidence: more of them leave an interval as wide as it was."""
    outcomes = [(f"t{i}", 1, i % 3 > 0, 0.5, False) for i in range(12)]
    once = [replace(row, house=row.task_id) for row in made("a", outcomes)]
    twice = once + [replace(row, task_id=f"{row.task_id}-again") for row in once]
    assert rates(twice).sr_ci95 == rates(once).sr_ci95 is not None
    none = [failed(row) for row in twice]
    (pair,) = agent_pairs({"none": none, "a": twice})
    assert (pair.n, pair.num_tasks, pair.sr.num_clusters) == (24, 24, 12)
    assert rates([replace(row, house="") for row in once]).sr_ci95 == rates(once).sr_ci95


def test_few_houses_give_no_verdict_however_many_tasks():
    outcomes = [(f"t{i}", 1, True, 1.0, False) for i in range(20)]
    a = [replace(row, house=f"house {i % 4}") for i, row in enumerate(made("a", outcomes))]
    b = [failed(row) if i % 3 else row for i, row in enumerate(a)]
    (pair,) = agent_pairs({"a": a, "b": b})
    assert pair.sr.ci95 is not None
    assert pair.sr.ci95[1] < 0
    assert pair.sr.verdict == "few"


def test_the_summary_has_verdicts_that_allow_for_the_number_of_pairs():
    outcomes = [(f"t{i:02}", 1, i < 6, 1.0, False) for i in range(24)]
    some = [replace(row, house=row.task_id) for row in made("some", outcomes)]
    none = [failed(row) for row in some]
    alone = summary_json([], agent_pairs({"none": none, "some": some}))["paired_differences"]
    assert [(pair["sr_p"], pair["sr_holm_p"], pair["sr_verdict"]) for pair in alone] == [(0.03125, 0.03125, "b")]
    three = summary_json([], agent_pairs({"none": none, "some": some, "others": some}))["paired_differences"]
    told = [(pair["sr_p"], pair["sr_holm_p"], pair["sr_verdict"]) for pair in three]
    assert told == [(0.03125, 0.09375, "tie"), (0.03125, 0.09375, "tie"), (1.0, 1.0, "equal")]


def test_a_stage_is_recorded_once(tmp_path):
    (record,) = made_records("a", [("t", 1, True, 1.0, False)])
    with RunStore(tmp_path, create=True) as store:
        store.add_stage(encode_stage(record, wall_s=1.0, cpu_s=0.5))
        with pytest.raises(StoreError):
            store.add_stage(encode_stage(record, wall_s=1.0, cpu_s=0.5))
        assert list(store.records()) == [record]
        assert [brief.trace for brief in store.records(is_brief=True)] == [()]
        assert store.timings() == {("a", "t", 1): (1.0, 0.5)}
    with RunStore(tmp_path) as store:
        store._db.execute("UPDATE stages SET record = '{}'")
        with pytest.raises(StoreError):
            list(store.records())
