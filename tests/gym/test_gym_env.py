"""One environment: Gymnasium's checker, the evaluator's measures, determinism, and what observations hold."""

import math
import subprocess
import sys
import warnings
from itertools import count

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env, data_equivalence

from evonav.agents.agent import AgentAction, Move, NavigateTo, SensorConfig, Stop
from evonav.errors import InvalidArgumentError, TaskError
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.spec import episode_spec
from evonav.evaluation.protocol import ProtocolConfig
from evonav.gym import ACTIONS, ENV_ID, OBSERVATIONS, LifelongNavEnv, NavConfig, vocabulary
from evonav.gym.spaces import waypoint_m
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.tasks.files import load_task
from evonav.tasks.language import STRUCTURE_TYPES
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import Action

SMALL = {"width_px": 32, "height_px": 24}


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"action_mode": "waypoints", "waypoint_frame": "polar"},
        {
            "observations": OBSERVATIONS,
            "oracle_info": True,
            "reward": "spl",
            "render_mode": "rgb_array",
            "max_steps": 2,
        },
    ],
)
def test_gymnasiums_checker_finds_nothing(settings):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(ENV_ID, **SMALL, **settings).unwrapped)


@pytest.mark.parametrize(
    "code",
    [
        "import sys, evonav, evonav.cli; assert 'gymnasium' not in sys.modules;"
        "import gymnasium; make, name = gymnasium.make, 'evonav.gym:evonav/LifelongNav-v0';"
        "assert gymnasium.make_vec(name, num_envs=2, width_px=8, height_px=8).num_envs == 2",
        "from gymnasium import make; name = 'evonav.gym:evonav/LifelongNav-v0'",
        "import evonav.gym; from gymnasium import make; name = 'evonav/LifelongNav-v0'",
    ],
)
def test_the_environment_can_be_made_by_its_id_alone_or_after_its_import(code):
    made = "env = make(name, width_px=8, height_px=8); env.reset(seed=0); print(type(env.unwrapped).__name__)"
    done = subprocess.run([sys.executable, "-c", f"{code}\n{made}"], capture_output=True, text=True, check=True)
    assert done.stdout == "LifelongNavEnv\n"


def test_observations_for_learning_are_a_flat_dict_of_boxes_and_discretes_from_zero():
    """What stable-baselines3 2.9 requires in `check_env` and of its image networks."""
    env = gymnasium.make(ENV_ID, observations="learn").unwrapped
    seen, _ = env.reset(seed=0)
    image, state, category = (env.observation_space[name] for name in ("image", "state", "category"))
    assert set(env.observation_space) == {"image", "state", "category"}
    assert (image.shape, image.dtype, image.low.min(), image.high.max()) == ((84, 84, 4), np.uint8, 0, 255)
    assert (state.shape, state.dtype) == ((6,), np.float32)
    assert (category.start, category.n) == (0, len(vocabulary()))
    assert seen["state"].tolist() == [0, 0, 0, 1, 1, 1]
    wide = NavConfig(observations="learn", width_px=100)
    assert (wide.width_px, wide.height_px) == (100, 84)
    flat = gymnasium.wrappers.FlattenObservation(env)
    assert flat.observation_space.shape == (84 * 84 * 4 + 6 + len(vocabulary()),)


def test_the_image_for_learning_is_colours_and_depth():
    names = ("image", "rgb", "depth", "state", "pose")
    seen, _ = LifelongNavEnv(observations=names, **SMALL).reset(seed=3)
    assert list(seen) == list(names)
    assert np.array_equal(seen["image"][..., :3], seen["rgb"])
    near = seen["depth"] < 9.9
    assert np.abs(seen["image"][..., 3][near] / 25.5 - seen["depth"][near]).max() < 0.04
    alone, _ = LifelongNavEnv(observations=("image",), **SMALL).reset(seed=3)
    assert np.array_equal(alone["image"], seen["image"])


@pytest.mark.parametrize("mode", ["actions", "waypoints"])
def test_an_automatic_stop_ends_a_stage_within_the_success_radius(mode):
    env = LifelongNavEnv(observations=("pose",), stop="automatic", action_mode=mode, success_radius_m=3.0, max_steps=60)
    env.action_space.seed(0)
    env.reset(seed=1)
    results = []
    for _ in range(400):
        _, _, is_over, _, info = env.step(env.action_space.sample())
        results += [info["stage_result"]] if "stage_result" in info else []
        if is_over:
            env.reset()
    stopped = [result for result in results if result["has_stopped"]]
    assert stopped
    assert all(result["success"] == (result["terminal_distance_m"] < 3.0) for result in stopped)
    assert all(result["num_steps"] == 60 for result in results if not result["has_stopped"])
    if mode == "actions":
        with pytest.raises(InvalidArgumentError, match="expected 0 to 2"):
            env.step(3)


