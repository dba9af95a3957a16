"""Frontier-Update that hides objects of which rays say that they are gone: Khronos (Schmid et al., RSS 2024).

Rays vote for the presence and the absence of each object, before and after it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from evonav.agents.agent import EntryBelief
from evonav.agents.explanation import entry_belief
from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.navigator import Navigator
from evonav.memory.forgetting.rule import EntryStates, detected_ids
from evonav.memory.objects import ObjectEntry, ObjectMap, ObjectUpdate
from evonav.memory.presence import EvidenceConfig
from evonav.sensors.observation import Detections, Observation, View, VisibleOccupancy
from evonav.world.camera import thinned


@dataclass(frozen=True, slots=True)
class KhronosConfig(FrontierUpdateConfig):
    """Frontier-Update's values, and Khronos' constants; its bins have 5 s, and here a bin is a decision round."""

    window: int = 5
    """Number of bins, from one on, whose votes are added."""
    absent_share: float = 0.6
    """An object is absent from the first window on in which more of the votes are for that."""
    min_votes: int = 16
    """Views with fewer votes about an object do not count; ours, as `PresenceConfig.min_points`."""
    evidence: EvidenceConfig = field(default_factory=lambda: EvidenceConfig(band_share=0.0))
    """Parameters of the comparison of points with depth; the tolerance of 0.1 m is Khronos' default."""
    stride_px: int = 4
    """Every such pixel of every such row of a view is kept as a ray; ours."""


Bins = dict[int, tuple[int, int]]
"""Numbers of votes for presence and for absence, by round."""


def change_of(bins: Bins, config: KhronosConfig, *, forward: bool) -> int | None:
    """Return the round of the votes, nearest to the object's own, from which on it is absent; `None` if it never is.

    Each window begins at a round with votes and goes on for `window` rounds, forwards in time in both directions, as
    in Khronos.

    Args:
        bins: Votes before the object was first seen, or after it was last seen.
        forward: Whether to go through the rounds forwards or backwards.
    """
    for start in sorted(bins, reverse=not forward):
        votes = [bins[at] for at in range(start, start + config.window) if at in bins]
        present, absent = sum(one[0] for one in votes), sum(one[1] for one in votes)
        if absent > config.absent_share * (present + absent):
            return start
    return None


@dataclass(slots=True)
class _Track:
    first: int
    """Round in which the object was first seen."""
    last: int
    """Round in which it was last seen."""
    after: Bins = field(default_factory=dict)
    """Votes of rounds after the last one."""
    is_dated: bool = False
    """Whether the rays from before the first detection were asked."""
    appeared: int | None = None
    """The last round in which they say that it was absent; `None` if they do not."""


