"""Follow one change: what was seen of it, and since when the memory shows it."""

from dataclasses import dataclass, replace

from evonav.evaluation.episode.staleness import STALE_MARGIN_M, distance_to_box_m
from evonav.memory_benchmark.metrics.staleness import Clocks, Spell
from evonav.memory_benchmark.metrics.updates import PlaceKey
from evonav.memory_benchmark.truth import TrueChange


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
    old_key: PlaceKey | None
    """The place that the object left; `None` if it was added."""
    new_key: PlaceKey | None
    """The place that it came to; `None` if it was removed, or an entry at its old place is still right."""
    is_remembered: bool
    """Whether the memory had an entry at the place that the object left, which no other of its label covers now."""
    empty: _Wait
    """The wait for the removal of the stale entry."""
    found: _Wait
    """The wait for an entry at the new place."""
    is_open: bool = True
    """False once the old place is covered again: nothing there is stale from then on."""
    is_current: bool = True
    """False once the object has changed again."""
    is_removal_judged: bool = False
    is_arrival_judged: bool = False
    is_move_judged: bool = False

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
                spells.append(Spell("unseen", self.index, _until(end, self.began), done is not None))
            else:
                spells.append(Spell("unseen", self.index, _until(start, self.began), is_over=False))
                spells.append(Spell("evident", self.index, end.since(start), done is not None))
        if (start := self.found.start) is not None and self.found.last is not None:
            end = self.found.done or self.found.last
            # An entry at the new place before its first evidence, of a few pixels or by a guess, took no time.
            lasted = end.since(start) if end.frames >= start.frames else Clocks(0, 0.0, 0.0)
            spells.append(Spell("appeared", self.index, lasted, self.found.done is not None))
        return spells


def _until(end: Clocks, start: Clocks) -> Clocks:
    return replace(end, evidence_frames=0).since(start)


def tracked(index: int, change: TrueChange, began: Clocks, num_before: int, *, is_remembered: bool) -> TrackedChange:
    """Begin to follow a change.

    Args:
        began: Clocks at its first frame.
        num_before: Changes of the same object before it.
        is_remembered: See `TrackedChange.is_remembered`.
    """
    return TrackedChange(
        index=index,
        change=change,
        began=began,
        old_key=None if change.before is None else (change.object_id, num_before),
        new_key=(change.object_id, num_before + 1) if _is_elsewhere(change) else None,
        is_remembered=is_remembered,
        empty=_Wait(must_stay=True),
        found=_Wait(must_stay=False),
    )


def _is_elsewhere(change: TrueChange) -> bool:
    """Return whether the object stands somewhere now where an entry of its old place is not right."""
    if change.after is None:
        return False
    return change.before is None or distance_to_box_m(change.before.centre_m, change.after) > STALE_MARGIN_M
