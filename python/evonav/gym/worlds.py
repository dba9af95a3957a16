"""Build the houses of the stages of tasks in advance, on a background thread."""

import copy
from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.errors import SimulationError
from evonav.evaluation.episode.motion import Planner
from evonav.gym.config import NavConfig
from evonav.gym.sources import TaskSource
from evonav.gym.spaces import body_labels
from evonav.tasks.manifest import Task
from evonav.world.appearance import Change
from evonav.world.embedded import EmbeddedSimulator

BYTES_PER_HOUSE_BYTE = 40
"""Memory of a built house, paths included, per byte of its JSON: 35 to 36 in 196 houses of 1.2 to 1.4 MB each."""


@dataclass(frozen=True, slots=True)
class World:
    """A stage's house. It does not change, so agents may share it."""

    simulator: EmbeddedSimulator
    """A simulator whose agent must not move; `entered` returns one for an agent."""
    labels: NDArray[np.uint8] | None
    """Labels of the bodies, if they are observed."""
    num_bytes: int

    def entered(self, look: Sequence[Change] = ()) -> EmbeddedSimulator:
        """Return a simulator of the same house with a pose and a look of its own."""
        simulator = copy.copy(self.simulator)
        if look:
            simulator.set_appearance(look)
        return simulator


@dataclass(frozen=True, slots=True)
class StageWorld:
    """A stage of a task, and its house."""

    task: Task
    stage: int
    world: World

    @property
    def target_m(self) -> tuple[float, float]:
        """The target's `(x, z)`: oracle data."""
        x_m, _, z_m = self.task.oracle(self.stage).target.position_m
        return (x_m, z_m)

    def reference_path_m(
        self, simulator: EmbeddedSimulator, path_m: list[tuple[float, float]]
    ) -> list[tuple[float, float]]:
        """Return the evaluator's path to the target, from one to the nearest free point of the house: oracle data."""
        room_id = self.task.oracle(self.stage).target.room_id
        return Planner(simulator).into_room_m(path_m, self.target_m, simulator.core, room_id)


class WorldLoader:
    """Reads tasks and builds houses on one background thread; the same house is built once."""

    def __init__(self, source: TaskSource, config: NavConfig, max_bytes: int) -> None:
        """Make a loader.

        Args:
            config: Configuration of the camera.
            max_bytes: Approximate memory for houses without an agent.
        """
        self.source, self._config, self._max_bytes = source, config, max_bytes
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="evonav-houses")
        self._wanted: dict[tuple[int, int], Future[StageWorld]] = {}
        self._built: OrderedDict[str, World] = OrderedDict()
        self.num_built = 0
        """Number of houses built so far."""

    def prefetch(self, number: int, stage: int) -> None:
        """Start preparing a stage of a task."""
        if (number, stage) not in self._wanted:
            self._wanted[number, stage] = self._thread.submit(self._make, number, stage)

    def get(self, number: int, stage: int) -> StageWorld:
        """Return a stage of a task; wait until it is ready.

        Raises:
            TaskError: The task is malformed.
            HouseError: The stage's house is malformed or contains an unknown asset.
            SimulationError: The agent fits nowhere in the house.
        """
        self.prefetch(number, stage)
        return self._wanted.pop((number, stage)).result()

    def forget(self) -> None:
        """Discard requests that were not fetched; built houses stay."""
        for future in self._wanted.values():
            future.cancel()
        self._wanted.clear()

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown(wait=True, cancel_futures=True)

    def _make(self, number: int, stage: int) -> StageWorld:
        task = self.source.task(number)
        if stage > task.num_stages:
            raise SimulationError(f"task {task.task_id} has {task.num_stages} stages, not {stage}")
        digest = task.oracle(stage).house_sha256
        world = self._built.pop(digest, None) or self._build(task.task_id, task.house_json(stage))
        self._built[digest] = world
        while len(self._built) > 1 and sum(built.num_bytes for built in self._built.values()) > self._max_bytes:
            self._built.popitem(last=False)
        return StageWorld(task, stage, world)

    def _build(self, name: str, house_json: str) -> World:
        simulator = EmbeddedSimulator(self._config.simulator, allow_unknown_assets=self._config.allow_unknown_assets)
        start = simulator.reset(house_json, name=name)
        # Finds all edges of the house's visibility graph, which later paths and distances use.
        _core.GeodesicField(simulator.core, (start.x_m, start.z_m))
        self.num_built += 1
        labels = body_labels(simulator.core.bodies()) if self._config.has("semantic") else None
        return World(simulator, labels, BYTES_PER_HOUSE_BYTE * len(house_json))
