"""Rules that delete single points, and entries with too few points left."""

from dataclasses import dataclass, field
from typing import ClassVar

from evonav.memory.forgetting.rule import EntryStates, ForgettingRule, detected_ids, remove_all
from evonav.memory.objects import ObjectMap, ObjectUpdate, SeeThroughConfig
from evonav.sensors.observation import View


@dataclass(slots=True)
class SeeThrough(ForgettingRule):
    """Delete every point as soon as one later depth image sees through it: DynaMem (Liu et al., 2024).

    DynaMem deletes each stored point that projects into the image at a depth of 0.01 to 2.5 m, unless the image is
    nearer by more than 0.1 m, and then adds the points of the image. So a point on a surface is replaced by the same
    point. Here it stays, since only detections add points; a point before a surface goes if it is more than 0.1 m
    before it. DynaMem has no entries: here one goes when few of its points are left, which are those that lie within
    0.1 m of what stood behind the object.
    """

    name: ClassVar[str] = "see-through"
    max_left_share: float = 0.5
    """An entry goes when at most this share is left of the points that it had when it was last detected; ours."""
    points: SeeThroughConfig = field(default_factory=SeeThroughConfig)
    """Conditions under which a point is deleted."""
    _num_points: EntryStates[int] = field(init=False, repr=False, default_factory=EntryStates)
    """Number of points before the first deletion since an entry was last detected."""

    def after_update(self, map_: ObjectMap, view: View, update: ObjectUpdate, time_s: float) -> tuple[int, ...]:
        """Delete points; forget the entries with too few of them left that this view did not detect."""
        self._num_points.follow(update)
        detected = frozenset(detected_ids(update))
        for entry_id in detected:
            self._num_points.pop(entry_id, None)
        gone, empty = [], []
        for erosion in map_.remove_seen_through(view, self.points):
            num_points = erosion.num_left + erosion.num_removed
            if erosion.entry_id not in detected:
                num_points = self._num_points.setdefault(erosion.entry_id, num_points)
            if erosion.num_left == 0:
                empty.append(erosion.entry_id)
            elif erosion.entry_id not in detected and erosion.num_left <= self.max_left_share * num_points:
                gone.append(erosion.entry_id)
        for entry_id in (*gone, *empty):
            self._num_points.pop(entry_id, None)
        return tuple(sorted((*remove_all(map_, gone), *empty)))


@dataclass(slots=True)
class ShareDeleted(SeeThrough):
    """Delete the points whose depth disagrees, and an entry when enough of it was deleted: DovSG (Yan et al., 2024).

    DovSG deletes a voxel if the image shows something more than 2 cm behind it, or more than 1 cm behind it in another
    colour; points have no colours here, so the second half is left out.
    """

    name: ClassVar[str] = "share-deleted"
    max_left_share: float = 0.5
    """An entry goes when at most this share is left of the points that it had when it was last detected."""
    points: SeeThroughConfig = field(default_factory=lambda: SeeThroughConfig(band_m=0.02, far_m=3.5))
    """Conditions under which a point is deleted."""
