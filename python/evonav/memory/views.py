"""Views kept for prompts and for looking again: a small picture each, and what was detected in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evonav import _core
from evonav.sensors.observation import Detections, View
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

JPEG_QUALITY = 90
"""About 20 KB a view of 300 x 300, a tenth of its pixels: an episode keeps hundreds."""

Box = tuple[int, int, int, int]
"""Left, top, right, bottom in pixels; right and bottom are one past the last."""


@dataclass(frozen=True, slots=True)
class Seen:
    """One detection of a view."""

    entry_id: int | None
    """The entry that it joined, as it was called then; `None` if it was filtered out."""
    label: str
    confidence: float
    area_px: int
    box_px: Box


@dataclass(frozen=True, slots=True)
class StoredView:
    """A view as kept."""

    id: int
    """Counts up from 0."""
    stage: int
    round: int
    """Of the stage."""
    pose: Pose
    """The camera's own."""
    intrinsics: Intrinsics
    seen: tuple[Seen, ...]
    """In the order of the detections."""
    jpeg: bytes | None
    """`None` when the view came without colours."""


class ViewStore:
    """Views in the order in which they came."""

    def __init__(self) -> None:
        self.views: list[StoredView] = []
        self._became: dict[int, int] = {}
        self._best: dict[int, tuple[int, Seen]] = {}
        self._latest: dict[int, int] = {}

    def add(self, view: View, entry_ids: Sequence[int | None], *, stage: int, round_: int) -> StoredView:
        """Keeps a view.

        Args:
            view: As observed.
            entry_ids: Entry of each detection, as `ObjectMap.update` tells.
            stage: Of the task.
            round_: Of the stage.
        """
        boxes = boxes_of(view.detections)
        seen = tuple(
            Seen(entry_id, label, float(confidence), area_px, box_px)
            for entry_id, label, confidence, (area_px, box_px) in zip(
                entry_ids, view.detections.labels, view.detections.confidences, boxes, strict=True
            )
        )
        jpeg = None if view.rgb is None else _jpeg(view.rgb)
        stored = StoredView(len(self.views), stage, round_, view.pose, view.intrinsics, seen, jpeg)
        self.views.append(stored)
        for one in seen:
            if one.entry_id is not None:
                entry_id = self.resolve(one.entry_id)
                self._latest[entry_id] = stored.id
                best = self._best.get(entry_id)
                if best is None or one.area_px > best[1].area_px:
                    self._best[entry_id] = (stored.id, one)
        return stored

    def follow(self, merged: Mapping[int, int] | Sequence[tuple[int, int]]) -> None:
        """Takes note of entries that became others; pairs as `ObjectUpdate.merged` has them."""
        for old, new in dict(merged).items():
            self._became[old] = new
            target = self.resolve(new)
            if (latest := self._latest.pop(old, None)) is not None:
                self._latest[target] = max(latest, self._latest.get(target, -1))
            best, other = self._best.pop(old, None), self._best.get(target)
            if best is not None and (other is None or best[1].area_px > other[1].area_px):
                self._best[target] = best

    def resolve(self, entry_id: int) -> int:
        """The entry that an entry has become by now."""
        while entry_id in self._became:
            entry_id = self._became[entry_id]
        return entry_id

    def best(self, entry_id: int) -> tuple[StoredView, Seen] | None:
        """The view that shows an entry largest, and where in it; `None` if none does."""
        found = self._best.get(self.resolve(entry_id))
        return None if found is None else (self.views[found[0]], found[1])

    def seen_in(self, view: StoredView, entry_id: int) -> Seen | None:
        """Where a view shows an entry, the largest part if there are several; `None` if it does not."""
        entry_id = self.resolve(entry_id)
        shown = (one for one in view.seen if one.entry_id is not None and self.resolve(one.entry_id) == entry_id)
        return max(shown, key=lambda one: one.area_px, default=None)

    def latest(self, entry_id: int) -> StoredView | None:
        """The view that an entry was last seen in."""
        found = self._latest.get(self.resolve(entry_id))
        return None if found is None else self.views[found]


def pixels_of(view: StoredView, size_px: int | None = None) -> NDArray[np.uint8] | None:
    """`(H, W, 3)` RGB of a view, its longer edge at most `size_px`; `None` when it came without colours."""
    if view.jpeg is None:
        return None
    with Image.open(BytesIO(view.jpeg)) as image:
        picture = image.convert("RGB")
    if size_px is not None and max(picture.size) > size_px:
        picture.thumbnail((size_px, size_px))
    return np.asarray(picture)


def crop_of(view: StoredView, box_px: Box, margin_px: int = 20) -> NDArray[np.uint8] | None:
    """A part of a view with a margin around it (3D-Mem: 20 px)."""
    picture = pixels_of(view)
    if picture is None:
        return None
    left, top, right, bottom = box_px
    return np.ascontiguousarray(
        picture[max(0, top - margin_px) : bottom + margin_px, max(0, left - margin_px) : right + margin_px]
    )


def boxes_of(detections: Detections) -> list[tuple[int, Box]]:
    """Pixels and bounding box of each detection; `(0, (0, 0, 0, 0))` of one without pixels."""
    extents = _core.mask_extents(detections.masks, num_masks=len(detections.labels))
    return [(area_px, (left, top, right, bottom)) for area_px, left, top, right, bottom in extents.tolist()]


def _jpeg(pixels: NDArray[np.uint8]) -> bytes:
    buffer = BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=JPEG_QUALITY)
    return buffer.getvalue()
