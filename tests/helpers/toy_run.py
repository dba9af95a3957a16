"""Runs of agents on toy tasks: their configurations, their tasks by the dozen, and what they recorded."""

import json
import os
import subprocess
import sys
from dataclasses import replace

import pytest
from toy_house import EPISODES, ToySimulator, episode_spec

from evonav.agents.hosting.sandbox import sandbox_problem
from evonav.component import Component
from evonav.evaluation.hosting.isolation import AgentHosting, usual_isolation
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.run import RunConfig
from evonav.tasks.listing import task_files

TOY = Backend(tasks=Component("toy_house:load_spec"), simulator=Component("toy_house:make_simulator"))
CONFIG = RunConfig(backend=TOY, protocol=ProtocolConfig(max_rounds=12))
SHORT = RunConfig(backend=TOY, protocol=ProtocolConfig(max_rounds=3))
CHEAP = RunConfig(
    backend=Backend(tasks=Component("toy_run:load_numbered"), simulator=Component("toy_run:make_simulator")),
    protocol=ProtocolConfig(max_rounds=3),
    hosting=AgentHosting(usual_isolation()),
)
"""A configuration for dozens of tasks, whose images have few pixels."""
HERE_ALONE = {"config": replace(CHEAP, hosting=AgentHosting()), "num_workers": 0}
"""How these are evaluated in this process."""
NEEDS_SANDBOX = pytest.mark.skipif(sandbox_problem() is not None, reason=f"no sandbox here: {sandbox_problem()}")


def load_numbered(path):
    return replace(episode_spec(path.name.rpartition("-")[0]), task_id=path.name)


def make_simulator():
    return ToySimulator(8, 8)


def many_tasks(folder, num):
    """Write tasks that differ in name alone."""
    for number in range(num):
        name = f"{list(EPISODES)[number % 2]}-{number:03}"
        (folder / name).mkdir(parents=True)
        (folder / name / "task.json").write_text(json.dumps({"task_id": name, "num_stages": 3}))
    return task_files(folder)


def texts(run_dir):
    """Return all that a run recorded."""
    with RunStore(run_dir) as store:
        return [*store.record_texts(), *(plan.model_dump_json() for plan in store.floor_plans())]


def records(run_dir, agent):
    with RunStore(run_dir) as store:
        return list(store.records(agent))


DRIVER = """
import sys, json
from dataclasses import replace
from pathlib import Path
from toy_run import CHEAP
from evonav.evaluation.run.evaluate import evaluate
from evonav.tasks.listing import task_files

options = json.loads(sys.argv[3])
config = replace(CHEAP, hosting=replace(CHEAP.hosting, isolation=options.pop("isolation", CHEAP.hosting.isolation)))
evaluate(options.pop("agents"), task_files(Path(sys.argv[1])), Path(sys.argv[2]), config=config, **options)
"""


def driver_command(folder, **options):
    """Return a command that evaluates agents on `many_tasks` of `folder/tasks` into `folder/run`.

    It is a script without `if __name__ == "__main__"`, which workers must not run again.
    """
    script = folder / "driver.py"
    script.write_text(DRIVER)
    return [sys.executable, str(script), str(folder / "tasks"), str(folder / "run"), json.dumps(options)]


def driver_environment(**variables):
    return {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **variables}


def started_driver(folder, *, variables=None, **options):
    command = driver_command(folder, **options)
    return subprocess.Popen(command, stderr=subprocess.DEVNULL, env=driver_environment(**(variables or {})))
