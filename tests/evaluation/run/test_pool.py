"""Episodes of several runs on one pool, local or Ray; what fails is tried again and kept."""

import os
import signal
import sys
import threading
import time

import pytest
from processes import children
from toy_run import CONFIG, texts

from evonav.component import Component
from evonav.errors import InvalidArgumentError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate, evaluate_all
from evonav.evaluation.run.run import Evaluation, RunConfig
from evonav.parallel.worker import Workforce

AGENT = "nearest-frontier"


def test_runs_share_workers_and_are_as_if_alone(tasks, tmp_path):
    folder = tmp_path / "starts"
    folder.mkdir()
    backend = Backend(
        tasks=Component("toy_house:load_spec"),
        simulator=Component("flaky_simulator:make", {"num_losses": 0}, {"folder": str(folder)}),
    )
    configs = [RunConfig(backend=backend, protocol=ProtocolConfig(max_rounds=3), seed=seed) for seed in (0, 1)]
    cells = [tmp_path / f"cell-{index}" for index in range(2)]
    together = [Evaluation(("random-walk",), tuple(tasks), *one) for one in zip(cells, configs, strict=True)]
    news = []
    summaries = evaluate_all(together, Workforce(1), on_progress=lambda *one: news.append(one))
    assert len((folder / "starts").read_text()) == 2  # one a run, though episodes of both are under way at once
    assert [index for index, one in news if one.latest is None] == [0, 1]
    assert [one.num_done for index, one in news if index == 1] == [0, 1, 2, 3, 4, 5, 6]
    for index, config in enumerate(configs):
        alone = tmp_path / f"alone-{index}"
        assert evaluate(["random-walk"], tasks, alone, config=config, num_workers=0) == summaries[index]
        assert texts(alone) == texts(cells[index])
    assert texts(cells[0]) != texts(cells[1])
    with pytest.raises(InvalidArgumentError, match="the same folder"):
        evaluate_all([together[0], together[0]], Workforce(0))


def test_an_agent_whose_process_dies_is_tried_again(tasks, tmp_path, monkeypatch):
    flag = tmp_path / "died"
    monkeypatch.setenv("TOY_DIED", str(flag))
    agent = "toy_agents:DyingAtFirst"
    evaluate([agent], tasks[:1], tmp_path / "run", config=CONFIG, num_workers=1)
    assert flag.exists()
    evaluate([agent], tasks[:1], tmp_path / "whole", config=CONFIG, num_workers=0)
    assert texts(tmp_path / "run") == texts(tmp_path / "whole")
    with RunStore(tmp_path / "run") as store:
        (failure,) = store.failures()
        assert (failure.stage, failure.kind, failure.is_retried) == (2, ErrorKind.CRASH, True)
        assert store.retries() == {(agent, tasks[0].task_id, 2): 1}


def test_a_task_that_cannot_be_read_is_the_harness_failure_of_every_stage(tasks, tmp_path):
    backend = Backend(tasks=Component("toy_house:no_such_function"), simulator=CONFIG.backend.simulator)
    config = RunConfig(backend=backend, protocol=CONFIG.protocol)
    (summary,) = evaluate([AGENT], tasks[:1], tmp_path / "run", config=config, num_workers=0, num_retries=1)
    assert (summary.counts["errored"], summary.counts["not_run"]) == (1, 2)
    with RunStore(tmp_path / "run") as store:
        failures = store.failures()
    assert [(one.stage, one.kind, one.is_retried) for one in failures] == [
        (1, ErrorKind.HARNESS, True),
        (1, ErrorKind.HARNESS, False),
    ]
    assert "no_such_function" in failures[0].traceback


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # Ray's own
def test_ray_records_the_same_though_an_actor_is_killed(tasks, tmp_path, monkeypatch):
    ray = pytest.importorskip("ray")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    monkeypatch.setenv("RAY_TMPDIR", "/tmp")  # paths of sockets have a greatest length
    monkeypatch.setenv("TOY_PACE_S", "0.2")  # or all would be over before the kill
    killed = []

    def kill():
        while not killed:
            time.sleep(0.05)
            actors = [pid for pid, line in children(os.getpid()).items() if "ray::_Actor" in line]
            if actors and (tmp_path / "run" / "first").exists():
                killed.append(actors[0])
                os.kill(actors[0], signal.SIGKILL)

    def note(news):
        if news.num_done:
            (tmp_path / "run" / "first").touch()

    agent = "toy_agents:Slow"
    ray.init(num_cpus=2, num_gpus=1, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
    try:
        thread = threading.Thread(target=kill, daemon=True)
        thread.start()
        evaluate_all(
            [Evaluation((agent,), tuple(tasks), tmp_path / "run", CONFIG)],
            Workforce(2, "ray", num_gpus=0.5),
            on_progress=lambda _, news: note(news),
        )
        thread.join(timeout=10.0)
    finally:
        ray.shutdown()
    assert killed
    evaluate([agent], tasks, tmp_path / "local", config=CONFIG, num_workers=0)
    assert texts(tmp_path / "run") == texts(tmp_path / "local")
    with RunStore(tmp_path / "run") as store:
        assert [(one.kind, one.is_retried) for one in store.failures()] == [(ErrorKind.CRASH, True)]
