"""A simulator's process that is lost costs time, not results."""

import pytest
from toy_run import CONFIG, records, texts

from evonav.component import Component
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.evaluation.run.run_settings import NUM_RETRIES
from evonav.report.run import load_run

AGENT = "random-walk"  # what it does depends on all that it did before


def flaky(folder, **options):
    folder.mkdir()
    backend = Backend(
        tasks=Component("toy_house:load_spec"),
        simulator=Component("flaky_simulator:make", options, {"folder": str(folder)}),
    )
    return RunConfig(backend=backend, protocol=CONFIG.protocol)


def retries(run_dir):
    with RunStore(run_dir) as store:
        assert all(one.kind is ErrorKind.SIMULATOR_LOST for one in store.failures())
        return store.retries()


@pytest.mark.parametrize(("num_workers", "num_losses", "stage"), [(0, 1, 1), (0, 2, 2), (1, 1, 2)])
def test_a_stage_is_tried_again_from_the_state_in_which_it_began(tasks, tmp_path, num_workers, num_losses, stage):
    evaluate([AGENT], tasks[:1], tmp_path / "whole", config=CONFIG, num_workers=0)
    config = flaky(tmp_path / "starts", stage=stage, num_losses=num_losses)
    (summary,) = evaluate([AGENT], tasks[:1], tmp_path / "run", config=config, num_workers=num_workers)
    assert not summary.is_incomplete
    assert texts(tmp_path / "run") == texts(tmp_path / "whole")
    assert retries(tmp_path / "run") == {(AGENT, tasks[0].task_id, stage): num_losses}
    assert retries(tmp_path / "whole") == {}
    failures = load_run(tmp_path / "run").failures
    assert [(failure.kind, failure.is_retried) for failure in failures] == [
        (ErrorKind.SIMULATOR_LOST, True)
    ] * num_losses
    assert len((tmp_path / "starts" / "starts").read_text()) == 1 + num_losses


def test_restarts_are_bounded(tasks, tmp_path):
    config = flaky(tmp_path / "starts", num_losses=100)
    (summary,) = evaluate([AGENT], tasks[:1], tmp_path / "run", config=config, num_workers=0)
    assert summary.is_incomplete
    first, second, third = records(tmp_path / "run", AGENT)
    assert first.is_scored
    assert (second.state, second.error.kind) == (EndState.ERRORED, ErrorKind.SIMULATOR_LOST)
    assert "the process is gone" in second.error.message
    assert third.state is EndState.NOT_RUN
    assert retries(tmp_path / "run") == {(AGENT, tasks[0].task_id, 2): NUM_RETRIES}
    assert len((tmp_path / "starts" / "starts").read_text()) == 1 + NUM_RETRIES


def test_stages_forgotten_are_forgotten_with_their_restarts(tasks, tmp_path):
    config = flaky(tmp_path / "starts")
    evaluate([AGENT], tasks[:1], tmp_path / "run", config=config, num_workers=0)
    with RunStore(tmp_path / "run") as store:
        store.forget_episode(AGENT, tasks[0].task_id, 3)
        assert len(store.failures()) == 1
        store.forget_episode(AGENT, tasks[0].task_id, 2)
        assert store.failures() == []


def test_means_of_the_machine_do_not_make_another_run(tasks, tmp_path):
    config = flaky(tmp_path / "starts", num_losses=0)
    evaluate([AGENT], tasks[:1], tmp_path / "run", config=config, num_workers=0)
    elsewhere = flaky(tmp_path / "elsewhere", num_losses=0)
    evaluate([AGENT], tasks[:1], tmp_path / "run", config=elsewhere, num_workers=0)
    assert not (tmp_path / "elsewhere" / "starts").exists()


@pytest.mark.slow
@pytest.mark.parametrize("num_workers", [0, 1])
def test_episodes_of_a_worker_share_a_simulator(tasks, tmp_path, num_workers):
    agents = ["nearest-frontier", "toy_agents:Raising", AGENT]
    evaluate(agents, tasks, tmp_path / "whole", config=CONFIG, num_workers=0)
    config = flaky(tmp_path / "starts", num_losses=0)
    evaluate(agents, tasks, tmp_path / "run", config=config, num_workers=num_workers)
    assert len((tmp_path / "starts" / "starts").read_text()) == 1
    assert texts(tmp_path / "run") == texts(tmp_path / "whole")
