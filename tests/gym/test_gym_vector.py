"""Many environments in Rust against as many alone."""

import threading
import time

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from evonav.errors import InvalidArgumentError, SimulationError
from evonav.gym import ENV_ID, OBSERVATIONS, NavConfig, VectorEnv
from evonav.gym.sources import FolderTasks
from evonav.gym.worlds import WorldLoader

SMALL = {"width_px": 32, "height_px": 24}


def _require_same(ours, theirs, at=""):
    """Equal to the bit, types and shapes too."""
    assert type(ours) is type(theirs), at
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys(), at
        for key, value in ours.items():
            _require_same(value, theirs[key], f"{at}/{key}")
    elif isinstance(ours, tuple):
        for index, (a, b) in enumerate(zip(ours, theirs, strict=True)):
            _require_same(a, b, f"{at}[{index}]")
    elif isinstance(ours, np.ndarray) and ours.dtype == object:
        _require_same(tuple(ours), tuple(theirs), at)
    elif isinstance(ours, np.ndarray):
        assert (ours.dtype, ours.shape) == (theirs.dtype, theirs.shape), at
        assert np.array_equal(ours, theirs, equal_nan=ours.dtype.kind == "f"), at
    else:
        assert ours == theirs, at


def _make(mode, num_envs, **settings):
    return gymnasium.make_vec(ENV_ID, num_envs=num_envs, vectorization_mode=mode, **SMALL, **settings)


@pytest.mark.parametrize(
    "settings",
    [
        {"max_steps": 9, "num_threads": 1},
        {"max_steps": 4, "num_threads": 3, "action_mode": "waypoints", "reward": "spl"},
        {"max_steps": 5, "action_mode": "waypoints", "waypoint_frame": "start", "oracle_info": True},
        {"max_steps": 3, "houses": "endless:7", "num_threads": 2},
        {"max_steps": 3, "randomize": ("materials", "lighting"), "style": "default"},
    ],
)
def test_a_batch_is_as_many_environments_alone(settings):
    """Over whole tasks and the resets between them, everything returned is equal to the bit."""
    ours = _make("vector_entry_point", 3, observations=OBSERVATIONS, **settings)
    alone = {name: value for name, value in settings.items() if name != "num_threads"}
    theirs = _make("sync", 3, observations=OBSERVATIONS, **alone)
    _require_same(ours.reset(seed=11), theirs.reset(seed=11), "reset")
    ours.action_space.seed(1)
    num_over = 0
    for step in range(70):
        actions = ours.action_space.sample()
        mine = ours.step(actions)
        _require_same(mine, theirs.step(actions), str(step))
        num_over += mine[2].sum()
    assert num_over > 3
    ours.close()


def test_episodes_can_restart_in_the_step_that_ends_them():
    """As Gymnasium's own environments do with `SAME_STEP`, final observations and infos included."""
    kwargs = {"vector_kwargs": {"autoreset_mode": AutoresetMode.SAME_STEP}}
    ours = _make("vector_entry_point", 3, observations=OBSERVATIONS, max_steps=3, copy=False, autoreset_mode="SameStep")
    theirs = _make("sync", 3, observations=OBSERVATIONS, max_steps=3, **kwargs)
    _require_same(ours.reset(seed=5), theirs.reset(seed=5), "reset")
    num_over = 0
    for step in range(30):
        actions = np.full(3, step % 3)
        mine = ours.step(actions)
        _require_same(mine, theirs.step(actions), str(step))
        num_over += "final_info" in mine[4]
    assert num_over > 1
    assert ours.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert VectorEnv.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    with pytest.raises(InvalidArgumentError, match="'NextStep' or 'SameStep'"):
        VectorEnv(autoreset_mode="Disabled")


