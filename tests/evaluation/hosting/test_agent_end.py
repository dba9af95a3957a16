"""Nothing that an agent has started stays when its process is closed or its run ends, however it ends."""

import os
import signal
import time

import pytest
from processes import have_ended, is_running
from toy_run import many_tasks, started_driver

from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.hosting.process import AgentProcess
from evonav.parallel.local import EndedError


@pytest.mark.slow
@pytest.mark.parametrize("kill", [signal.SIGINT, signal.SIGKILL])
def test_nothing_of_an_agent_outlives_the_run(tmp_path, kill):
    many_tasks(tmp_path / "tasks", 1)
    pids = tmp_path / "pids"
    agents = ["unruly_agents:Announcing"]
    child = started_driver(tmp_path, agents=agents, isolation="process", variables={"TOY_PIDS": str(pids)})
    while not pids.exists():
        assert child.poll() is None
        time.sleep(0.05)
    alive = [int(pid) for pid in pids.read_text().split()]
    child.send_signal(kill)
    child.wait(timeout=30)
    assert have_ended(alive)


FORKING = """
import os
import time
from pathlib import Path
from evonav.agents.baselines import RandomWalk

if (child := os.fork()) == 0:
    time.sleep(600)
Path(__file__).with_suffix(".pid").write_text(str(child))
"""


def test_a_signal_while_a_process_is_closed_leaves_no_child(tmp_path, monkeypatch):
    """A driver closes a worker's connection, and ends it at once by a signal."""
    (tmp_path / "forking.py").write_text(FORKING)
    process = AgentProcess(f"{tmp_path}/forking.py:RandomWalk", AgentHosting())
    child = int((tmp_path / "forking.pid").read_text())
    killpg = os.killpg
    is_first = iter([True])

    def interrupted(group, number):
        if next(is_first, False):
            raise EndedError(143)
        killpg(group, number)

    monkeypatch.setattr(os, "killpg", interrupted)
    with pytest.raises(EndedError):
        process.close()
    assert is_running(child)
    process.close()
    process.close()
    assert have_ended([child])
