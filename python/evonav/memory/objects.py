"""The object map: detections gathered into lasting entries."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav._core import ObjectEntry
from evonav.sensors.observation import View

__all__ = ["Comparison", "ObjectEntry", "ObjectMap", "ObjectMapConfig", "ObjectUpdate", "SightConfig"]


@dataclass(frozen=True, slots=True)
class ObjectMapConfig:
    """ConceptGraphs' pipeline with 3D-Mem's parameters."""

    min_points: int = 16
    """Fewest pixels with a depth of a detection."""
    max_points: int = 5000
    """A mask is thinned to about this many points."""
    min_box_m3: float = 1e-6
    """Smallest volume of a detection's box, whose edges count as a voxel's at least."""
    voxel_m: float = 0.01
    """Edge of the voxels that clouds are thinned by."""
    cluster_radius_m: float = 0.1
    """DBSCAN's radius for cleaning clouds."""
    cluster_min_points: int = 10
    """DBSCAN's neighbours of a core point."""
    max_distance_m: float = 3.5
    """Detections and unconfirmed entries farther from the agent than this, on the ground plane, do not count."""
    overlap_radius_m: float = 0.025
    """Two points nearer than this are the same place."""
    visual_weight: float = 1.0
    """What visual similarity counts for beside overlap; 0 matches by overlap alone, whatever the label."""
    match_threshold: float = 1.2
    """A detection joins an entry if overlap plus weighted visual similarity exceeds this."""
    views_per_cleanup: int = 12
    """Views between two clean-ups; 0 for none."""
    min_detections: int = 2
    """Entries with fewer detections are dropped at a clean-up if far from the agent."""
    merge_overlap: float = 0.7
    """Entries merge at a clean-up if one lies in the other by more than this part ..."""
    merge_similarity: float = 0.7
    """... and they look alike by more than this."""


@dataclass(frozen=True, slots=True)
class SightConfig:
    """When a line from an eye to a point is open (MSGNav's parameters)."""

    radius_m: float = 0.05
    """A remembered point nearer to a sample of a line than this closes the line."""
    step_m: float = 0.05
    """Between two samples of a line."""
    margin_m: float = 0.15
    """The first and the last stretch of a line, which are not sampled."""
    max_samples: int = 1000
    """Of a line; of a longer one they lie farther apart."""
    max_targets: int = 1000
    """A target is thinned to at most so many points."""


