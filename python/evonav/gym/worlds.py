"""Houses of stages, built before they are needed on a thread of their own, and kept while memory allows."""

import copy
from collections import OrderedDict
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.errors import SimulationError
from evonav.gym.config import NavConfig
from evonav.gym.source import NavTask, StageTask, TaskSource
from evonav.gym.spaces import body_labels
from evonav.world.embedded import EmbeddedSimulator

BYTES_PER_HOUSE_BYTE = 40
"""Memory of a built house, paths included, by the length of its JSON: 35 to 36 in 196 houses, 1.2 to 1.4 MB each."""


@dataclass(frozen=True, slots=True)
class World:
    """A stage's house. What it holds does not change, so agents may share it."""

    simulator: EmbeddedSimulator
    """Not to be moved in: `entered` gives one that may be."""
    labels: NDArray[np.uint8]
    num_bytes: int

    def entered(self) -> EmbeddedSimulator:
        """A simulator of the same house, with a pose of its own."""
        return copy.copy(self.simulator)


@dataclass(frozen=True, slots=True)
class StageWorld:
    """All that a stage begins with."""

    task: NavTask
    stage: int
    world: World

    @property
    def data(self) -> StageTask:
        """The stage itself."""
        return self.task.stages[self.stage - 1]


class WorldLoader:
    """Reads tasks and builds houses on one background thread; the same house is built once."""

    def __init__(self, source: TaskSource, config: NavConfig, max_bytes: int) -> None:
        """A loader.

        Args:
            source: Of tasks.
            config: Of the camera.
            max_bytes: Memory that houses which no agent is in may take, about.
        """
        self.source, self._config, self._max_bytes = source, config, max_bytes
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="evonav-houses")
        self._wanted: dict[tuple[int, int], Future[StageWorld]] = {}
        self._built: OrderedDict[str, World] = OrderedDict()
        self.num_built = 0
        """Houses built so far."""

    def prefetch(self, number: int, stage: int) -> None:
        """Has a stage of a task made ready."""
        if (number, stage) not in self._wanted:
            self._wanted[number, stage] = self._thread.submit(self._make, number, stage)

    def get(self, number: int, stage: int) -> StageWorld:
        """A stage of a task; waits for it if it is not ready.

        Raises:
            TaskError: The task is malformed.
            HouseError: The stage's house is malformed or holds an unknown asset.
            SimulationError: The agent fits nowhere in it.
        """
        self.prefetch(number, stage)
        return self._wanted.pop((number, stage)).result()

    def forget(self) -> None:
        """Gives up what was asked for and not fetched; houses that were built stay."""
        for future in self._wanted.values():
            future.cancel()
        self._wanted.clear()

    def close(self) -> None:
        """Ends the thread."""
        self._thread.shutdown(wait=True, cancel_futures=True)

    def _make(self, number: int, stage: int) -> StageWorld:
        task = self.source.task(number)
        if stage > len(task.stages):
            raise SimulationError(f"task {task.task_id} has {len(task.stages)} stages, not {stage}")
        data = task.stages[stage - 1]
        world = self._built.pop(data.house_sha256, None) or self._build(task, data)
        self._built[data.house_sha256] = world
        while len(self._built) > 1 and sum(kept.num_bytes for kept in self._built.values()) > self._max_bytes:
            self._built.popitem(last=False)
        return StageWorld(task, stage, world)

    def _build(self, task: NavTask, data: StageTask) -> World:
        simulator = EmbeddedSimulator(self._config.simulator, allow_unknown_assets=self._config.allow_unknown_assets)
        start = simulator.reset(data.house_json, name=task.task_id)
        # Finds every edge of the house's visibility graph, which paths and distances then use.
        _core.GeodesicField(simulator.core, (start.x_m, start.z_m))
        self.num_built += 1
        labels = body_labels(simulator.core.bodies())
        return World(simulator, labels, BYTES_PER_HOUSE_BYTE * len(data.house_json))
