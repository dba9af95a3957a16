"""Define what all forgetting rules share: their interface, and one view of remembered places."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

from evonav.memory.objects import ObjectMap, ObjectUpdate
from evonav.memory.presence import DepthEvidence, EvidenceConfig
from evonav.sensors.observation import View

State = TypeVar("State")


class ForgettingRule(ABC):
    """Decides what an object map forgets. One instance serves one map, from its first view on.

    Examples:
        >>> import evonav
        >>> from evonav.memory import forgetting
        >>> simulator = evonav.Simulator(evonav.load_houses()[2])
        >>> memory, rule = evonav.ObjectMap(), forgetting.make("bayes")
        >>> removed = rule.begin_visit(memory, 0.0)
        >>> for index in range(24):
        ...     view = simulator.look(rgb=False)
        ...     removed = rule.after_update(memory, view, memory.update(view), index * 0.5)
        ...     has_turned = simulator.step("TURN_LEFT")
        >>> rule.p_present(memory.entries[0].id) > 0.9
        True
    """

    name: ClassVar[str]
    """The rule's name in `RULES` and on the command line."""

    def begin_visit(self, map_: ObjectMap, time_s: float) -> tuple[int, ...]:
        """Begin a visit, before its first view: time has passed, and things may have moved.

        Args:
            map_: The map; what is forgotten is removed from it.
            time_s: Time since the first view of all.

        Returns:
            The ids of the removed entries, ascending.
        """
        return ()

    def after_update(self, map_: ObjectMap, view: View, update: ObjectUpdate, time_s: float) -> tuple[int, ...]:
        """Forget after each view.

        Args:
            map_: The map, which has integrated the view; what is forgotten is removed from it.
            update: The result of `ObjectMap.update` for it.
            time_s: Time since the first view of all.

        Returns:
            The ids of the removed entries, ascending.

        Raises:
            InvalidArgumentError: The depth image contains NaN.
        """
        return remove_all(map_, self.absent(map_, view, update))

    @abstractmethod
    def absent(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> list[int]:
        """Return the ids of the entries to forget after a view; see `after_update`."""

    def p_present(self, entry_id: int) -> float | None:
        """Return the probability that an entry's object is still there; `None` if the rule does not tell."""
        return None


class EntryStates(dict[int, State], Generic[State]):
    """States that a rule stores by entry."""

    def follow(self, update: ObjectUpdate) -> None:
        """Drop the states of the entries that a clean-up removed or merged into others, which keep their own."""
        for entry_id in update.removed:
            self.pop(entry_id, None)
        for gone, became in update.merged:
            state = self.pop(gone, None)
            if state is not None:
                self.setdefault(became, state)


@dataclass(frozen=True, slots=True)
class Look:
    """The evidence of one view about one entry."""

    entry_id: int
    evidence: DepthEvidence
    is_detected: bool
    """Whether a detection of the view joined the entry."""

    def is_clear(self, min_points: int, min_share: float) -> bool:
        """Return whether enough of the place is in view and not hidden."""
        shown = self.evidence.num_not_hidden
        return shown >= min_points and shown >= min_share * (shown + self.evidence.num_occluded)


def expected_px(map_: ObjectMap, entry_id: int, view: View) -> float:
    """Return about how many pixels an entry covers in a view, if all of it is in the image and nothing hides it.

    Each point stands for a square of one voxel's edge, and a view shows half of the points, those of the near sides.
    """
    entry = map_.entry(entry_id)
    if entry is None:
        return 0.0
    distance_m = math.dist(entry.centre_m, view.pose.position_m)
    focal_px = 0.5 * view.intrinsics.height_px / math.tan(0.5 * view.intrinsics.vertical_fov_rad)
    return 0.5 * entry.num_points * (focal_px * map_.config.voxel_m / max(distance_m, map_.config.voxel_m)) ** 2


def detected_ids(update: ObjectUpdate) -> list[int]:
    """Return the ids of the entries that a view's detections joined, ascending."""
    return sorted({entry_id for entry_id in update.entry_ids if entry_id is not None})


def look_at_places(map_: ObjectMap, view: View, update: ObjectUpdate, config: EvidenceConfig) -> Iterator[Look]:
    """Return what a view shows at the places of all entries in it, as far as detections count.

    Only entries with their boxes in view are compared with the depth image, in one call.
    """
    detected = frozenset(detected_ids(update))
    entry_ids = map_.in_view(view)
    for entry_id, evidence in zip(entry_ids, map_.depth_evidence(entry_ids, view, config), strict=True):
        yield Look(entry_id, evidence, entry_id in detected)


def remove_all(map_: ObjectMap, entry_ids: Iterable[int]) -> tuple[int, ...]:
    """Remove entries from a map; return their ids, ascending."""
    removed = tuple(sorted(entry_ids))
    for entry_id in removed:
        map_.remove(entry_id)
    return removed
