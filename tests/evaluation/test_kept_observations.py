"""Agents that keep and change what they were shown, in processes of their own and several at once."""

import os
from contextlib import closing

import numpy as np
import pytest
from short_tasks import short_tasks
from test_agent_process import acted, view
from test_run import texts
from test_sandbox import NEEDS_SANDBOX

from evonav.agents.hosting.shared_slots import NUM_SLOTS
from evonav.component import Component
from evonav.evaluation.hosting.agent import RemoteAgent
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.hosting.processes import AgentProcesses
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.sensors.observation import MapFrame, Observation
from evonav.tasks.listing import BUNDLED_TASKS
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.pose import Pose

AGENT = "unruly_agents:Keeping"
HOSTINGS = [
    pytest.param(AgentHosting(timeout_s=30.0), id="process"),
    pytest.param(AgentHosting("sandbox", timeout_s=30.0), id="sandbox", marks=NEEDS_SANDBOX),
]


@pytest.mark.slow
@pytest.mark.parametrize("hosting", HOSTINGS)
def test_an_agent_may_keep_and_change_all_that_it_is_shown(tmp_path, hosting):
    """It fails if what it keeps changes, and would act otherwise if it were shown what it has written."""
    tasks, reader = short_tasks(BUNDLED_TASKS, 2, 3)
    config = RunConfig(backend=Backend(tasks=reader), protocol=ProtocolConfig(max_rounds=8))
    evaluate([AGENT], tasks, tmp_path / "here", config=config, num_workers=0)
    for at_once in (1, 3):
        own = RunConfig(backend=Backend(tasks=reader), protocol=ProtocolConfig(max_rounds=8), hosting=hosting)
        run = tmp_path / str(at_once)
        evaluate([AGENT], tasks, run, config=own, num_workers=1, episodes_at_once=at_once)
        assert texts(run) == texts(tmp_path / "here")
    assert not any('"state":"errored"' in text for text in texts(tmp_path / "here"))


@pytest.mark.parametrize("hosting", HOSTINGS)
def test_what_an_agent_keeps_is_in_its_own_memory(hosting):
    """The evaluator's grows by a few observations and no more; what it has sent stays as it was."""
    rng = np.random.default_rng(0)
    with closing(AgentProcesses(hosting)) as processes:
        agent = RemoteAgent(processes, AGENT, Component("evonav.decision.backends:text_match"), 0)
        agent.begin_task(TaskInfo("t", 1, 50, MapFrame(2, 3, 0.1, (0.0, 0.0)), 0))
        agent.begin_stage(Goal(1, "Chair", "a", "b", "c", np.zeros((300, 300, 3), np.uint8)))
        for _ in range(8):
            seen = Observation(tuple(view(rng, 300) for _ in range(3)), Pose(1.0, 0.9, 2.0, 0.5), True, 3)
            before = [one.detections.masks.copy() for one in seen.views]
            acted(agent, seen)
            assert all(np.array_equal(one.detections.masks, was) for one, was in zip(seen.views, before, strict=True))
        size = sum(array.nbytes + 64 for one in seen.views for array in (one.depth_m, one.rgb, one.detections.masks))
        block = agent._process._block
        assert os.fstat(block.descriptor).st_blocks * 512 <= NUM_SLOTS * (size + 4096)
        agent.close()
