"""Runs on disk: determinism, resumption, containment, refusal."""

import json
from itertools import pairwise

import pytest
from toy_run import CONFIG, TOY, records, texts

from evonav.errors import InvalidArgumentError, StoreError, TaskError
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.report.run import load_run
from evonav.tasks.listing import task_files


def test_the_floor_plan_of_a_stage_is_made_once_for_all_agents(tasks, tmp_path, monkeypatch):
    made = []
    make = EpisodeSpec.floor_plan
    monkeypatch.setattr(
        EpisodeSpec, "floor_plan", lambda spec, stage: made.append((spec.task_id, stage)) or make(spec, stage)
    )
    for _ in range(2):
        evaluate(["random-walk", "nearest-frontier", "stay-still"], tasks, tmp_path, config=CONFIG, num_workers=0)
    with RunStore(tmp_path) as store:
        assert sorted(made) == sorted(store.floor_plan_keys()) == [(t.task_id, k) for t in tasks for k in (1, 2, 3)]


def test_seeds_make_a_difference(tasks, tmp_path):
    evaluate(["random-walk"], tasks, tmp_path / "a", config=CONFIG, num_workers=0)
    other = RunConfig(backend=TOY, protocol=CONFIG.protocol, seed=1)
    evaluate(["random-walk"], tasks, tmp_path / "b", config=other, num_workers=0)
    assert texts(tmp_path / "a") != texts(tmp_path / "b")


def test_summary_counts_every_stage_once(tasks, tmp_path):
    (summary,) = evaluate(["toy_agents:Raising"], tasks, tmp_path / "run", config=CONFIG, num_workers=0)
    assert sum(summary.counts.values()) == summary.num_stages == 6
    assert summary.counts["errored"] == 2
    assert summary.counts["not_run"] == 0
    assert summary.is_incomplete
    content = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert content["is_incomplete"] is True
    assert content["agents"]["toy_agents:Raising"]["n"] == 4


@pytest.mark.parametrize(
    ("agent", "message"),
    [
        ("toy_agents:Raising", "RuntimeError: no idea [toy_agents:"),
        ("toy_agents:Speechless", "is no action"),
        ("toy_agents:Lost", "position_m.0 = nan: Input should be a finite number"),
        ("toy_agents:FarSighted", "occupancy_range_m"),
    ],
)
def test_an_agents_fault_costs_its_stage_alone(tasks, tmp_path, agent, message):
    evaluate([agent, "toy_agents:Idle"], tasks[:1], tmp_path / "run", config=CONFIG, num_workers=0)
    assert all(record.is_scored for record in records(tmp_path / "run", "toy_agents:Idle"))
    stages = records(tmp_path / "run", agent)
    failed = [record.stage for record in stages if record.state is EndState.ERRORED]
    assert failed == ([2] if agent in ("toy_agents:Raising", "toy_agents:Speechless") else [1, 2, 3])
    with RunStore(tmp_path / "run") as store:
        failure = store.failures()[0]
    assert (failure.stage, failure.kind, failure.is_retried) == (failed[0], ErrorKind.AGENT, False)
    if agent == "toy_agents:Raising":
        assert 'toy_agents.py", line' in failure.traceback
        assert 'raise RuntimeError("no idea")' in failure.traceback
        assert "toy_agents.py" not in failure.message
    for record in stages:
        assert record.failed_before == tuple(stage for stage in failed if stage < record.stage)
        if record.stage in failed:
            assert record.error.kind is ErrorKind.AGENT
            assert message in record.error.message
            assert record.spl is None
        else:
            assert record.is_scored
    if len(failed) == 1:
        assert stages[2].requested_start == stages[1].effective_start  # where the failure left it
        assert [record.memory_lost_at for record in stages] == [None] * 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("agent", "kind", "message"),
    [
        ("toy_agents:Dying", ErrorKind.CRASH, "exit code 3"),
        ("toy_agents:Hanging", ErrorKind.TIMEOUT, "within 8 s"),
    ],
)
def test_a_worker_that_is_lost_costs_its_episode_alone(tasks, tmp_path, agent, kind, message):
    config = RunConfig(
        backend=TOY,
        protocol=CONFIG.protocol,
        stage_timeout_s=8.0 if kind is ErrorKind.TIMEOUT else 600.0,
        hosting=AgentHosting("none"),
    )
    evaluate([agent, "toy_agents:Idle"], tasks[:1], tmp_path / "run", config=config, num_workers=1, num_retries=0)
    assert all(record.is_scored for record in records(tmp_path / "run", "toy_agents:Idle"))
    stages = records(tmp_path / "run", agent)
    assert [record.state for record in stages[1:]] == [EndState.ERRORED, EndState.NOT_RUN]
    assert stages[1].error.kind is kind
    assert message in stages[1].error.message
    assert stages[1].spl is None


