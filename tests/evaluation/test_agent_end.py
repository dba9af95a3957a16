"""Nothing that an agent has started stays when its process is closed or its run ends, however it ends."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from toy_house import write_tasks

from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.hosting.process import AgentProcess
from evonav.parallel.local import EndedError
from evonav.tasks.listing import task_files

ENDED = """
import sys
from pathlib import Path
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.tasks.listing import task_files
from evonav.component import Component
from evonav.evaluation.run.components import Backend

if __name__ == "__main__":
    root = Path(sys.argv[1])
    backend = Backend(tasks=Component("toy_house:load_spec"), simulator=Component("toy_house:make_simulator"))
    config = RunConfig(backend=backend)
    evaluate(["unruly_agents:Announcing"], task_files(Path(sys.argv[2])), root / "run", config=config, num_workers=1)
"""


@pytest.mark.slow
@pytest.mark.parametrize("kill", [signal.SIGINT, signal.SIGKILL])
def test_nothing_of_an_agent_outlives_the_run(tmp_path, kill):
    write_tasks(tmp_path / "tasks")
    (task,) = task_files(tmp_path / "tasks", 1)
    script, pids = tmp_path / "script.py", tmp_path / "pids"
    script.write_text(ENDED)
    child = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path), str(task.path.parent)],
        stderr=subprocess.DEVNULL,
        env={"PYTHONPATH": os.pathsep.join(sys.path), "PATH": "", "TOY_PIDS": str(pids)},
    )
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


def have_ended(pids, timeout_s=20.0):
    """Wait for processes that are not our own."""
    until_s = time.monotonic() + timeout_s
    while pids and time.monotonic() < until_s:
        pids = [pid for pid in pids if is_running(pid)]
        time.sleep(0.05)
    return not pids


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