class KhronosVotes:
    """The votes about all entries of an object map."""

    def __init__(self, config: KhronosConfig) -> None:
        self.config = config
        self._tracks: EntryStates[_Track] = EntryStates()
        self._rays: list[tuple[int, View]] = []
        """Thinned views, by round."""
        self._round = 0
        self._views: list[View] = []
        """Thinned views of the present round."""

    def see(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> None:
        """Take in a view that the map has integrated, and keep its rays."""
        self._tracks.follow(update)
        for entry_id in detected_ids(update):
            track = self._tracks.setdefault(entry_id, _Track(self._round, self._round))
            track.last = self._round
            track.after.clear()  # it was observed again: what was said of it is out of date
        self._views.append(rays_of(view, self.config.stride_px))

    def end_round(self, map_: ObjectMap) -> None:
        """Count the votes of the round's rays about what it did not detect; date what it detected first."""
        for view in self._views:
            for entry_id, votes in self._votes(map_, map_.in_view(view), view):
                track = self._tracks.get(entry_id)
                if track is not None and track.last < self._round:
                    present, absent = track.after.get(self._round, (0, 0))
                    track.after[self._round] = (present + votes[0], absent + votes[1])
        self._date_new(map_)
        self._rays += [(self._round, view) for view in self._views]
        self._views = []
        self._round += 1

    def is_absent(self, entry_id: int) -> bool:
        """Return whether later rays say that an entry's object is no longer there."""
        return self.disappeared(entry_id) is not None

    def disappeared(self, entry_id: int) -> int | None:
        """Return the round from which on later rays say that an object is absent; `None` if they do not."""
        track = self._tracks.get(entry_id)
        return None if track is None else change_of(track.after, self.config, forward=True)

    def appeared(self, entry_id: int) -> int | None:
        """Return the last round in which earlier rays say that an object was absent; `None` if they do not."""
        track = self._tracks.get(entry_id)
        return None if track is None else track.appeared

    def _votes(self, map_: ObjectMap, entry_ids: list[int], view: View) -> list[tuple[int, tuple[int, int]]]:
        found = zip(entry_ids, map_.depth_evidence(entry_ids, view, self.config.evidence), strict=True)
        return [
            (entry_id, (one.num_supported, one.num_see_through))
            for entry_id, one in found
            if one.num_not_hidden >= self.config.min_votes
        ]

    def _date_new(self, map_: ObjectMap) -> None:
        """Let the rays from before say when the objects came that this round detected first."""
        new = {one: track for one, track in self._tracks.items() if not track.is_dated and map_.entry(one)}
        if not new:
            return
        bins: dict[int, Bins] = {entry_id: {} for entry_id in new}
        for at, view in self._rays_near(map_, list(new)):
            shown = [one for one in map_.in_view(view) if one in new and at < new[one].first]
            for entry_id, votes in self._votes(map_, shown, view):
                present, absent = bins[entry_id].get(at, (0, 0))
                bins[entry_id][at] = (present + votes[0], absent + votes[1])
        for entry_id, track in new.items():
            track.is_dated, track.appeared = True, change_of(bins[entry_id], self.config, forward=False)

    def _rays_near(self, map_: ObjectMap, entry_ids: list[int]) -> list[tuple[int, View]]:
        """Return the kept views from near enough to one of some entries to detect it."""
        entries = [entry for one in entry_ids if (entry := map_.entry(one)) is not None]
        centres_m = np.array([(entry.centre_m[0], entry.centre_m[2]) for entry in entries])
        eyes_m = np.array([(view.pose.x_m, view.pose.z_m) for _, view in self._rays]).reshape(-1, 2)
        gaps_m = np.hypot(*np.moveaxis(eyes_m[:, None] - centres_m[None], -1, 0)).min(axis=1, initial=np.inf)
        return [self._rays[index] for index in np.flatnonzero(gaps_m <= map_.config.max_distance_m)]


def rays_of(view: View, stride_px: int) -> View:
    """Return a view with fewer pixels and without detections: the rays that are kept of it.

    Args:
        stride_px: Every such pixel of every such row is kept, if the size of the image allows it; else all are.
    """
    depth_m, intrinsics, _ = thinned(view.depth_m, view.intrinsics, stride_px)
    nothing = Detections(np.full(depth_m.shape, -1, np.int32), (), np.empty(0, np.float32))
    no_cells = VisibleOccupancy(np.empty((0, 2), np.int32), np.empty((0, 2), np.int32))
    return replace(view, intrinsics=intrinsics, depth_m=depth_m, detections=nothing, occupancy=no_cells, rgb=None)


class KhronosFrontierUpdate(FrontierUpdate):
    """Keeps an object that is voted absent with its dates, and believes in it again when it is detected again."""

    config: KhronosConfig = KhronosConfig()
    _counted: ClassVar[tuple[str, ...]] = (*FrontierUpdate._counted, "absent_targets")

    def _new_navigator(self) -> Navigator:
        navigator = super()._new_navigator()
        self._votes = KhronosVotes(self.config)
        navigator.observers.append(self._votes.see)
        return navigator

    def _after_look(self, observation: Observation) -> None:
        navigator = self._navigator
        self._votes.end_round(navigator.objects)
        if navigator.target is not None and self._votes.is_absent(navigator.target.entry_id):
            self._counters["absent_targets"] += 1
            navigator.target = None

    def _believed(self) -> Sequence[ObjectEntry]:
        return [entry for entry in super()._believed() if not self._votes.is_absent(entry.id)]

    def _entry_beliefs(self) -> Sequence[EntryBelief]:
        """Return the object memory, without what is absent now."""
        return [entry_belief(entry) for entry in self._believed()]

    def _round_details(self, reason: str) -> Mapping[str, Any]:
        entry_ids = [entry.id for entry in self._navigator.objects.entries]
        dates = {"disappeared": self._votes.disappeared, "appeared": self._votes.appeared}
        found = {
            name: {str(one): date for one in entry_ids if (date := date_of(one)) is not None}
            for name, date_of in dates.items()
        }
        return {**super()._round_details(reason), **{name: those for name, those in found.items() if those}}
