"""Times operations of the version of evonav that it is started with; `benches.versions.version` asks for them.

It holds to names that both versions have, and gets its inputs in a file. Requests and answers are lines of JSON.
"""

import gc
import json
import math
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np

import evonav
from evonav.memory import ObjectMap, ObjectMapConfig, OccupancyMap
from evonav.sensors.observation import Detections, MapFrame, View, VisibleOccupancy
from evonav.sensors.visibility import visible_occupancy
from evonav.world.camera import CameraView
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, OccupancyGrid, SimulatorConfig

HAS_STYLES = hasattr(SimulatorConfig(), "style")
HAS_BODY_POSES = "camera_height_m" in View.__dataclass_fields__
"""In earlier versions a view has the pose of the body, and the height of its camera beside it."""


@dataclass
class Operation:
    """What is timed, with the number of an input."""

    call: Callable[[int], object]
    prepare: Callable[[int], object] = lambda _: None
    calls: int = 1
    """The fastest of these calls counts, the first of them aside; 1 for calls that change what they work on."""
    answer: Callable[[int], object] = lambda _: None
    """What both versions should find."""


class Probe:
    """Operations by name, made on demand."""

    def __init__(self, inputs: dict[str, Any]) -> None:
        self.inputs = inputs
        self.made: dict[tuple[str, ...], Operation] = {}

    def operation(self, name: str, *options: Any) -> Operation:  # noqa: ANN401 - of JSON
        """The operation, which is kept."""
        key = (name, *map(str, options))
        if key not in self.made:
            self.made[key] = getattr(self, name)(*options)
        return self.made[key]

    def simulators(self, config: SimulatorConfig) -> list[EmbeddedSimulator]:
        """One a house."""
        made = []
        for text in self.inputs["houses"].tolist():
            made.append(EmbeddedSimulator(config))
            made[-1].reset(text)
        return made

    def images(self, width_px: int, height_px: int, style: str | None) -> Operation:
        """Depth and instances, and colours in a style: `plain` is the only one of versions without styles."""
        size: dict[str, Any] = {"width_px": width_px, "height_px": height_px}
        if style is not None and HAS_STYLES:
            size["style"] = style
        config = SimulatorConfig(**size)
        simulators = self.simulators(config)
        camera = {"near_m": config.near_m, "far_m": config.far_m, "width_px": width_px, "height_px": height_px}
        views = []  # made beforehand, as the peer's matrices are
        for house, *place in self.inputs["views"].tolist():
            simulator = simulators[int(house)]
            pose = replace(Pose(*place), y_m=config.camera_height_m)
            fov_rad = simulator.intrinsics.vertical_fov_rad
            views.append((simulator, CameraView(pose, **camera, vertical_fov_rad=fov_rad)))

        def render(number: int) -> Any:  # noqa: ANN401 - its images
            simulator, view = views[number]
            return simulator.render_camera(view, rgb=style is not None)

        return Operation(render, calls=5, answer=lambda number: _digest(render(number).depth_m, 0.01))

    def path(self) -> Operation:
        """The first path in a house."""
        simulators, texts = self.simulators(SimulatorConfig()), self.inputs["houses"].tolist()
        houses, ends = self.inputs["pair_houses"].tolist(), self.inputs["pairs"].tolist()

        def path(number: int) -> Any:  # noqa: ANN401 - its corners
            start_m, target_m = map(tuple, ends[number])
            return simulators[houses[number]].shortest_path(start_m, target_m)

        names = map(str, count())  # a house of a known name would be used again, with its graph

        def load(number: int) -> None:
            simulators[houses[number]].reset(texts[houses[number]], name=next(names))

        def length_m(number: int) -> float:
            return round(float(np.linalg.norm(np.diff(path(number), axis=0), axis=1).sum()), 3)

        return Operation(path, load, answer=length_m)

    def distances(self) -> Operation:
        """Lengths of the paths to all reachable positions."""
        simulators = self.simulators(SimulatorConfig())
        houses, ends = self.inputs["pair_houses"].tolist(), self.inputs["pairs"].tolist()
        targets_m = [one.reachable_positions() for one in simulators]

        def lengths_m(number: int) -> Any:  # noqa: ANN401 - an array
            house = houses[number]
            return simulators[house].path_lengths_m(tuple(ends[number][0]), targets_m[house])

        return Operation(lengths_m, calls=4, answer=lambda number: _digest(lengths_m(number), 0.01))

    def floor(self) -> OccupancyMap:
        """A part of a floor as an agent that walked through it knows it."""
        cells = self.inputs["floor"]
        grid = OccupancyGrid(cells, 0.1, (0.0, 0.0))
        seen = OccupancyMap(MapFrame(*cells.shape, grid.cell_m, grid.corner_m))
        for x_m, z_m, yaw_rad in self.inputs["floor_views"].tolist():
            pose = Pose(x_m, 0.0, z_m, yaw_rad)
            seen.integrate(visible_occupancy(grid, pose, _intrinsics(300), 3.0), (x_m, z_m))
        return seen

    def frontiers(self) -> Operation:
        """Frontiers of the whole map."""
        seen, agent_m = self.floor(), tuple(self.inputs["floor_agent"].tolist())

        def update(_: int) -> Any:  # noqa: ANN401 - frontiers
            seen.clear_frontiers()
            return seen.update_frontiers(agent_m)

        return Operation(update, calls=5, answer=lambda number: sorted(len(one.cells) for one in update(number)))

    def next_frontiers(self) -> Operation:
        """Frontiers of the map after one view more, which follow those before it."""
        seen, agent_m = self.floor(), tuple(self.inputs["floor_agent"].tolist())
        cells = self.inputs["floor"]
        grid = OccupancyGrid(cells, 0.1, (0.0, 0.0))
        seen.update_frontiers(agent_m)

        def look(number: int) -> None:
            pose = Pose(agent_m[0], 0.0, agent_m[1], 2 * math.pi * number / 40)
            seen.integrate(visible_occupancy(grid, pose, _intrinsics(300), 3.0), agent_m)

        return Operation(lambda _: seen.update_frontiers(agent_m), look)

    def objects(self) -> Operation:
        """One view of 20 objects into a map of 100; each number has a map of its own."""
        looks, masks = self.inputs["box_depths"], self.inputs["box_masks"]
        poses, num_maps = self.inputs["box_poses"].tolist(), int(self.inputs["num_maps"])
        views = [_view(*one) for one in zip(poses, looks, masks, strict=True)]
        *before, view = views
        maps = [ObjectMap(ObjectMapConfig(max_distance_m=10.0, views_per_cleanup=0)) for _ in range(num_maps)]
        for one in maps:
            for earlier in before:
                one.update(earlier)
        return Operation(lambda number: maps[number].update(view), answer=lambda number: len(maps[number]))

    def vector(self, num_envs: int, num_steps: int, kind: str) -> Operation:
        """Steps of a vector environment with two threads, or of Gymnasium's (`sync`), until 200 have been made."""
        import gymnasium

        import evonav.gym  # noqa: F401 - it registers the environment

        observed = {"observations": ("depth", "pose", "category", "steps_left")}
        own: dict[str, Any] = {"vectorization_mode": "sync"} if kind == "sync" else {"num_threads": 2}
        envs = gymnasium.make_vec("evonav/LifelongNav-v0", num_envs=num_envs, **observed, **own)
        envs.reset(seed=0)

        def steps(number: int) -> None:
            random = np.random.default_rng(number)
            for _ in range(num_steps):
                envs.step(random.choice(4, p=(0.597, 0.199, 0.199, 0.005), size=num_envs))

        steps(0)
        return Operation(steps)

    def size(self) -> Operation:
        """The number of triangles of the houses."""
        counts = [len(one.triangles()[1]) for one in self.simulators(SimulatorConfig())]
        return Operation(lambda _: None, answer=lambda _: sum(counts))


