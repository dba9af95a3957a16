"""A worker and its agent stay on one core while one of them waits, and keep their own cores otherwise."""

import json
import os
import subprocess
import sys
from contextlib import closing

import pytest

from evonav.evaluation.hosting.isolation import AgentHosting, ProcessSetup
from evonav.evaluation.hosting.process import AgentProcess
from evonav.parallel.local import num_cores
from evonav.parallel.one_core import IS_SUPPORTED, OneCore

pytestmark = pytest.mark.skipif(not IS_SUPPORTED or num_cores() < 2, reason="needs Linux and two cores")

AGENT = """
import json
import os
from pathlib import Path
from evonav.agents.baselines import RandomWalk

class Confined(RandomWalk):
    def begin_task(self, task):
        with Path(__file__).with_suffix(".json").open("a") as file:
            print(json.dumps([os.sched_getscheduler(0), sorted(os.sched_getaffinity(0))]), file=file)
        if task:
            os.sched_setaffinity(0, task)
"""


def test_a_thread_and_a_process_share_a_core_until_released():
    cores = os.sched_getaffinity(0)
    one_core = OneCore()
    assert not one_core.release()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as waiting:
        one_core.stay(waiting.pid)
        shared = os.sched_getaffinity(waiting.pid)
        assert len(shared) == 1
        assert shared == os.sched_getaffinity(0)
        assert os.sched_getscheduler(0) == os.SCHED_BATCH
        assert one_core.release()
        assert os.sched_getaffinity(0) == cores
        assert os.sched_getscheduler(0) == os.SCHED_OTHER
        assert not one_core.release()
        waiting.communicate(b"\n")
    one_core.stay(waiting.pid)  # it has ended
    assert one_core.release()
    assert os.sched_getaffinity(0) == cores


@pytest.mark.parametrize("is_one_of_many", [False, True])
def test_an_agent_that_works_may_use_all_cores_or_those_that_it_chooses(tmp_path, is_one_of_many):
    cores = sorted(os.sched_getaffinity(0))
    (tmp_path / "confined.py").write_text(AGENT)
    chosen = [cores[:1], cores[1:], None]
    setup = ProcessSetup(is_one_of_many=is_one_of_many)
    with closing(AgentProcess(f"{tmp_path}/confined.py:Confined", AgentHosting(), setup)) as agent:
        agent.ask("make", "evonav.decision.backends:text_match", 0, {})
        assert len(os.sched_getaffinity(agent._process.pid)) == (len(cores) if is_one_of_many else 1)
        for some in chosen:
            agent.ask("begin_task", some)
            assert sorted(os.sched_getaffinity(0)) == cores
    seen = [json.loads(line) for line in (tmp_path / "confined.json").read_text().splitlines()]
    assert seen == [[os.SCHED_OTHER, some] for some in (cores, cores[:1], cores[1:])]


def test_a_worker_is_free_again_when_an_agent_dies(tmp_path):
    cores = os.sched_getaffinity(0)
    agent = AgentProcess("random-walk", AgentHosting())
    agent.ask("make", "evonav.decision.backends:text_match", 0, {})
    agent.send("entries")
    assert len(os.sched_getaffinity(0)) == 1
    agent.close(is_at_once=True)
    assert os.sched_getaffinity(0) == cores
