"""What a perception may change of what an agent is given, and what not."""

from dataclasses import replace

import numpy as np
import pytest
from toy_house import ToySimulator, stage_case

from evonav.agents.agent import SensorConfig
from evonav.agents.frontier_update.agent import FrontierUpdate
from evonav.agents.unigoal.bev import BevMap
from evonav.component import Component
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.sensors import Sensors
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.house import bundled_houses
from evonav.memory import ObjectMap
from evonav.memory.clouds import clouds_of
from evonav.perception import StageScene
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.sensors.observation import Observation
from evonav.tasks.listing import BUNDLED_TASKS, task_files
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

START = Pose(1.0, 0.9, 3.0, 0.0)
CASE = EpisodeSpec("toy", "toy", START, (stage_case(1, "Bed|1"), stage_case(2, "Mug|1")))


class Erring(GroundTruthPerception):
    """Believes itself half a metre further east and turned by 0.1 rad, and all things a metre farther."""

    needs_rgb = True

    def __init__(self):
        super().__init__()
        self.scenes: list[StageScene] = []
        self.batches = []

    def begin_stage(self, scene):
        super().begin_stage(scene)
        self.scenes.append(scene)

    def perceive(self, frames):
        self.batches.append(frames)
        return [replace(one, depth_m=one.depth_m + 1, pose=moved(one.pose)) for one in super().perceive(frames)]

    def text_feature(self, text):
        return np.array([0.6, 0.8], np.float32)


def moved(pose):
    return replace(pose, x_m=pose.x_m + 0.5, yaw_rad=pose.yaw_rad + 0.1)


class Watching(FrontierUpdate):
    """Keeps what it is given."""

    def begin_task(self, task):
        super().begin_task(task)
        self.seen: list[Observation] = []

    def act(self, observation):
        self.seen.append(observation)
        return super().act(observation)


@pytest.fixture(scope="module")
def episode():
    agent, perception = Watching(), Erring()
    run = Episode(CASE, "watching", agent, ToySimulator(), perception, ProtocolConfig(max_rounds=4), 7).run()
    return agent, perception, [outcome.record for outcome in run]


def test_views_and_pose_are_as_perceived_and_the_record_tells_the_truth(episode):
    agent, perception, records = episode
    poses = [entry.pose for record in records for entry in record.trace]
    assert all(record.is_scored for record in records)
    assert len(poses) == len(agent.seen) == len(perception.batches)
    for observation, frames, pose in zip(agent.seen, perception.batches, poses, strict=True):
        assert observation.pose.x_m == pytest.approx(pose.x_m + 0.5)
        assert observation.pose.yaw_rad == pytest.approx(pose.yaw_rad + 0.1)
        assert observation.pose.y_m == pytest.approx(0.9)
        assert len(observation.views) == len(frames)
        for view, frame in zip(observation.views, frames, strict=True):
            assert view.pose == moved(frame.pose)
            assert np.array_equal(view.depth_m, frame.depth_m + 1)


def test_a_round_is_one_batch_with_colours_that_only_the_perception_sees(episode):
    agent, perception, _ = episode
    sensors = SensorConfig()
    assert len(perception.batches[0]) == sensors.first_round.count
    assert len(perception.batches[1]) == sensors.later_rounds.count
    assert all(frame.rgb is not None for frames in perception.batches for frame in frames)
    assert all(view.rgb is None for observation in agent.seen for view in observation.views)


def test_each_stage_is_announced_with_its_goal_and_its_text_feature_reaches_the_agent(episode):
    agent, perception, _ = episode
    assert [scene.goal.stage for scene in perception.scenes] == [1, 2]
    assert [(scene.task_id, scene.agent, scene.seed) for scene in perception.scenes] == [("toy", "watching", 7)] * 2
    assert all(np.array_equal(one.goal_feature, np.array([0.6, 0.8], np.float32)) for one in agent.seen)


def test_cells_seen_are_those_of_the_true_pose(episode):
    agent, _, _ = episode
    truthful = Watching()
    list(
        Episode(
            CASE, "watching", truthful, ToySimulator(), GroundTruthPerception(), ProtocolConfig(max_rounds=1), 7
        ).run()
    )
    for believed, true in zip(agent.seen[0].views, truthful.seen[0].views, strict=True):
        assert np.array_equal(believed.occupancy.free, true.occupancy.free)
        assert np.array_equal(believed.occupancy.blocked, true.occupancy.blocked)


@pytest.mark.parametrize("camera_height_m", [0.9, 1.575])
def test_memories_place_objects_where_they_are_at_any_camera_height(camera_height_m):
    simulator = EmbeddedSimulator(SimulatorConfig(camera_height_m=camera_height_m))
    simulator.reset(next(bundled_houses()).to_json())
    scene = StageScene("a-house", stage_case(1, "Bed|1").public, "an-agent", 0, simulator.objects)
    observation = Sensors(simulator, GroundTruthPerception(), SensorConfig(), scene).observe(
        is_first=True, num_rounds_left=1
    )
    assert observation.pose.y_m == pytest.approx(0.9), "the pose of the body"

    entries, bev = ObjectMap(), BevMap((observation.pose.x_m, observation.pose.z_m), 0)
    for view in observation.views:
        assert view.pose.y_m == camera_height_m
        entries.update(view)
        bev.integrate(view)
        clouds = clouds_of(view)
        for index, label in enumerate(view.detections.labels):
            assert is_of_a_body(clouds.points_m(index), label, simulator.objects), label
    assert len(entries.entries) > 3
    for entry in entries.entries:
        assert is_of_a_body(entries.points_m(entry.id), entry.label, simulator.objects), entry.label
    assert 0.0 < bev.core.obstacles.sum() < 0.5 * bev.core.explored.sum(), "the floor is no obstacle"


def is_of_a_body(points_m, label, bodies):
    """Whether all points lie in the bounding box of one body of this category, to 5 cm."""
    return any(
        (np.abs(points_m - body.centre_m) <= np.array(body.size_m) / 2 + 0.05).all()
        for body in bodies
        if body.category == label
    )


def test_all_agents_of_a_run_meet_the_same_errors_and_another_seed_others(tmp_path):
    seen = []
    for seed in (0, 1):
        path = tmp_path / f"{seed}.txt"
        backend = Backend(perception=Component("seeds_seen:Noting", {"path": str(path)}))
        config = RunConfig(seed=seed, backend=backend, protocol=ProtocolConfig(max_rounds=1))
        evaluate(["stay-still", "shortest-path"], task_files(BUNDLED_TASKS, 2), tmp_path / f"run{seed}", config=config)
        seen.append({tuple(line.split()) for line in path.read_text(encoding="utf-8").splitlines()})
    for told in seen:
        assert {agent for agent, _, _ in told} == {"stay-still", "shortest-path"}
        assert len(told) == 4
        assert len({(task, seed) for _, task, seed in told}) == len({seed for _, _, seed in told}) == 2
    assert {one[2] for one in seen[0]}.isdisjoint({one[2] for one in seen[1]})