@dataclass(frozen=True, slots=True)
class ObjectUpdate:
    """What an update did."""

    entry_ids: tuple[int | None, ...]
    """Entry of each detection; `None` if it was filtered out."""
    removed: tuple[int, ...]
    """Entries that the clean-up dropped."""
    merged: tuple[tuple[int, int], ...]
    """Entries that the clean-up merged: the one that is gone, and the one that it became."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """How the detections of one view compare with an entry."""

    overlap: NDArray[np.float64]
    """`(N,)` part of a detection's points that lie by the entry's."""
    distance_m: NDArray[np.float64]
    """`(N,)` from a detection's centroid to the middle of the entry's box; `inf` if it was filtered out."""


class ObjectMap:
    """What was detected so far, as entries: beliefs, which go stale when an object moves.

    A detection joins the entry with the largest sum of spatial similarity (the part of its points within
    `overlap_radius_m` of the entry's) and visual similarity (cosine of features; without features, 1 for the same
    label), if that exceeds `match_threshold`; else it becomes an entry. Simulator ids play no part.
    """

    def __init__(self, config: ObjectMapConfig | None = None) -> None:
        """A map without entries, in stage 1.

        Raises:
            InvalidArgumentError: A parameter is outside its domain; the message names it.
        """
        self.config = config or ObjectMapConfig()
        self._map = _core.ObjectMap(**asdict(self.config))

    def __len__(self) -> int:
        """Number of entries."""
        return len(self._map)

    @property
    def entries(self) -> list[ObjectEntry]:
        """Entries as they are now, by ascending id."""
        return self._map.entries

    @property
    def num_views(self) -> int:
        """Views taken over so far."""
        return self._map.num_views

    def entry(self, entry_id: int) -> ObjectEntry | None:
        """The entry of an id, if it is still there."""
        return self._map.entry(entry_id)

    def points_m(self, entry_id: int) -> NDArray[np.float32] | None:
        """`(N, 3)` points of an entry, world frame, if it is still there."""
        return self._map.points_m(entry_id)

    def begin_stage(self, stage: int) -> None:
        """Starts a stage: entries stay, the count of views to the next clean-up starts over."""
        self._map.begin_stage(stage)

    def remove(self, entry_id: int) -> bool:
        """Takes an entry out; whether there was one."""
        return self._map.remove(entry_id)

    def clear(self) -> None:
        """Forgets all entries; the map is as new, ids included."""
        self._map.clear()

    def update(self, view: View) -> ObjectUpdate:
        """Takes over one view.

        Every `views_per_cleanup` views, entries are denoised, those seen fewer than `min_detections` times and far
        away are dropped, and those that lie in one another are merged.

        Args:
            view: Its detections, depth, pose and intrinsics are used.

        Raises:
            InvalidArgumentError: An array does not fit, or holds NaN; the map is then unchanged.
        """
        found = view.detections
        entry_ids, removed, merged = self._map.update(
            view.depth_m,
            found.masks,
            list(found.labels),
            found.confidences,
            found.features,
            position_m=view.pose.position_m,
            yaw_rad=view.pose.yaw_rad,
            horizon_rad=view.pose.horizon_rad,
            vertical_fov_rad=view.intrinsics.vertical_fov_rad,
        )
        return ObjectUpdate(tuple(entry_ids), tuple(removed), tuple(merged))

    def compare(self, entry_id: int, view: View) -> Comparison:
        """Compares the detections of a view, at any distance, with an entry; nothing changes.

        Raises:
            InvalidArgumentError: There is no such entry, or an array does not fit.
        """
        found = view.detections
        compared = self._map.compare(
            entry_id,
            view.depth_m,
            found.masks,
            list(found.labels),
            found.confidences,
            found.features,
            position_m=view.pose.position_m,
            yaw_rad=view.pose.yaw_rad,
            horizon_rad=view.pose.horizon_rad,
            vertical_fov_rad=view.intrinsics.vertical_fov_rad,
        )
        return Comparison(overlap=compared[:, 0], distance_m=compared[:, 1])

    def visible_shares(
        self, target_m: NDArray[np.float32], eyes_m: NDArray[np.float64], config: SightConfig | None = None
    ) -> NDArray[np.float64]:
        """How much of an object can be seen from some places, past the points of all entries and its own.

        Walls are in no entry: one sees through them.

        Args:
            target_m: `(N, 3)` points of the object, world frame.
            eyes_m: `(E, 3)` places of the eyes, world frame.
            config: When a line is open.

        Returns:
            `(E,)` shares of the target's points in 0..1; 0 without points.

        Raises:
            InvalidArgumentError: A place is not finite, or a parameter is outside its domain; the message names it.
        """
        return self._map.visible_shares(target_m, eyes_m, **asdict(config or SightConfig()))

    def is_supported(self, entry_id: int, view: View, *, max_distance_m: float = 0.5, min_overlap: float = 0.2) -> bool:
        """Whether a view still shows the object of an entry where it was.

        That is, some detection with the entry's label overlaps it, or has its centroid by the middle of its box.

        Raises:
            InvalidArgumentError: There is no such entry, or an array does not fit.
        """
        compared = self.compare(entry_id, view)
        entry = self._map.entry(entry_id)
        is_here = (compared.overlap > min_overlap) | (compared.distance_m < max_distance_m)
        return entry is not None and any(
            label == entry.label and here for label, here in zip(view.detections.labels, is_here.tolist(), strict=True)
        )
