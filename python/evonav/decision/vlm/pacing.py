"""Respect a server's limits before it complains: requests and tokens a minute, evenly spread."""

import threading
import time
from collections.abc import Callable


class Pace:
    """Delays questions so that they begin no faster than the limits allow. Any number of threads may use one.

    Each question moves the earliest start of the next one on by its share of a minute, so there is no burst that a
    server with another idea of where minutes begin could object to. `Retry-After` is the client's business.
    """

    def __init__(
        self,
        requests_per_minute: float | None = None,
        tokens_per_minute: float | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Set the limits; `None` is no limit."""
        self._s_a_request = 60.0 / requests_per_minute if requests_per_minute else 0.0
        self._s_a_token = 60.0 / tokens_per_minute if tokens_per_minute else 0.0
        self._clock = clock
        self._sleep = sleep
        self._lock = threading.Lock()
        self._next_s = 0.0

    def wait(self, num_tokens: int) -> None:
        """Wait until a question of a number of tokens may begin."""
        share_s = max(self._s_a_request, self._s_a_token * num_tokens)
        if share_s == 0.0:
            return
        with self._lock:
            now_s = self._clock()
            begin_s = max(now_s, self._next_s)
            self._next_s = begin_s + share_s
        if begin_s > now_s:
            self._sleep(begin_s - now_s)
