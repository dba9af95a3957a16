"""Run workers of `evonav.parallel.pool` as Ray actors, on this machine or on a cluster whose nodes have evonav."""

import math
import os
import queue
import threading
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from evonav.parallel.local import END_TIMEOUT_S, THREAD_VARIABLES
from evonav.parallel.worker import START_TIMEOUT_S, EngineError, Message, Worker, WorkerLostError, Workforce, serve


class RayHost:
    """Starts actors of a Ray cluster."""

    def __init__(self, work: str, settings: str, workforce: Workforce) -> None:
        """Join a cluster, or start one on this machine, unless this process is already in one.

        Args:
            work: `module:factory`, see `evonav.parallel.pool.open_pool`.
            workforce: The address of the cluster to join, and what is reserved for each worker. A cluster that is
                started here has CPUs for all workers.

        Raises:
            EngineError: Ray is not installed, or the cluster cannot be reached or has too little for one worker.
        """
        num_gpus, address = workforce.num_gpus, workforce.ray_address
        try:
            import ray
        except ImportError as error:
            raise EngineError(f"engine ray needs Ray: pip install 'evonav[ray]' ({error})") from None
        self._ray: Any = ray
        self._arguments = (work, settings, workforce.jobs_at_once > 1)
        self._is_owner = not ray.is_initialized()
        if self._is_owner:
            here = {"num_cpus": workforce.num_workers, "include_dashboard": False}
            cluster = here if address is None else {"address": address}
            try:
                ray.init(**cluster, log_to_driver=False, logging_level="ERROR")
            except (ConnectionError, RuntimeError, ValueError) as error:
                raise EngineError(f"Ray cannot be reached at {address or 'this machine'}: {error}") from error
        self.max_workers = self._room_for({"CPU": 1, "GPU": num_gpus})
        if self.max_workers < 1:
            self.close()
            needs = "1 CPU" + (f", {num_gpus:g} GPU" if num_gpus else "")
            raise EngineError(f"the Ray cluster has too little for one worker ({needs})")
        # A message is always waited for, while jobs are begun.
        self._actor = ray.remote(num_cpus=1, num_gpus=num_gpus, max_restarts=0, max_concurrency=3)(_Actor)

    def _room_for(self, needed: dict[str, float]) -> int:
        """Return how many workers with these needs fit into the cluster."""
        available: dict[str, float] = self._ray.cluster_resources()
        return min(math.floor(available.get(name, 0.0) / amount) for name, amount in needed.items() if amount)

    def start(self) -> "RayWorker":
        """Start another actor."""
        return RayWorker(self._ray, self._actor.remote(*self._arguments))

    def wait(self, workers: Sequence[Worker], timeout_s: float) -> Sequence[Worker]:
        """Wait until a worker has a message, and return all that have one."""
        messages = {worker.message: worker for worker in workers if isinstance(worker, RayWorker)}
        ready, _ = self._ray.wait(list(messages), num_returns=1, timeout=timeout_s)
        if ready:
            ready, _ = self._ray.wait(list(messages), num_returns=len(messages), timeout=0)
        return [messages[one] for one in ready]

    def close(self) -> None:
        """Leave the cluster, if this host joined or started it."""
        if self._is_owner:
            self._ray.shutdown()


class RayWorker:
    """The pool's side of an actor."""

    def __init__(self, ray: Any, actor: Any) -> None:  # noqa: ANN401 - Ray is not imported here
        """Ask the actor for its first message."""
        self._ray, self._actor = ray, actor
        self._num_open: int | None = None
        """Number of its jobs; `None` before it is ready, and after it is closed."""
        self.message: Any = actor.next.remote()

    def send(self, key: int, text: str) -> None:
        """Send a job."""
        self._num_open = (self._num_open or 0) + 1
        self._actor.begin.remote(key, text)

    def receive(self) -> Message:
        """Return the next message."""
        try:
            message: Message = self._ray.get(self.message, timeout=START_TIMEOUT_S)
        except self._ray.exceptions.RayError as error:
            raise WorkerLostError(f"the Ray actor died ({type(error).__name__})") from None
        if message.kind not in ("alive", "progress"):
            self._num_open = 0 if self._num_open is None else self._num_open - 1
        self.message = self._actor.next.remote()
        return message

    def close(self) -> None:
        """End the actor; an idle one closes its work first."""
        with suppress(self._ray.exceptions.RayError):
            if self._num_open == 0:
                self._num_open = None
                self._ray.get(self._actor.end.remote(), timeout=END_TIMEOUT_S)
            self._ray.kill(self._actor)


class _Actor:
    """An actor that runs jobs in threads of its own, while calls fetch their messages."""

    def __init__(self, work: str, settings: str, has_threads: bool) -> None:
        for name in THREAD_VARIABLES:
            os.environ.setdefault(name, "1")
        self._jobs: queue.SimpleQueue[tuple[int, str] | None] = queue.SimpleQueue()
        self._messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._serve, args=(work, settings, has_threads), daemon=True)
        self._thread.start()

    def begin(self, key: int, text: str) -> None:
        self._jobs.put((key, text))

    def next(self) -> Message:
        return self._messages.get()

    def end(self) -> None:
        self._jobs.put(None)
        self._thread.join(END_TIMEOUT_S)

    def _serve(self, name: str, settings: str, has_threads: bool) -> None:
        jobs = iter(self._jobs.get, None)
        try:
            serve(name, settings, jobs, self._messages.put, has_threads=has_threads)
        except BaseException:  # a job that ends its process also ends the actor
            os._exit(1)
