"""Merge detections into lasting object entries: the object map."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav._core import House, ObjectEntry
from evonav.counted import counted
from evonav.memory.presence import DepthEvidence, EvidenceConfig
from evonav.sensors.observation import View

if TYPE_CHECKING:  # agents start fast, and few draw
    from evonav.drawing.pictures import Picture

__all__ = [
    "Comparison",
    "Erosion",
    "ObjectEntry",
    "ObjectMap",
    "ObjectMapConfig",
    "ObjectUpdate",
    "SeeThroughConfig",
    "SightConfig",
]


@dataclass(frozen=True, slots=True)
class ObjectMapConfig:
    """ConceptGraphs' pipeline with 3D-Mem's parameters."""

    min_points: int = 16
    """Smallest number of a detection's pixels with a depth."""
    max_points: int = 5000
    """A mask is thinned to about this many points."""
    min_box_m3: float = 1e-6
    """Smallest volume of a detection's box; each of its edges counts as at least one voxel."""
    voxel_m: float = 0.01
    """Edge of the voxels that thin the clouds."""
    cluster_radius_m: float = 0.1
    """DBSCAN's radius for cleaning clouds."""
    cluster_min_points: int = 10
    """DBSCAN's neighbours of a core point."""
    max_distance_m: float = 3.5
    """Ground-plane distance from the agent beyond which detections and unconfirmed entries do not count."""
    overlap_radius_m: float = 0.025
    """Distance below which two points are the same place."""
    visual_weight: float = 1.0
    """Weight of visual similarity relative to overlap; 0 matches by overlap alone, whatever the label."""
    match_threshold: float = 1.2
    """A detection joins an entry if overlap plus weighted visual similarity exceeds this."""
    views_per_cleanup: int = 12
    """Number of views between two clean-ups; 0 for none."""
    min_detections: int = 2
    """Entries with fewer detections are dropped at a clean-up if far from the agent."""
    merge_overlap: float = 0.7
    """Share of an entry that must lie in another for a clean-up to merge them."""
    merge_similarity: float = 0.7
    """Visual similarity that a merge requires in addition."""


@dataclass(frozen=True, slots=True)
class SightConfig:
    """Conditions for a line of sight from an eye to a point (MSGNav's parameters)."""

    radius_m: float = 0.05
    """Distance from a sample of a line within which a remembered point blocks it."""
    step_m: float = 0.05
    """Distance between two samples of a line."""
    margin_m: float = 0.15
    """Length of the first and the last part of a line, which are not sampled."""
    max_samples: int = 1000
    """Largest number of samples of a line; longer lines are sampled more coarsely."""
    max_targets: int = 1000
    """Largest number of points of a target, which is thinned."""


@dataclass(frozen=True, slots=True)
class SeeThroughConfig:
    """Conditions under which `ObjectMap.remove_seen_through` removes a point; DynaMem's, except for `margin_px`."""

    near_m: float = 0.01
    """Smallest depth of a point."""
    far_m: float = 2.5
    """Largest depth of a point."""
    band_m: float = 0.1
    """A surface this much farther away than the point does not yet count as farther away."""
    band_share: float = 0.0
    """The same as a share of the point's depth; the larger of the two counts."""
    margin_px: int = 1
    """All pixels within this many rows and columns must show something farther away, too; ours: 0 wears edges off."""


@dataclass(frozen=True, slots=True)
class Erosion:
    """An entry that lost points."""

    entry_id: int
    num_removed: int
    """Number of points that were removed."""
    num_left: int
    """Number of points that are left; an entry without any is removed."""


