"""Workers of `evonav.parallel` as Ray actors: on this machine, or on a cluster whose nodes have evonav installed."""

import math
import os
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from evonav.parallel import START_TIMEOUT_S, EngineError, Worker, WorkerLostError, do, load_work


class RayHost:
    """Actors of a Ray cluster, one CPU each."""

    def __init__(self, work: str, settings: str, num_workers: int, address: str | None) -> None:
        """Joins a cluster, or begins one on this machine, unless this process is in one.

        Args:
            work: As for `evonav.parallel.open_pool`.
            settings: Likewise.
            num_workers: CPUs of a cluster that is begun.
            address: Of the cluster to join.

        Raises:
            EngineError: Ray is not installed, or the cluster is not to be reached or has no CPU.
        """
        try:
            import ray
        except ImportError as error:
            raise EngineError(f"engine ray needs Ray: pip install 'evonav[ray]' ({error})") from None
        self._ray: Any = ray
        self._work, self._settings = work, settings
        self._has_begun = not ray.is_initialized()
        if self._has_begun:
            begin = {"num_cpus": num_workers, "include_dashboard": False} if address is None else {"address": address}
            try:
                ray.init(**begin, log_to_driver=False, logging_level="ERROR")
            except (ConnectionError, RuntimeError, ValueError) as error:
                raise EngineError(f"Ray cannot be reached at {address or 'this machine'}: {error}") from error
        self.max_workers = math.floor(ray.cluster_resources().get("CPU", 0))
        if self.max_workers < 1:
            self.close()
            raise EngineError("the Ray cluster has no CPU")
        self._actor = ray.remote(num_cpus=1, max_restarts=0)(_Actor)

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
        self.news: Any = actor.ready.remote()

    def send(self, text: str) -> None:
        """Gives it a job."""
        self.news = self._actor.do.remote(text)

    def receive(self) -> tuple[str, str]:
        """What it says next."""
        try:
            kind, text = self._ray.get(self.news, timeout=START_TIMEOUT_S)
        except self._ray.exceptions.RayError as error:
            raise WorkerLostError(f"the Ray actor died ({type(error).__name__})") from None
        return kind, text

    def close(self) -> None:
        """Ends it at once."""
        with suppress(self._ray.exceptions.RayError):
            self._ray.kill(self._actor)


class _Actor:
    """A worker's life, in Ray's hands."""

    def __init__(self, work: str, settings: str) -> None:
        for name in ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
            os.environ.setdefault(name, "1")
        self._function = load_work(work, settings)

    def ready(self) -> tuple[str, str]:
        return "ready", ""

    def do(self, text: str) -> tuple[str, str]:
        return do(self._function, text)