class _Replaying:
    """An agent that does what it was handed."""

    def __init__(self, actions: list[AgentAction], motion: str) -> None:
        self.sensors = SensorConfig(motion=motion)
        self._actions = iter(actions)

    def begin_task(self, task): ...
    def begin_stage(self, goal): ...
    def act(self, observation):
        return next(self._actions)


def _as_told(env: LifelongNavEnv, action) -> AgentAction:
    """A gym action in the evaluator's words."""
    if env.config.action_mode == "actions":
        chosen = ACTIONS[int(action)]
        return Stop() if chosen is Action.STOP else Move(chosen)
    target_m = waypoint_m(env.config, action, env._batch._poses[0], env._batch._origins[0])
    return Stop() if target_m is None else NavigateTo(target_m)


@pytest.mark.parametrize("mode", ["actions", "waypoints"])
def test_the_same_actions_give_the_evaluators_metrics(mode):
    """Five tasks walked at random, some stages to their budget's end, by environment and evaluator."""
    budget = 40 if mode == "actions" else 8
    config = NavConfig(action_mode=mode, max_steps=budget, observations=("pose",), **SMALL)
    env = LifelongNavEnv(config=config)
    random = np.random.default_rng(5)
    for root in env.source.roots[::5]:
        env.reset(seed=1, options={"task": root.name})
        told, results, is_over = [], [], False
        while not is_over:
            stops = random.random() < 0.03
            if mode == "actions":
                action = 3 if stops else random.choice(3, p=[0.6, 0.2, 0.2])
            else:
                action = np.array([*random.uniform(-1, 1, 2), 1.0 if stops else -1.0], np.float32)
            told.append(_as_told(env, action))
            _, _, is_over, _, info = env.step(action)
            results += [info["stage_result"]] if "stage_result" in info else []
        case = episode_spec(load_task(root))
        protocol = ProtocolConfig(max_rounds=budget, max_actions=budget)
        simulator = EmbeddedSimulator(config.simulator)
        agent = _Replaying(told, mode)
        outcomes = Episode(case, "replaying", agent, simulator, GroundTruthPerception(), protocol, 0).run()
        for record, result in zip((outcome.record for outcome in outcomes), results, strict=True):
            assert result["state"] == record.state.value
            for ours, theirs in (
                ("spl", record.spl),
                ("soft_spl", record.soft_spl),
                ("path_length_m", record.path_length_m),
                ("reference_length_m", record.reference_length_m),
                ("start_distance_m", record.start_distance_m),
                ("terminal_distance_m", record.terminal_distance_m),
                ("num_steps", record.num_rounds),
            ):
                assert result[ours] == theirs, ours
            assert result["has_stopped"] == record.has_stopped
            assert result["success"] == (record.state.value == "success")


def _rollout(env, seed, num_steps=60):
    env.action_space.seed(seed)
    steps = [env.reset(seed=seed)]
    for _ in range(num_steps):
        steps.append(env.step(env.action_space.sample()))
        if steps[-1][2]:
            steps.append(env.reset())
    return steps


def test_a_seed_gives_the_same_episodes_to_the_bit():
    first, again, other = (
        _rollout(LifelongNavEnv(observations=OBSERVATIONS, max_steps=7, **SMALL), seed) for seed in (3, 3, 4)
    )
    assert all(data_equivalence(a, b) for a, b in zip(first, again, strict=True))
    assert first[0][1]["task_id"] != other[0][1]["task_id"]


