"""The protocol on the toy house."""

import math
from itertools import pairwise

import pytest
from toy_house import ToySimulator, episode_spec

from evonav.agents.baselines import StayStill
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.run.components import make_agent
from evonav.perception.ground_truth import GroundTruthPerception


def run_episode(task_id, agent, protocol=None, simulator=None):
    episode = Episode(
        episode_spec(task_id),
        "agent",
        make_agent(agent) if isinstance(agent, str) else agent,
        simulator or ToySimulator(),
        GroundTruthPerception(),
        protocol or ProtocolConfig(),
        seed=7,
    )
    return [outcome.record for outcome in episode.run()]


@pytest.mark.parametrize("task_id", ["toy-static", "toy-moved"])
def test_the_shortest_path_scores_one(task_id):
    records = run_episode(task_id, "shortest-path")
    assert [record.state for record in records] == [EndState.SUCCESS] * 3
    assert [record.spl for record in records] == [1.0] * 3
    assert all(record.has_stopped for record in records)


def test_perfect_recognition_finds_everything():
    records = run_episode("toy-moved", "nearest-frontier")
    assert [record.state for record in records] == [EndState.SUCCESS] * 3
    assert all(0.0 < record.spl <= 1.0 for record in records)


def test_stages_are_joined_by_the_agents_own_trajectory():
    records = run_episode("toy-static", "random-walk")
    assert records[0].requested_start == records[0].effective_start
    for before, after in pairwise(records):
        assert after.requested_start == before.terminal


def test_trace_adds_up_to_the_record():
    for record in run_episode("toy-static", "nearest-frontier"):
        assert record.num_rounds == len(record.trace) <= 50
        length_m = sum(math.dist(a, b) for entry in record.trace for a, b in pairwise(entry.path_m))
        assert record.path_length_m == pytest.approx(length_m)
        for entry, after in pairwise(record.trace):
            assert entry.path_m[0] == (entry.pose.x_m, entry.pose.z_m)
            assert entry.path_m[-1] == (after.pose.x_m, after.pose.z_m)
            assert sum(math.dist(a, b) for a, b in pairwise(entry.path_m)) <= 1.0 + 1e-6
            assert all(math.dist(a, b) <= 0.25 + 1e-9 for a, b in pairwise(entry.path_m))
        assert StageRecord.model_validate_json(record.model_dump_json()) == record


class Listening(StayStill):
    """Notes what it is told, and when, in a list that the simulator shares."""

    def __init__(self, events):
        super().__init__()
        self.events = events

    def begin_task(self, task):
        super().begin_task(task)
        self.task_id = task.task_id

    def begin_stage(self, goal):
        super().begin_stage(goal)
        self.events.append("goal")

    def act(self, observation):
        self.events.append("act")
        return super().act(observation)


class Planning(ToySimulator):
    """Notes when a path is computed."""

    def __init__(self, events):
        super().__init__()
        self.events = events

    def shortest_path(self, *args):
        self.events.append("path")
        return super().shortest_path(*args)


def test_the_reference_path_is_computed_before_the_agent_knows_the_goal():
    events = []
    run_episode("toy-moved", Listening(events), ProtocolConfig(max_rounds=1), Planning(events))
    assert events == ["path", "goal", "act", "path"] * 3
