"""Run workers of `evonav.parallel.pool` as Ray actors, on this machine or on a cluster whose nodes have evonav."""

import math
import os
import queue
import threading
import traceback
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from evonav.errors import InvalidArgumentError
from evonav.parallel.pool import (
    START_TIMEOUT_S,
    EngineError,
    Pulse,
    Resources,
    Worker,
    WorkerLostError,
    end_work,
    load_work,
    steps,
)

_END_TIMEOUT_S = 5.0


class RayHost:
    """Actors of a Ray cluster."""

    def __init__(self, work: str, settings: str, num_workers: int, address: str | None, resources: Resources) -> None:
        """Joins a cluster, or begins one on this machine, unless this process is in one.

        Args:
            work: As for `evonav.parallel.pool.open_pool`.
            settings: Likewise.
            num_workers: For which a cluster that is begun has CPUs.
            address: Of the cluster to join.
            resources: Of each worker.

        Raises:
            EngineError: Ray is not installed, or the cluster is not to be reached or has not enough for one worker.
            InvalidArgumentError: `resources` make no sense.
        """
        if not (resources.num_cpus > 0.0 and resources.num_gpus >= 0.0):
            raise InvalidArgumentError(f"{resources}: a worker needs a part of a CPU, and no less than no GPU")
        try:
            import ray
        except ImportError as error:
            raise EngineError(f"engine ray needs Ray: pip install 'evonav[ray]' ({error})") from None
        self._ray: Any = ray
        self._work, self._settings = work, settings
        self._has_begun = not ray.is_initialized()
        if self._has_begun:
            num_cpus = math.ceil(num_workers * resources.num_cpus)
            begin = {"num_cpus": num_cpus, "include_dashboard": False} if address is None else {"address": address}
            try:
                ray.init(**begin, log_to_driver=False, logging_level="ERROR")
            except (ConnectionError, RuntimeError, ValueError) as error:
                raise EngineError(f"Ray cannot be reached at {address or 'this machine'}: {error}") from error
        self.max_workers = self._most(resources)
        if self.max_workers < 1:
            self.close()
            needs = f"{resources.num_cpus:g} CPU" + (f", {resources.num_gpus:g} GPU" if resources.num_gpus else "")
            raise EngineError(f"the Ray cluster has not enough for a worker ({needs})")
        options = {"num_cpus": resources.num_cpus, "num_gpus": resources.num_gpus, "max_restarts": 0}
        self._actor = ray.remote(**options)(_Actor)

    def _most(self, resources: Resources) -> int:
        """Workers that the cluster has room for."""
        there: dict[str, float] = self._ray.cluster_resources()
        asked = {"CPU": resources.num_cpus, "GPU": resources.num_gpus}
        return min(math.floor(there.get(name, 0.0) / amount) for name, amount in asked.items() if amount)

    def start(self) -> "RayWorker":
        """Another actor."""
        return RayWorker(self._ray, self._actor.remote(self._work, self._settings))

    def wait(self, workers: Sequence[Worker], timeout_s: float) -> Sequence[Worker]:
        """Those with something to receive."""
        news = {worker.news: worker for worker in workers if isinstance(worker, RayWorker)}
        ready, _ = self._ray.wait(list(news), num_returns=1, timeout=timeout_s)
        if ready:
            ready, _ = self._ray.wait(list(news), num_returns=len(news), timeout=0)
        return [news[one] for one in ready]

    def close(self) -> None:
        """Leaves the cluster, if it was this that joined it."""
        if self._has_begun:
            self._ray.shutdown()


class RayWorker:
    """The pool's side of an actor."""

    def __init__(self, ray: Any, actor: Any) -> None:  # noqa: ANN401 - Ray is not imported here
        """Asks it to say when it is ready."""
        self._ray, self._actor = ray, actor
        self._is_idle = False
        self.news: Any = actor.next.remote()

    def send(self, text: str) -> None:
        """Gives it a job."""
        self._is_idle = False
        self._actor.begin.remote(text)
        self.news = self._actor.next.remote()

    def receive(self) -> tuple[str, str]:
        """What it says next."""
        try:
            kind, text = self._ray.get(self.news, timeout=START_TIMEOUT_S)
        except self._ray.exceptions.RayError as error:
            raise WorkerLostError(f"the Ray actor died ({type(error).__name__})") from None
        self._is_idle = kind not in ("alive", "news")
        if not self._is_idle:
            self.news = self._actor.next.remote()
        return kind, text

    def close(self) -> None:
        """Ends it: one that is idle may give back what it holds."""
        with suppress(self._ray.exceptions.RayError):
            if self._is_idle:
                self._is_idle = False
                self._ray.get(self._actor.end.remote(), timeout=_END_TIMEOUT_S)
            self._ray.kill(self._actor)


class _Actor:
    """A worker's life, in Ray's hands. Its jobs are done in one thread, while calls fetch what they say."""

    def __init__(self, work: str, settings: str) -> None:
        for name in ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
            os.environ.setdefault(name, "1")
        self._jobs: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._said: queue.SimpleQueue[tuple[str, str]] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._serve, args=(work, settings), daemon=True)
        self._thread.start()

    def begin(self, text: str) -> None:
        self._jobs.put(text)

    def next(self) -> tuple[str, str]:
        return self._said.get()

    def end(self) -> None:
        self._jobs.put(None)
        self._thread.join(_END_TIMEOUT_S)

    def _serve(self, name: str, settings: str) -> None:
        try:
            work = load_work(name, settings, Pulse(lambda: self._said.put(("alive", ""))))
        except Exception:
            self._said.put(("broken", traceback.format_exc()))
            return
        try:
            self._said.put(("ready", ""))
            while (text := self._jobs.get()) is not None:
                for step in steps(work, text):
                    self._said.put(step)
            end_work(work)
        except BaseException:  # a job that ends its process ends it here too
            os._exit(1)
