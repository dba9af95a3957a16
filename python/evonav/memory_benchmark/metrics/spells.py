"""Follow changes: how long a memory takes to correct itself after each, and the half-life of that, with censoring."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evonav.evaluation.episode.staleness import STALE_MARGIN_M, distance_to_box_m
from evonav.memory_benchmark.metrics.counts import PlaceKey
from evonav.memory_benchmark.truth import TrueChange

SpellKind = Literal["evident", "unseen", "appeared"]
"""Kind of correction that a spell waits for.

`evident`: for the removal of a stale entry, from the first evidence that its place is empty. `unseen`: the same from
the change on, as long as there is no evidence. `appeared`: for an entry of an object that moved or was added, from the
first evidence of it at its new place.
"""
Clock = Literal["frames", "evidence_frames", "seconds", "metres"]


@dataclass(frozen=True, slots=True)
class Clocks:
    """Frames, time and path since the stream began; what lies between two visits is left out."""

    frames: int
    seconds: float
    metres: float
    """Length of the camera's path on the ground plane."""
    evidence_frames: int = 0
    """Frames with evidence of the change in question."""

    def since(self, start: "Clocks") -> "Clocks":
        """Return what has passed since another reading."""
        return Clocks(
            self.frames - start.frames,
            self.seconds - start.seconds,
            self.metres - start.metres,
            self.evidence_frames - start.evidence_frames,
        )


@dataclass(frozen=True, slots=True)
class Spell:
    """A time that a memory took to correct itself, or the time for which it was watched in vain."""

    kind: SpellKind
    change: int
    """Index of the change in the stream."""
    lasted: Clocks
    """0 frames if the answer after the first frame was right already; `evidence_frames` counts that frame, too."""
    is_over: bool
    """False if the correction was not seen: the spell is censored."""


def kaplan_meier(
    durations: NDArray[np.float64], is_over: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimate a survival curve from spells of which some were not watched to their end.

    Source: Kaplan & Meier, "Nonparametric Estimation from Incomplete Observations", JASA 1958. A spell that is censored
    at a duration counts as at risk there.

    Args:
        durations: `(N,)`.
        is_over: `(N,)` false for a censored spell.

    Returns:
        `(T,)` different durations with an end, ascending, and the share that lasts longer than each.
    """
    ends, at_risk, over = risk_table(durations, is_over)
    return ends, survival(at_risk.sum(axis=0), over.sum(axis=0))


def risk_table(
    durations: NDArray[np.float64], is_over: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return what the estimate needs of each spell; sums over spells may be weighted.

    Returns:
        `(T,)` different durations with an end; `(N, T)` whether a spell is at risk there, and whether it ends there.
    """
    ends = np.unique(durations[is_over])
    at_risk = (durations[:, None] >= ends).astype(np.float64)
    over = ((durations[:, None] == ends) & is_over[:, None]).astype(np.float64)
    return ends, at_risk, over


def survival(at_risk: NDArray[np.float64], over: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the shares that last longer, of sums of a `risk_table`, `(..., T)`."""
    left = 1.0 - np.divide(over, at_risk, out=np.zeros_like(over), where=at_risk > 0)
    shares: NDArray[np.float64] = np.cumprod(left, axis=-1, dtype=np.float64)
    return shares


def half_life(ends: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the first duration after which at most half are left; infinite if more than half are left at the end.

    Args:
        ends: `(T,)` durations.
        shares: `(..., T)` share that lasts longer.
    """
    if ends.size == 0:
        return np.full(shares.shape[:-1], math.inf)
    is_half = shares <= 0.5 + 1e-12
    return np.where(is_half.any(axis=-1), ends[np.argmax(is_half, axis=-1)], math.inf)


def durations_of(
    spells: Sequence[Spell], kind: SpellKind, clock: Clock
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the durations of all spells of a kind by one clock, and whether each is over."""
    chosen = [spell for spell in spells if spell.kind == kind]
    durations = np.array([float(getattr(spell.lasted, clock)) for spell in chosen], np.float64)
    return durations, np.array([spell.is_over for spell in chosen], np.bool_)


@dataclass(slots=True)
class _Wait:
    """A wait for a state; it counts from the first evidence on."""

    must_stay: bool
    """Whether a state that is lost again was not reached: an entry that comes back was not cleared."""
    start: Clocks | None = None
    evidence_frames: int = 0
    done: Clocks | None = None
    last: Clocks | None = None

    def look(self, now: Clocks) -> None:
        self.evidence_frames += 1
        if self.start is None:
            self.start = replace(now, evidence_frames=0)

    def answer(self, now: Clocks, is_done: bool) -> None:
        now = self.last = Clocks(now.frames, now.seconds, now.metres, self.evidence_frames)
        if is_done:
            self.done = self.done or now
        elif self.must_stay:
            self.done = None


@dataclass(slots=True)
class TrackedChange:
    """A change that has happened."""

    index: int
    """Index in the stream."""
    change: TrueChange
    began: Clocks
    """Clocks at its first frame."""
    num_before: int
    """Changes of the same object before it."""
    is_remembered: bool
    """Whether the memory had an entry at the place that the object left, which no other of its label covers now."""
    is_open: bool
    """False once the old place is covered again: nothing there is stale from then on."""
    is_current: bool = True
    """False once the object has changed again."""
    is_removal_judged: bool = False
    is_arrival_judged: bool = False
    is_move_judged: bool = False
    empty: _Wait = field(default_factory=lambda: _Wait(must_stay=True))
    """The wait for the removal of the stale entry."""
    found: _Wait = field(default_factory=lambda: _Wait(must_stay=False))
    """The wait for an entry at the new place."""
    old_key: PlaceKey | None = field(init=False, default=None)
    """The place that the object left; `None` if it was added."""
    new_key: PlaceKey | None = field(init=False, default=None)
    """The place that it came to; `None` if it was removed, or an entry at its old place is still right."""

    def __post_init__(self) -> None:
        before, after = self.change.before, self.change.after
        if before is not None:
            self.old_key = (self.change.object_id, self.num_before)
        if after is not None and (before is None or distance_to_box_m(before.centre_m, after) > STALE_MARGIN_M):
            self.new_key = (self.change.object_id, self.num_before + 1)

    @property
    def is_evident(self) -> bool:
        """True once the old place was seen empty."""
        return self.empty.start is not None

    @property
    def is_seen(self) -> bool:
        """True once the object was seen at its new place."""
        return self.found.start is not None

    def spells(self) -> list[Spell]:
        """Return the spells of this change, as far as they were watched."""
        spells = []
        start, done, last = self.empty.start, self.empty.done, self.empty.last
        if self.is_remembered and last is not None:
            end = done or last
            is_unseen = start is None or (done is not None and done.frames < start.frames)
            if start is None or is_unseen:
                spells.append(Spell("unseen", self.index, _unseen(end, self.began), done is not None))
            else:
                spells.append(Spell("unseen", self.index, _unseen(start, self.began), is_over=False))
                spells.append(Spell("evident", self.index, end.since(start), done is not None))
        if (start := self.found.start) is not None and self.found.last is not None:
            end = self.found.done or self.found.last
            # An entry at the new place before its first evidence, of a few pixels or by a guess, took no time.
            lasted = end.since(start) if end.frames >= start.frames else Clocks(0, 0.0, 0.0)
            spells.append(Spell("appeared", self.index, lasted, self.found.done is not None))
        return spells


def _unseen(end: Clocks, start: Clocks) -> Clocks:
    return replace(end, evidence_frames=0).since(start)