def _intrinsics(side_px: int) -> Intrinsics:
    return Intrinsics(side_px, side_px, math.pi / 2)


def _view(pose: list[float], depth_m: Any, masks: Any) -> View:  # noqa: ANN401 - arrays
    x_m, y_m, z_m, yaw_rad, horizon_rad = pose
    num = int(masks.max()) + 1
    found = Detections(masks.astype(np.int32), ("Box",) * num, np.ones(num, np.float32))
    nothing = VisibleOccupancy(np.zeros((0, 2), np.int32), np.zeros((0, 2), np.int32))
    height: dict[str, Any] = {"camera_height_m": y_m} if HAS_BODY_POSES else {}
    camera = Pose(x_m, 0.0 if HAS_BODY_POSES else y_m, z_m, yaw_rad, horizon_rad)
    return View(camera, _intrinsics(len(depth_m)), depth_m, found, nothing, **height)


def _digest(values: Any, step: float) -> list[int]:  # noqa: ANN401 - an array
    """A hundred of the values, in steps."""
    some = np.asarray(values, np.float64).ravel()
    some = some[:: max(1, len(some) // 100)]
    return np.round(np.where(np.isfinite(some), some, -1.0) / step).astype(int).tolist()


def timed(operation: Operation, number: int) -> dict[str, float]:
    """CPU and wall time of a call, milliseconds, and the time of the fastest after the first."""
    operation.prepare(number)
    times = []
    for _ in range(operation.calls):
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        operation.call(number)
        times.append((1e3 * (time.process_time() - cpu_s), 1e3 * (time.perf_counter() - wall_s)))
    cpu_ms, wall_ms = min(times[1:] or times)
    return {"cpu_ms": cpu_ms, "wall_ms": wall_ms}


def main() -> None:
    """Answers until the parent is done."""
    answers, sys.stdout = sys.stdout, sys.stderr
    probe = Probe(dict(np.load(sys.argv[1], allow_pickle=False)))
    cores = os.sched_getaffinity(0)
    gc.disable()
    answers.write(json.dumps({"file": evonav.__file__}) + "\n")
    answers.flush()
    for line in sys.stdin:
        request = json.loads(line)
        # A vector environment has threads of its own; all else shares one core with the other version.
        os.sched_setaffinity(0, cores if request["operation"][0] == "vector" else {max(cores)})
        operation = probe.operation(*request["operation"])
        number = request["number"]
        found = {"answer": operation.answer(number)} if request["is_asked"] else timed(operation, number)
        answers.write(json.dumps(found) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
