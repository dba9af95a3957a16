"""Time an operation and its peers in turn on the same inputs, as CPU time of this process."""

import gc
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from pydantic import Field

from evonav.component import optional_module
from evonav.errors import InvalidArgumentError, StoreError
from evonav.report.measurements import MeasurementRecord
from evonav.statistics import ClusterBootstrap, Interval

NUM_RESAMPLES = 2000
INSTALL = "'evonav[bench]'"
MODULES = {
    "embreex": "embreex",
    "moderngl": "moderngl",
    "pyastar2d": "pyastar2d",
    "scikit-image": "skimage",
    "octomap": "octomap",
    "open3d": "open3d",
    "scipy": "scipy.sparse.csgraph",
}
"""Module of each peer that only some installations have, by the peer's name; other peers are always there."""


class Row(MeasurementRecord):
    """One operation, alone or compared with one peer."""

    operation: str
    ms: float = Field(ge=0, allow_inf_nan=False)
    """Median of our times."""
    ms_ci95: Interval | None = None
    """95% interval by house; `None` of fewer than two houses."""
    ms_by_house: dict[str, float] = Field(default_factory=dict)
    """Median of our times in each house."""
    n: int = Field(ge=1)
    """Number of measurements."""
    peer: str | None = None
    peer_ms: float | None = Field(default=None, ge=0, allow_inf_nan=False)
    """Median of the peer's times."""
    ratio: float | None = Field(default=None, ge=0, allow_inf_nan=False)
    """Median of the pairwise ratios peer / evonav: above 1 evonav is faster."""
    ratio_ci95: Interval | None = None
    facts: dict[str, float] = Field(default_factory=dict)
    """Other figures, by their name with its unit."""


OnProgress = Callable[[int, int, str], None]
"""Takes the number of measurements done, of all, and what is measured."""


@dataclass
class Sampling:
    """The things that a section measures, and how often."""

    limit: int | None = None
    """Number of houses; `None` for the section's own."""
    repeats: int = 1
    """Number of times that every input is measured."""
    peers: Sequence[str] | None = None
    """Peers to run, by name; `None` for all that are installed."""
    on_progress: OnProgress = lambda *_: None
    left_out: dict[str, str] = field(default_factory=dict)
    """Peers that were not run, with the reason; filled while the section runs."""

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            InvalidArgumentError: A number is less than 1.
        """
        for name, value in (("limit", self.limit), ("repeats", self.repeats)):
            if value is not None and value < 1:
                raise InvalidArgumentError(f"{name} = {value}: must be >= 1")

    def chosen(self, known: Sequence[str]) -> list[str]:
        """Return those of a section's peers that are to be run.

        Args:
            known: Peers of the section.

        Raises:
            InvalidArgumentError: A named peer is none of the section's.
            StoreError: A named peer is not installed.
        """
        for name in self.peers or ():
            if name not in known:
                raise InvalidArgumentError(f"no peer {name!r} here; there are {', '.join(known)}")
        chosen = []
        for name in known if self.peers is None else self.peers:
            try:
                if name in MODULES:
                    optional_module(MODULES[name], f"the peer {name} needs its library", INSTALL)
                chosen.append(name)
            except StoreError as error:
                if self.peers is not None:
                    raise
                self.left_out[name] = str(error)
        return chosen


def compare(
    operation: str,
    ours: Callable[[int], object],
    peers: Mapping[str, Callable[[int], object]],
    houses: Sequence[str],
    *,
    sampling: Sampling | None = None,
    calls: int = 1,
    prepare: Callable[[int], None] | None = None,
) -> list[Row]:
    """Time `ours` and the peers in turn, on inputs 0 to N - 1.

    A tenth of the inputs is run once before, as a warm-up.

    Args:
        operation: Name of the row, with its size.
        ours: Called with the input's number.
        peers: The same by others, by name.
        houses: `N` names, the house of each input; intervals are by house.
        sampling: Number of measurements of every input.
        calls: Number of calls of `ours` that make one measurement, where a single one is too short for the clock.
        prepare: Called with an input's number before it is measured; not timed.

    Returns:
        A row a peer; one without a peer if there is none.
    """
    sampling = sampling or Sampling()
    prepare = prepare or (lambda _: None)
    for number in range(max(1, len(houses) // 10)):
        prepare(number)
        for call in (ours, *peers.values()):
            call(number)
    order = [number for _ in range(sampling.repeats) for number in range(len(houses))]
    ours_ms: list[float] = []
    peers_ms: dict[str, list[float]] = {name: [] for name in peers}
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        for done, number in enumerate(order):
            prepare(number)
            ours_ms.append(cpu_ms(ours, number, calls))
            for name, call in peers.items():
                peers_ms[name].append(cpu_ms(call, number))
            sampling.on_progress(done + 1, len(order), operation)
    finally:
        if was_enabled:
            gc.enable()
    return rows_of(operation, ours_ms, peers_ms, [houses[number] for number in order])


def cpu_ms(call: Callable[[int], object], number: int, calls: int = 1) -> float:
    """Return the CPU time of one call in milliseconds, the mean of some."""
    start_s = time.process_time()
    for _ in range(calls):
        call(number)
    return 1e3 * (time.process_time() - start_s) / calls


def rows_of(
    operation: str,
    ours_ms: Sequence[float],
    peers_ms: Mapping[str, Sequence[float]],
    houses: Sequence[str],
    facts: Mapping[str, float] | None = None,
) -> list[Row]:
    """Return the rows of an operation from its measurements.

    Args:
        ours_ms: `(N,)` times.
        peers_ms: `(N,)` times of each peer on the same inputs.
        houses: `(N,)` names of houses.
        facts: Other figures of the row, by name with unit.
    """
    bootstrap = ClusterBootstrap(houses, num_resamples=NUM_RESAMPLES)

    least_ms = 1e-6  # no clock is finer, and a time of 0 has no ratio
    ours = bootstrap.median(ours_ms)
    by_house: dict[str, list[float]] = {}
    for house, time_ms in zip(houses, ours_ms, strict=True):
        by_house.setdefault(house, []).append(time_ms)
    alone = Row(
        operation=operation,
        ms=float(np.median(ours_ms)),
        ms_ci95=ours.ci95,
        ms_by_house={house: float(np.median(times_ms)) for house, times_ms in by_house.items()},
        n=len(ours_ms),
        facts=dict(facts or {}),
    )
    rows = []
    for name, times_ms in peers_ms.items():
        ratios = [peer / max(our, least_ms) for peer, our in zip(times_ms, ours_ms, strict=True)]
        ratio = bootstrap.median(ratios)
        compared = {"peer": name, "peer_ms": float(np.median(times_ms)), "ratio": ratio.value, "ratio_ci95": ratio.ci95}
        rows.append(alone.model_copy(update=compared))
    return rows or [alone]


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process on one core, where the system can; else peers with threads would be charged for all of them."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)
