"""3D-Mem's snapshots: a few of the stored views, which together show every remembered object once."""

from collections.abc import Sequence
from dataclasses import dataclass

from evonav import _core
from evonav.memory.objects import ObjectEntry
from evonav.memory.views import StoredView, ViewStore
from evonav.points import Point2

RECLUSTER_REACH_M = 4.0
"""Entries nearer to the agent than this are clustered again (3D-Mem: the 3.5 m of its detections and 0.5 m)."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A view, and the entries that it represents."""

    view: StoredView
    entry_ids: tuple[int, ...]
    """Ids of the entries, at least one; all are seen in the view."""


class SnapshotMemory:
    """Keeps each entry in exactly one snapshot, whose view shows it.

    Frames (views with their detections) and snapshots follow entries that merge or vanish.
    """

    def __init__(self, reach_m: float = RECLUSTER_REACH_M) -> None:
        """Create a memory that clusters entries nearer to the agent than `reach_m` again at each update."""
        self.reach_m = reach_m
        self.snapshots: list[Snapshot] = []
        """Snapshots by ascending id of their views."""
        self._frames: dict[int, dict[int, float]] = {}
        self._num_views = 0

    @property
    def num_frames(self) -> int:
        """Number of views that show at least one remembered entry."""
        return len(self._frames)

    def update(self, views: ViewStore, entries: Sequence[ObjectEntry], agent_m: Point2) -> None:
        """Add the views that came since the last update, and cluster the entries that are new or near the agent.

        Args:
            views: The view store, the same at each call.
        """
        self._add_frames(views, {entry.id for entry in entries})
        frame_of_view = {view_id: index for index, view_id in enumerate(self._frames)}
        before = [
            (frame_of_view[snapshot.view.id], list(snapshot.entry_ids))
            for snapshot in self.snapshots
            if snapshot.view.id in frame_of_view
        ]
        after = _core.update_snapshots(
            [(entry.id, (entry.centre_m[0], entry.centre_m[2])) for entry in entries],
            [list(frame.items()) for frame in self._frames.values()],
            before,
            agent_m=agent_m,
            reach_m=self.reach_m,
        )
        view_ids = list(self._frames)
        self.snapshots = [Snapshot(views.views[view_ids[frame]], tuple(entry_ids)) for frame, entry_ids in after]

    def _add_frames(self, views: ViewStore, remembered: set[int]) -> None:
        """Make frames of new views, and drop forgotten entries from all frames."""
        for view in views.views[self._num_views :]:
            self._frames[view.id] = {}
            for seen in view.seen:
                if seen.entry_id is not None:
                    _note(self._frames[view.id], views.resolve(seen.entry_id), seen.confidence)
        self._num_views = len(views.views)
        for view_id, frame in list(self._frames.items()):
            if not frame.keys() <= remembered:
                renamed: dict[int, float] = {}
                for entry_id, confidence in frame.items():
                    _note(renamed, views.resolve(entry_id), confidence)
                frame = {entry_id: confidence for entry_id, confidence in renamed.items() if entry_id in remembered}
                self._frames[view_id] = frame
            if not frame:
                del self._frames[view_id]


def _note(frame: dict[int, float], entry_id: int, confidence: float) -> None:
    """Store a detection's confidence; of several detections of an entry the largest counts."""
    frame[entry_id] = max(confidence, frame.get(entry_id, confidence))