def test_it_is_a_gymnasium_vector_environment():
    envs = _make(None, 4)
    assert isinstance(envs, VectorEnv)
    seen, infos = envs.reset(seed=[1, None, 3, 4])
    assert seen in envs.observation_space
    assert infos["_stage"].all()
    seen, rewards, over, truncated, _ = envs.step(envs.action_space.sample())
    assert seen in envs.observation_space
    assert (rewards.dtype, over.dtype, truncated.any()) == (np.float64, np.bool_, False)
    assert gymnasium.wrappers.vector.RecordEpisodeStatistics(envs).reset()[0].keys() == seen.keys()
    envs.close()
    envs.close()


def test_arrays_are_copies_unless_sharing_is_requested():
    own, shared = _make(None, 2, observations=("depth",)), _make(None, 2, observations=("depth",), copy=False)
    for envs, is_shared in ((own, False), (shared, True)):
        first, _ = envs.reset(seed=0)
        kept = first["depth"].copy()
        second = envs.step(np.array([2, 2]))[0]
        assert np.shares_memory(first["depth"], second["depth"]) == is_shared
        assert np.array_equal(first["depth"], kept) != is_shared
        envs.close()


def test_python_runs_while_a_batch_is_drawn():
    """Another thread of Python gets its turns during one long call into Rust: the lock is not held."""
    envs = VectorEnv(num_envs=8, width_px=512, height_px=512, observations=("depth", "rgb"), num_threads=1)
    envs.reset(seed=0)
    ticks: list[float] = []
    is_over = threading.Event()

    def tick():
        while not is_over.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    images = envs._images
    start_s = time.perf_counter()
    for _ in range(10):
        envs._batch.render(depth_m=images["depth"], rgb=images["rgb"], labels=None)
    end_s = time.perf_counter()
    is_over.set()
    thread.join()
    during = sum(start_s < at_s < end_s for at_s in ticks)
    # Each of the ten calls takes tens of milliseconds; with the lock held there is a turn between two calls at most.
    assert during > 30
    envs.close()


def test_the_kernel_refuses_arrays_of_the_wrong_shape():
    envs = VectorEnv(num_envs=2, **SMALL, observations=("depth",))
    with pytest.raises(ResetNeeded):
        envs.step(np.zeros(2, np.int64))
    with pytest.raises(SimulationError, match="place it"):
        envs._batch.poses()
    envs.reset(seed=0)
    for wrong in (np.zeros(3, np.int64), np.array([0, 4]), np.array([-1, 0])):
        with pytest.raises(InvalidArgumentError, match="actions"):
            envs.step(wrong)
    transposed = np.zeros((32, 24, 2), np.float32).T
    for image in (transposed, np.zeros((2, 24, 31), np.float32)):
        with pytest.raises(InvalidArgumentError, match="depth_m"):
            envs._batch.render(depth_m=image, rgb=None, labels=None)
    with pytest.raises(InvalidArgumentError, match="seeds"):
        envs.reset(seed=[1])
    envs.close()


def test_houses_are_built_once_and_memory_is_bounded():
    source, config = FolderTasks(), NavConfig(**SMALL)
    loader = WorldLoader(source, config, max_bytes=2**40)
    again = [loader.get(0, 1).world for _ in range(3)]
    assert again[0] is again[1] is again[2]
    assert loader.num_built == 1
    num_houses = len({stage.house_sha256 for number in range(4) for stage in source.task(number).oracle_stages})
    for number in range(4):
        for stage in range(1, source.task(number).num_stages + 1):
            loader.prefetch(number, stage)
            assert loader.get(number, stage).stage == stage
    assert loader.num_built == num_houses
    bytes_one = again[0].num_bytes
    small = WorldLoader(source, config, max_bytes=2 * bytes_one)
    for number in range(6):
        small.get(number, 1)
    kept = [world.num_bytes for world in small._built.values()]
    assert sum(kept) <= 2 * bytes_one or len(kept) == 1
    assert len(kept) < 6
    assert small.num_built == 6
    small.get(0, 1)
    assert small.num_built == 7
    with pytest.raises(SimulationError, match="stages"):
        loader.get(0, 64)
    loader.close()
    small.close()
