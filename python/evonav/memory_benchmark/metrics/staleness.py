"""Durations until a memory corrects itself, and their half-life with censoring."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

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


@dataclass(frozen=True, slots=True)
class Survival:
    """A survival curve: the share of spells that last longer than each duration."""

    durations: NDArray[np.float64]
    """`(T,)` different durations with an end, ascending."""
    shares: NDArray[np.float64]
    """`(..., T)` share that lasts longer."""

    @property
    def half_life(self) -> NDArray[np.float64]:
        """`(...)` first duration after which at most half are left; infinite if more than half are left at the end."""
        is_half = self.shares <= 0.5 + 1e-12
        if self.durations.size == 0:
            return np.full(self.shares.shape[:-1], math.inf)
        first: NDArray[np.float64] = self.durations[np.argmax(is_half, axis=-1)]
        return np.where(is_half.any(axis=-1), first, math.inf)


def kaplan_meier(durations: NDArray[np.float64], is_over: NDArray[np.bool_]) -> Survival:
    """Estimate a survival curve from spells of which some were not watched to their end.

    Source: Kaplan & Meier, "Nonparametric Estimation from Incomplete Observations", JASA 1958. A spell that is censored
    at a duration counts as at risk there.

    Args:
        durations: `(N,)`.
        is_over: `(N,)` false for a censored spell.
    """
    ends, at_risk, over = risk_table(durations, is_over)
    return survival(ends, at_risk.sum(axis=0), over.sum(axis=0))


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


def survival(ends: NDArray[np.float64], at_risk: NDArray[np.float64], over: NDArray[np.float64]) -> Survival:
    """Return the curve of sums of a `risk_table`, `(..., T)`."""
    left = 1.0 - np.divide(over, at_risk, out=np.zeros_like(over), where=at_risk > 0)
    shares: NDArray[np.float64] = np.cumprod(left, axis=-1, dtype=np.float64)
    return Survival(ends, shares)


def durations_of(
    spells: Sequence[Spell], kind: SpellKind, clock: Clock
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the durations of all spells of a kind by one clock, and whether each is over."""
    chosen = [spell for spell in spells if spell.kind == kind]
    durations = np.array([float(getattr(spell.lasted, clock)) for spell in chosen], np.float64)
    return durations, np.array([spell.is_over for spell in chosen], np.bool_)