@dataclass(frozen=True, slots=True)
class ObjectUpdate:
    """The effects of an update."""

    entry_ids: tuple[int | None, ...]
    """Entry of each detection; `None` if it was filtered out."""
    removed: tuple[int, ...]
    """Entries that the clean-up removed."""
    merged: tuple[tuple[int, int], ...]
    """Entries that the clean-up merged: the removed one, and the one that absorbed it."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """The detections of one view compared with an entry."""

    overlap: NDArray[np.float64]
    """`(N,)` share of a detection's points that lie by the entry's."""
    distance_m: NDArray[np.float64]
    """`(N,)` distance from a detection's centroid to the centre of the entry's box; `inf` if it was filtered out."""


class ObjectMap:
    """The detections so far, as entries: beliefs, which become stale when an object moves.

    A detection joins the entry with the largest sum of spatial similarity (the share of its points within
    `overlap_radius_m` of the entry's) and visual similarity (cosine of features; without features, 1 for the same
    label), if that exceeds `match_threshold`. Otherwise it becomes an entry. Simulator ids are not used.

    Examples:
        >>> import evonav
        >>> simulator = evonav.Simulator(evonav.load_houses()[2])
        >>> memory = evonav.ObjectMap()
        >>> for _ in range(24):
        ...     update = memory.update(simulator.look(rgb=False))
        ...     has_turned = simulator.step("TURN_LEFT")
        >>> "Toilet" in {entry.label for entry in memory.entries}
        True
        >>> picture = memory.plot()
    """

    def __init__(self, config: ObjectMapConfig | None = None) -> None:
        """Make a map without entries, in stage 1.

        Raises:
            InvalidArgumentError: A parameter is out of range; the message names it.
        """
        self.config = config or ObjectMapConfig()
        self._map = _core.ObjectMap(self.config)

    def __len__(self) -> int:
        """Return the number of entries."""
        return len(self._map)

    @property
    def entries(self) -> list[ObjectEntry]:
        """The present entries, by ascending id."""
        return self._map.entries

    @property
    def num_views(self) -> int:
        """Number of views integrated so far."""
        return self._map.num_views

    def entry(self, entry_id: int) -> ObjectEntry | None:
        """Return the entry with an id, or `None` if it no longer exists."""
        return self._map.entry(entry_id)

    def points_m(self, entry_id: int) -> NDArray[np.float32] | None:
        """Return an entry's `(N, 3)` points, world frame, or `None` if it no longer exists."""
        return self._map.points_m(entry_id)

    def begin_stage(self, stage: int) -> None:
        """Begin a stage: entries stay, and the count of views to the next clean-up restarts."""
        self._map.begin_stage(stage)

    def remove(self, entry_id: int) -> bool:
        """Remove an entry; return whether it existed."""
        return self._map.remove(entry_id)

    def clear(self) -> None:
        """Remove all entries; the map is as new, ids included."""
        self._map.clear()

    def __repr__(self) -> str:
        """Return the number of entries and the most common labels."""
        counts = Counter(entry.label for entry in self.entries).most_common(3)
        shown = "".join(f", {count} {label}" for label, count in counts)
        return (
            f"ObjectMap({counted(len(self), 'entry')}{shown}{', ...' if len(self) > sum(n for _, n in counts) else ''})"
        )

    def plot(self, house: House | None = None) -> "Picture":
        """Draw the entries from above.

        Args:
            house: A house to draw them over.
        """
        from evonav.drawing.pictures import boxes_picture

        boxes = [(entry.label, entry.centre_m, entry.size_m) for entry in self.entries]
        return boxes_picture(boxes, f"{len(boxes)} object entries", house)

    def update(self, view: View) -> ObjectUpdate:
        """Integrate one view.

        After every `views_per_cleanup` views, entries are denoised, those seen fewer than `min_detections` times and
        far away are removed, and overlapping similar ones are merged.

        Args:
            view: View with detections, depth, pose and intrinsics.

        Raises:
            InvalidArgumentError: An array has the wrong shape or contains NaN; the map does not change then.
        """
        entry_ids, removed, merged = self._map.update(view)
        return ObjectUpdate(tuple(entry_ids), tuple(removed), tuple(merged))

    def compare(self, entry_id: int, view: View) -> Comparison:
        """Compare the detections of a view, at any distance, with an entry; the map does not change.

        Raises:
            InvalidArgumentError: The entry does not exist, or an array has the wrong shape.
        """
        compared = self._map.compare(entry_id, view)
        return Comparison(overlap=compared[:, 0], distance_m=compared[:, 1])

    def depth_evidence(
        self, entry_ids: Sequence[int], view: View, config: EvidenceConfig | None = None
    ) -> list[DepthEvidence]:
        """Compare the points of entries with the depth image of a view; the map does not change.

        A point is seen through if the image shows something farther away at its pixel, occluded if it shows something
        nearer, and supported if the depths are equal within a band, `max(band_m, band_share * depth)`.

        Args:
            view: View with depth, pose and intrinsics.
            config: Number of points and width of the band.

        Returns:
            The counts of each entry, in order.

        Raises:
            InvalidArgumentError: An entry does not exist, the depth image contains NaN, or a parameter is out of
                range; the message names it.
        """
        counts = self._map.depth_evidence(entry_ids, view, config or EvidenceConfig())
        return [DepthEvidence(*row) for row in counts.tolist()]

    def in_view(self, view: View, max_distance_m: float | None = None) -> list[int]:
        """Return the ids of the entries whose boxes are in view, ascending; they may be hidden.

        Args:
            view: View with pose, intrinsics and the size of its depth image.
            max_distance_m: Largest distance on the ground plane from the camera to the middle of a box; `None` for
                that of detections, `ObjectMapConfig.max_distance_m`.

        Raises:
            InvalidArgumentError: The pose is not finite, or the distance is negative or NaN.
        """
        return self._map.in_view(view, self.config.max_distance_m if max_distance_m is None else max_distance_m)

    def remove_seen_through(self, view: View, config: SeeThroughConfig | None = None) -> list[Erosion]:
        """Remove the points of all entries that the depth image of a view sees through.

        A point is seen through if the image shows something farther away at its pixel, by more than a band,
        `max(band_m, band_share * depth)`, and around it. An entry without any points left is removed.

        Args:
            view: View with depth, pose and intrinsics.

        Returns:
            The entries that lost points, by ascending id.

        Raises:
            InvalidArgumentError: The depth image contains NaN, or a parameter is out of range; the map does not change
                then.
        """
        return [Erosion(*row) for row in self._map.remove_seen_through(view, config or SeeThroughConfig())]

    def num_bytes(self) -> int:
        """Return the number of bytes that the map holds: entries, labels, features, points and their tables."""
        return self._map.num_bytes()

    def visible_shares(
        self, target_m: NDArray[np.float32], eyes_m: NDArray[np.float64], config: SightConfig | None = None
    ) -> NDArray[np.float64]:
        """Return the visible share of an object from several places; the points of all entries may occlude it.

        Walls are not entries, so they do not occlude.

        Args:
            target_m: `(N, 3)` points of the object, world frame.
            eyes_m: `(E, 3)` positions of the eyes, world frame.
            config: Conditions for a line of sight.

        Returns:
            `(E,)` shares of the target's points, 0 to 1; 0 without points.

        Raises:
            InvalidArgumentError: A position is not finite, or a parameter is out of range; the message names it.
        """
        return self._map.visible_shares(target_m, eyes_m, config or SightConfig())