def test_an_episode_is_a_task_whose_stages_begin_where_the_last_ended():
    env = LifelongNavEnv(max_steps=5, observations=("pose", "stage", "steps_left", "category"), reward="sparse")
    seen, info = env.reset(seed=0)
    assert (info["stage"], seen["stage"], seen["steps_left"]) == (1, 1, 5)
    assert seen["pose"].tolist() == [0.0, 0.0, 0.0, 1.0]
    stages = []
    for step in count(1):
        before = seen["pose"]
        seen, reward, is_over, is_truncated, info = env.step(2)
        assert not is_truncated
        if step % 5:
            assert "stage_result" not in info
            assert reward == 0.0
            continue
        stages.append(info["stage_result"])
        assert reward == float(stages[-1]["success"])
        assert stages[-1]["num_steps"] == 5
        assert not stages[-1]["has_stopped"]
        if is_over:
            break
        assert (seen["stage"], seen["steps_left"]) == (step // 5 + 1, 5)
        assert np.hypot(*(seen["pose"][:2] - before[:2])) < 0.5
    assert [result["stage"] for result in stages] == list(range(1, info["num_stages"] + 1))
    assert info["task_result"]["success"] == sum(r["success"] for r in stages) / len(stages)
    with pytest.raises(ResetNeeded):
        env.step(0)


def test_progress_rewards_sum_to_the_reduced_distance():
    env = LifelongNavEnv(observations=("pose",), oracle_info=True, max_steps=100)
    _, info = env.reset(seed=2)
    start_m = info["oracle"]["geodesic_distance_m"]
    assert start_m == pytest.approx(info["oracle"]["reference_length_m"])
    total = 0.0
    for step in count(1):
        _, reward, _, _, info = env.step(3 if step == 30 else (0, 0, 2)[step % 3])
        total += reward
        if "stage_result" in info:
            break
    result = info["stage_result"]
    expected = start_m - result["geodesic_distance_m"] - 0.01 * 30 + (2.5 if result["success"] else 0.0)
    assert total == pytest.approx(expected)


def test_observations_contain_no_oracle_data():
    env = LifelongNavEnv(observations=OBSERVATIONS, **SMALL)
    seen, info = env.reset(seed=0)
    assert set(info) == {"task_id", "stage", "num_stages"}
    task = env.source.task(env.source.find(info["task_id"]))
    target_m = task.oracle(1).target.position_m
    numbers = {name: np.asarray(value).ravel() for name, value in seen.items() if name != "instruction"}
    for name in ("pose", "steps_left", "category", "stage", "is_action_success", "has_arrived"):
        assert not np.isin(np.float32(target_m), numbers[name]).any()
    assert seen["semantic"].max() <= len(vocabulary())
    assert info.keys() == env.step(0)[4].keys()


def test_images_are_the_simulators_and_semantic_ones_its_ground_truth_by_category():
    env = LifelongNavEnv(observations=("semantic", "depth", "rgb"), width_px=64, height_px=64)
    seen, info = env.reset(seed=1)
    task = env.source.task(env.source.find(info["task_id"]))
    simulator = EmbeddedSimulator(env.config.simulator)
    simulator.reset(task.house_json(1), task.start_pose)
    frame = simulator.render()
    assert np.array_equal(seen["depth"], np.minimum(frame.depth_m, np.float32(20.0)))
    assert np.array_equal(seen["rgb"], frame.rgb)
    detections = GroundTruthPerception().detect(frame, simulator.objects)
    labels = ["" if label in STRUCTURE_TYPES else label for label in detections.labels]
    names = np.array([*labels, ""])[detections.masks]
    words = np.array(["", *vocabulary()])
    assert (words[seen["semantic"]] == names).all()
    assert len(np.unique(names)) > 2


def test_the_field_of_view_is_the_horizontal_one():
    wide = NavConfig(width_px=200, height_px=100, hfov_deg=90.0).simulator
    assert math.tan(math.radians(wide.vertical_fov_deg / 2)) == pytest.approx(0.5)
    assert NavConfig(width_px=64, height_px=64, hfov_deg=79.0).simulator.vertical_fov_deg == 79.0


@pytest.mark.parametrize(
    ("frame", "action", "expected"),
    [
        ("relative", (0.2, 0.4, -1), (1.0 + 2.0, 2.0 - 1.0)),
        ("polar", (-0.6, 0.5, -1), (1.0, 2.0 - 1.0)),
        ("start", (0.2, 0.4, -1), (5.0 + 1.0, 6.0 + 2.0)),
    ],
)
def test_waypoints_are_in_their_frame(frame, action, expected):
    """An agent at (1, 2) that looks along +x; the task began at (5, 6), looking along +z."""
    config = NavConfig(waypoint_frame=frame, waypoint_range_m=5.0)
    pose, origin = np.array([1.0, 0.9, 2.0, np.pi / 2, 0.0]), np.array([5.0, 0.9, 6.0, 0.0, 0.0])
    assert waypoint_m(config, np.float32(action), pose, origin) == pytest.approx(expected)
    assert waypoint_m(config, np.float32([0, 0, 0.1]), pose, origin) is None
    assert np.isfinite(waypoint_m(config, np.float32([np.nan, np.inf, -np.inf]), pose, origin)).all()


def test_wrong_settings_are_reported(tmp_path):
    for settings in (
        {"action_mode": "flying"},
        {"observations": ("depth", "target")},
        {"observations": ()},
        {"reward": "much"},
        {"hfov_deg": 200.0},
        {"width_px": 0},
        {"max_steps": 0},
    ):
        with pytest.raises(InvalidArgumentError, match=next(iter(settings))):
            LifelongNavEnv(**settings)
    with pytest.raises(TaskError, match="holds no task"):
        LifelongNavEnv(tmp_path)
    with pytest.raises(InvalidArgumentError, match="no such task"):
        LifelongNavEnv().reset(options={"task": "house-9"})
    assert NavConfig(max_steps=3).budget == 3
    assert (NavConfig().budget, NavConfig(action_mode="waypoints").budget) == (500, 50)