def test_resumption_does_what_is_left(tasks, tmp_path):
    run = tmp_path / "run"
    evaluate(["random-walk"], tasks, tmp_path / "whole", config=CONFIG, num_workers=0)
    evaluate(["random-walk"], tasks, run, config=CONFIG, num_workers=0)
    with RunStore(run) as store:
        store.forget_episode("random-walk", "toy-moved", 2)
    seen = []
    evaluate(["random-walk"], tasks, run, config=CONFIG, num_workers=0, on_progress=seen.append)
    assert [(news.latest.task_id, news.latest.stage) for news in seen if news.latest] == [
        ("toy-moved", 2),
        ("toy-moved", 3),
    ]
    assert (seen[0].num_done, seen[-1].num_done, seen[-1].num_stages) == (4, 6, 6)
    assert texts(run) == texts(tmp_path / "whole")


def test_a_finished_run_runs_nothing(tasks, tmp_path):
    evaluate(["toy_agents:Idle"], tasks, tmp_path / "run", config=CONFIG, num_workers=0)
    before = texts(tmp_path / "run")
    seen = []
    evaluate(["toy_agents:Idle"], tasks, tmp_path / "run", config=CONFIG, num_workers=0, on_progress=seen.append)
    assert [news.latest for news in seen] == [None]
    assert texts(tmp_path / "run") == before


def test_agents_can_join_a_run(tasks, tmp_path):
    evaluate(["toy_agents:Idle"], tasks, tmp_path / "run", config=CONFIG, num_workers=0)
    (summary,) = evaluate(["random-walk"], tasks, tmp_path / "run", config=CONFIG, num_workers=0)
    assert summary.agent == "random-walk"
    content = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert sorted(content["agents"]) == ["random-walk", "toy_agents:Idle"]
    assert len(content["paired_differences"]) == 1


def test_a_resumed_episode_is_never_a_mix_of_two_rollouts(tasks, tmp_path):
    run = tmp_path / "run"
    agent = "toy_agents:Undecided"
    evaluate([agent], tasks, run, config=CONFIG, num_workers=0)
    with RunStore(run) as store:
        store.forget_episode(agent, "toy-moved", 2)
    evaluate([agent], tasks, run, config=CONFIG, num_workers=0)
    stages = [record for record in records(run, agent) if record.task_id == "toy-moved"]
    for before, after in pairwise(stages):
        assert after.requested_start == before.terminal


@pytest.mark.parametrize("change", [{"seed": 1}, {"protocol": ProtocolConfig(max_rounds=13)}])
def test_another_configuration_is_refused(tasks, tmp_path, change):
    evaluate(["toy_agents:Idle"], tasks, tmp_path / "run", config=CONFIG, num_workers=0)
    other = RunConfig(**{"backend": TOY, "protocol": CONFIG.protocol, **change})
    with pytest.raises(StoreError, match=next(iter(change))):
        evaluate(["toy_agents:Idle"], tasks, tmp_path / "run", config=other, num_workers=0)
    with pytest.raises(StoreError, match="tasks"):
        evaluate(["toy_agents:Idle"], tasks[:1], tmp_path / "run", config=CONFIG, num_workers=0)


def test_requests_that_make_no_sense_are_refused(tasks, tmp_path):
    for agents in ([], ["random-walk", "random-walk"], ["no-such-agent"], ["toy_agents:Nobody"], ["json:decoder"]):
        with pytest.raises(InvalidArgumentError):
            evaluate(agents, tasks, tmp_path / "run", config=CONFIG, num_workers=0)
    with pytest.raises(InvalidArgumentError):
        evaluate(["random-walk"], [], tmp_path / "run", config=CONFIG)
    assert not (tmp_path / "run").exists()
    with pytest.raises(TaskError):
        task_files(tmp_path)
    (tmp_path / "bad" / "task").mkdir(parents=True)
    (tmp_path / "bad" / "task" / "task.json").write_text('{"num_stages": "many"}')
    with pytest.raises(TaskError, match=r"task\.json"):
        task_files(tmp_path / "bad")


def test_a_file_that_is_no_run_is_refused(tmp_path):
    with pytest.raises(StoreError, match="no run"):
        RunStore(tmp_path)
    (tmp_path / "records.sqlite").write_bytes(b"not a database" * 100)
    with pytest.raises(StoreError):
        RunStore(tmp_path)


def test_a_run_is_read_as_of_one_moment_while_it_is_written(tasks, tmp_path, monkeypatch):
    run = tmp_path / "run"
    evaluate(["random-walk"], tasks, run, config=CONFIG, num_workers=0)
    read_states = RunStore.states

    def states(store):
        found = read_states(store)
        monkeypatch.undo()
        evaluate(["toy_agents:Idle"], tasks, run, config=CONFIG, num_workers=0)
        return found

    monkeypatch.setattr(RunStore, "states", states)
    assert load_run(run).agents == ("random-walk",)
    assert load_run(run).agents == ("random-walk", "toy_agents:Idle")
