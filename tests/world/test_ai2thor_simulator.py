"""AI2-THOR's own client on our engine keeps the simulator's contract, and answers as the embedded simulator does."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import compare_simulators
import numpy as np
import pytest

from evonav.component import Component
from evonav.errors import InvalidArgumentError, SimulationError, SimulatorLostError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.house import bundled_houses
from evonav.parallel.folders import LOCK_NAME
from evonav.tasks.listing import BUNDLED_TASKS, task_files
from evonav.world.ai2thor import Ai2ThorOptions, Ai2ThorSimulator
from evonav.world.ai2thor.events import InstanceDecoder, depth_of, with_boxes
from evonav.world.check import check_simulator
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Action, Frame, SimulatorConfig

pytest.importorskip("ai2thor", reason="the thor dependency group (ai2thor) is not installed")

HOUSE = min((house.to_json() for house in bundled_houses(20)), key=len)
OURS = Ai2ThorOptions(executable="evonav", timeout_s=30.0)


@pytest.fixture(autouse=True)
def _home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the client keeps its locks; without a display, and with a GPU named that is not to be looked for."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "0")


@pytest.fixture
def simulator() -> Iterator[Ai2ThorSimulator]:
    made = Ai2ThorSimulator(options=OURS)
    yield made
    made.close()


def pid_of(simulator: Ai2ThorSimulator) -> int:
    assert simulator._controller is not None
    return int(simulator._controller.unity_pid)


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_contract_holds(simulator: Ai2ThorSimulator) -> None:
    check_simulator(simulator, HOUSE)


def test_contract_holds_with_another_camera_and_other_steps() -> None:
    config = SimulatorConfig(width_px=96, height_px=64, vertical_fov_deg=60.0, turn_deg=30.0, move_m=0.2)
    check_simulator(Ai2ThorSimulator(config, OURS), HOUSE)


def test_walks_are_the_same_to_the_bit(simulator: Ai2ThorSimulator) -> None:
    """Random steps, teleports and questions, in the embedded simulator and through the client."""
    embedded, rng = EmbeddedSimulator(), np.random.default_rng(0)
    assert simulator.reset(HOUSE) == embedded.reset(HOUSE)
    assert simulator.objects == embedded.objects
    np.testing.assert_array_equal(simulator.occupancy().cells, embedded.occupancy().cells)
    assert simulator.occupancy().corner_m == embedded.occupancy().corner_m
    actions = [Action.MOVE_FORWARD, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT, Action.STOP]
    outcomes = set()
    for turn in range(300):
        action = actions[rng.integers(len(actions))]
        done = simulator.step(action)
        outcomes.add((action, done))
        assert done == embedded.step(action)
        assert simulator.pose == embedded.pose
        if turn % 20 == 0:
            here = embedded.pose
            np.testing.assert_array_equal(simulator.reachable_positions(), embedded.reachable_positions())
            x_m, z_m = rng.uniform(-1.0, 1.0, 2).tolist()
            there = Pose(
                here.x_m + x_m, 0.0, here.z_m + z_m, float(rng.uniform(-9.0, 9.0)), float(rng.uniform(-0.5, 1.0))
            )
            path_m = simulator.shortest_path(here.position_m, there.position_m)
            np.testing.assert_array_equal(path_m, embedded.shortest_path(here.position_m, there.position_m))
            assert simulator.is_free(there.position_m) == embedded.is_free(there.position_m)
            _assert_same_frames(simulator.render(there), embedded.render(there))
            assert simulator.pose == here  # however far the camera was sent
            assert simulator.teleport(there) == embedded.teleport(there)
            assert simulator.pose == embedded.pose
    assert outcomes >= {(Action.MOVE_FORWARD, True), (Action.MOVE_FORWARD, False)}


def _assert_same_frames(one: Frame, other: Frame) -> None:
    assert (one.pose, one.intrinsics) == (other.pose, other.intrinsics)
    for a, b in ((one.depth_m, other.depth_m), (one.rgb, other.rgb), (one.instances, other.instances)):
        assert a is not None
        assert b is not None
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)


@pytest.mark.slow
def test_episodes_are_the_same_by_both_routes(tmp_path: Path) -> None:
    """Whole records of all three heuristics, and the images at every third pose they decided at."""
    tasks = task_files(BUNDLED_TASKS, 1)
    agents = ["fu", "stage-reset", "ftu"]
    folders = compare_simulators.evaluate_both(agents, tasks, tmp_path, num_workers=2, max_rounds=15)
    assert list(compare_simulators.differing_records(*folders)) == []
    assert list(compare_simulators.differing_images(folders[0], tasks, every=3)) == []
    with RunStore(folders[0]) as store:
        assert sum(1 for record in store.records() if record.path_length_m) >= 9


def test_an_occupied_pose_is_moved_as_in_the_embedded_simulator(
    simulator: Ai2ThorSimulator,
) -> None:
    embedded = EmbeddedSimulator()
    start = embedded.reset(HOUSE)
    table = next(body for body in embedded.objects if body.kind == "object" and min(body.size_m) > 0.5)
    for x_m, z_m in ((table.centre_m[0], table.centre_m[2]), (start.x_m + 0.3, start.z_m), (-50.0, 3.0)):
        asked = Pose(x_m, 0.0, z_m, 1.23456789, 0.3)
        assert simulator.reset(HOUSE, asked) == embedded.reset(HOUSE, asked)


def test_non_finite_numbers_are_refused(simulator: Ai2ThorSimulator) -> None:
    start = simulator.reset(HOUSE)
    assert not simulator.teleport(replace(start, yaw_rad=math.nan))
    assert not simulator.is_free((math.inf, 0.0, 0.0))
    with pytest.raises(InvalidArgumentError, match="finite"):
        simulator.render(replace(start, x_m=math.nan))
    assert simulator.pose == start


def test_a_house_that_is_refused_leaves_a_simulator_that_works(simulator: Ai2ThorSimulator) -> None:
    with pytest.raises(SimulationError, match="call reset first"):
        simulator.step(Action.MOVE_FORWARD)
    simulator.reset(HOUSE)
    pid = pid_of(simulator)
    broken = json.loads(HOUSE)
    broken["rooms"] = []
    with pytest.raises(Exception, match=r"room|floor"):
        simulator.reset(json.dumps(broken))
    with pytest.raises(SimulationError, match="call reset first"):
        simulator.render()
    simulator.reset(HOUSE)
    assert pid_of(simulator) == pid


ASKED: list[Callable[[Any], object]] = [
    lambda simulator: simulator.render(),
    lambda simulator: simulator.reset(HOUSE),
    lambda simulator: simulator.shortest_path((1.0, 0.0, 1.0), (2.0, 0.0, 2.0)),
]


@pytest.mark.parametrize(
    ("number", "how", "ask"),
    [
        *((signal.SIGKILL, "SIGKILL", ask) for ask in ASKED),
        (signal.SIGSTOP, "hangs", ASKED[0]),
        pytest.param(signal.SIGTERM, "exit code 143", ASKED[0], marks=pytest.mark.slow),
        *(pytest.param(signal.SIGSTOP, "hangs", ask, marks=pytest.mark.slow) for ask in ASKED[1:]),
    ],
)
def test_a_lost_process_is_reported_and_replaced(number: int, how: str, ask: Callable[[Any], object]) -> None:
    simulator = Ai2ThorSimulator(SimulatorConfig(width_px=64, height_px=64), OURS.model_copy(update={"timeout_s": 3.0}))
    try:
        start = simulator.reset(HOUSE)
        pid = pid_of(simulator)
        os.killpg(pid, number)  # our engine is two processes
        began_s = time.monotonic()
        with pytest.raises(SimulatorLostError, match=how):
            ask(simulator)
        assert time.monotonic() - began_s < (8.0 if number == signal.SIGSTOP else 2.0)
        assert not is_alive(pid)
        assert simulator.reset(HOUSE) == start
        assert pid_of(simulator) != pid
    finally:
        simulator.close()


def test_nothing_is_left_after_closing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    simulator = Ai2ThorSimulator(SimulatorConfig(width_px=64, height_px=64), OURS)
    simulator.reset(HOUSE)
    simulator.close()  # what is opened once for all is open now
    before = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(3):
        simulator.reset(HOUSE)
        pid = pid_of(simulator)
        simulator.render()
        simulator.close()
        simulator.close()
        assert not is_alive(pid)
        assert not list(temporary.iterdir())
    assert len(list(Path("/proc/self/fd").iterdir())) <= before


@pytest.mark.slow
def test_an_evaluation_survives_the_loss_of_its_simulators_process(tmp_path: Path) -> None:
    """A simulator that is killed in the middle: the records are those of a run in which nothing happened."""
    whole = RunConfig(backend=compare_simulators.THOR, protocol=ProtocolConfig(max_rounds=6))
    options, host_options = {"executable": "evonav"}, {"folder": str(tmp_path)}
    dying = Component("test_ai2thor_simulator:killed_once", options, host_options)
    killed = replace(whole, backend=replace(whole.backend, simulator=dying))
    tasks = task_files(BUNDLED_TASKS, 1)
    for name, config in (("whole", whole), ("killed", killed)):
        evaluate(["ftu"], tasks, tmp_path / name, config=config, num_workers=0)
    with RunStore(tmp_path / "whole") as one, RunStore(tmp_path / "killed") as other:
        assert list(one.record_texts()) == list(other.record_texts())
        assert one.failures() == []
        assert [(lost.stage, lost.is_retried) for lost in other.failures()] == [(2, True)]


@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_nothing_outlives_an_evaluation_that_is_killed(tmp_path: Path, number: int) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    options = "--simulator ai2thor --set simulator.executable=evonav --limit 1 --agent ftu --workers 1"
    evonav = subprocess.Popen(
        [sys.executable, "-m", "evonav", "evaluate", *options.split(), "--out", str(tmp_path / "run")],
        env=os.environ | {"TMPDIR": str(temporary)},
        stderr=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    engines: set[int] = set()
    try:
        deadline_s = time.monotonic() + 60.0
        while not (tmp_path / "run" / "records.sqlite").exists() or not engines:
            assert time.monotonic() < deadline_s
            engines = {pid for pid in _descendants(evonav.pid) if "evonav-thor" in _command(pid)}
            time.sleep(0.05)
        family = _descendants(evonav.pid)
        evonav.send_signal(number)
        evonav.wait(10.0)
        deadline_s = time.monotonic() + 10.0
        while any(is_alive(pid) for pid in family):
            assert time.monotonic() < deadline_s
            time.sleep(0.05)
        left = [file for file in temporary.rglob("*") if file.is_file()]
        assert all(file.name == LOCK_NAME for file in left)  # of the agents' folder, which the next run deletes
        assert number == signal.SIGKILL or not left
    finally:
        evonav.kill()
        evonav.wait()
        for pid in engines:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


def _descendants(pid: int) -> set[int]:
    found: set[int] = set()
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):
            for child in map(int, path.read_text().split()):
                found |= {child} | _descendants(child)
    return found


def _command(pid: int) -> str:
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text()
    return ""


class KilledOnce(Ai2ThorSimulator):
    """Its first process dies in the second house."""

    folder = Path()
    num_resets = 0

    def reset(self, house_json: str, pose: Pose | None = None) -> Pose:
        self.num_resets += 1
        return super().reset(house_json, pose)

    def render(self, pose: Pose | None = None, *, rgb: bool = True, instances: bool = True) -> Frame:
        mark = self.folder / "is_killed"
        if self.num_resets == 2 and not mark.exists():
            mark.touch()
            os.kill(pid_of(self), signal.SIGKILL)
        return super().render(pose, rgb=rgb, instances=instances)


def killed_once(executable: str, folder: str) -> KilledOnce:
    simulator = KilledOnce(options=Ai2ThorOptions(executable=executable, timeout_s=30.0))
    simulator.folder = Path(folder)
    return simulator


class TestAsUnityReports:
    """What Unity does that our engine does not: single precision, other depths, things that are no objects."""

    def test_poses_in_single_precision_count_as_the_requested_ones(self, simulator: Ai2ThorSimulator) -> None:
        asked = Pose(1.2345678912, 0.9, 7.1, 1.0, 0.2).canonical()
        event = _event(np.float32(asked.x_m), np.float32(asked.z_m), np.float32(asked.yaw_deg), asked.horizon_deg)
        assert simulator._adopted(asked, event) == asked
        turned = _event(asked.x_m, asked.z_m, asked.yaw_deg - 360.0, asked.horizon_deg)
        assert simulator._adopted(asked, turned) == asked

    @pytest.mark.parametrize("off", [(0.01, 0.0, 0.0, 0.0), (0.0, 0.01, 0.0, 0.0), (0, 0, 1.0, 0), (0, 0, 0, 1.0)])
    def test_different_reported_poses_are_accepted(
        self, simulator: Ai2ThorSimulator, off: tuple[float, float, float, float]
    ) -> None:
        asked = Pose(1.0, 0.9, 7.0, 0.0, 0.0)
        reported = simulator._adopted(asked, _event(1.0 + off[0], 7.0 + off[1], off[2], off[3]))
        assert reported == Pose.of_degrees(1.0 + off[0], 0.9, 7.0 + off[1], off[2], off[3])

    def test_the_far_plane_is_background(self) -> None:
        depth_m = np.array([[0.5, 19.9, np.nextafter(np.float32(20.0), np.float32(0.0)), 20.0, 25.0]], np.float32)
        got = depth_of(SimpleNamespace(depth_frame=depth_m[::1]), 20.0)
        np.testing.assert_array_equal(np.isinf(got), [[False, False, True, True, True]])
        np.testing.assert_array_equal(got[0, :2], depth_m[0, :2])

    def test_colours_without_a_name_belong_to_the_nearest_structure(self) -> None:
        """Unity's ceilings: all pixels of the engine's ceilings, walls and floors stripped of their names."""
        embedded = EmbeddedSimulator(SimulatorConfig(width_px=60, height_px=60))
        start = embedded.reset(HOUSE)
        frame = embedded.render(replace(start, horizon_rad=-0.6), rgb=False)
        assert frame.instances is not None
        is_fixed = np.array([False] + [body.kind != "object" for body in embedded.objects])
        image = np.zeros((60, 60, 3), np.uint8)
        image[..., 0], image[..., 1] = frame.instances % 251, frame.instances // 251 + 1
        colours = {
            (index % 251, index // 251 + 1, 0): f"Mesh{index}" if is_fixed[index] else embedded.objects[index - 1].id
            for index in range(1, len(is_fixed))
        }
        event = SimpleNamespace(instance_segmentation_frame=image, color_to_object_id=colours)
        decoded = InstanceDecoder(embedded.objects).decode(event, frame)
        is_object = ~is_fixed[frame.instances]
        np.testing.assert_array_equal(decoded[is_object], frame.instances[is_object])
        assert is_fixed[decoded[~is_object & (frame.instances > 0)]].all()
        is_ceiling = np.array([False] + [body.kind == "ceiling" for body in embedded.objects])
        assert is_ceiling[frame.instances].sum() > 500
        assert is_ceiling[decoded[is_ceiling[frame.instances]]].mean() > 0.98
        np.testing.assert_array_equal(decoded == 0, np.isinf(frame.depth_m))

    def test_a_missing_object_is_reported(self) -> None:
        embedded = EmbeddedSimulator()
        embedded.reset(HOUSE)
        box = {"center": {"x": 1, "y": 2, "z": 3}, "size": {"x": 4, "y": 5, "z": 6}}
        records = [{"objectId": body.id, "axisAlignedBoundingBox": box} for body in embedded.objects]
        bodies = list(with_boxes(embedded.objects, records))
        assert {(b.centre_m, b.size_m) for b in bodies if b.kind == "object"} == {((1, 2, 3), (4, 5, 6))}
        assert [b for b in bodies if b.kind != "object"] == [b for b in embedded.objects if b.kind != "object"]
        gone = next(body.id for body in embedded.objects if body.kind == "object")
        with pytest.raises(SimulationError, match=f"lacks 1 objects.*{gone.replace('|', '.')}"):
            list(with_boxes(embedded.objects, [r for r in records if r["objectId"] != gone]))


def _event(x_m: float, z_m: float, yaw_deg: float, horizon_deg: float) -> Any:
    agent = {
        "position": {"x": float(x_m), "y": 0.9, "z": float(z_m)},
        "rotation": {"x": 0.0, "y": float(yaw_deg), "z": 0.0},
        "cameraHorizon": float(horizon_deg),
    }
    return SimpleNamespace(metadata={"agent": agent})
