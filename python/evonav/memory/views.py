"""Store views for prompts and for a second look: a small image each, with its detections."""

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
"""Quality of stored images: about 20 KB for 300 x 300 pixels, a tenth of the raw data; an episode has hundreds."""

Box = tuple[int, int, int, int]
"""Left, top, right, bottom in pixels; right and bottom are exclusive."""


@dataclass(frozen=True, slots=True)
class Seen:
    """One detection of a view."""

    entry_id: int | None
    """Id that the entry of this detection had then; `None` if the detection was filtered out."""
    label: str
    confidence: float
    area_px: int
    box_px: Box


@dataclass(frozen=True, slots=True)
class StoredView:
    """A stored view."""

    id: int
    """Number of the view, from 0."""
    stage: int
    round: int
    """Round of the stage."""
    pose: Pose
    """Pose of the camera itself."""
    intrinsics: Intrinsics
    seen: tuple[Seen, ...]
    """The view's detections, in their order."""
    jpeg: bytes | None
    """The image; `None` if the view had no colours."""


class ViewStore:
    """Views in the order of their arrival."""

    def __init__(self) -> None:
        self.views: list[StoredView] = []
        self._became: dict[int, int] = {}
        self._best: dict[int, tuple[int, Seen]] = {}
        self._latest: dict[int, int] = {}

    def add(self, view: View, entry_ids: Sequence[int | None], *, stage: int, round_: int) -> StoredView:
        """Store a view.

        Args:
            view: The observed view.
            entry_ids: Entry of each detection, as in `ObjectUpdate`.
            stage: Stage of the task.
            round_: Round of the stage.
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
        """Record that entries were absorbed by others; pairs are those of `ObjectUpdate.merged`."""
        for old, new in dict(merged).items():
            self._became[old] = new
            target = self.resolve(new)
            if (latest := self._latest.pop(old, None)) is not None:
                self._latest[target] = max(latest, self._latest.get(target, -1))
            best, other = self._best.pop(old, None), self._best.get(target)
            if best is not None and (other is None or best[1].area_px > other[1].area_px):
                self._best[target] = best

    def resolve(self, entry_id: int) -> int:
        """Return the entry that an entry has become."""
        while entry_id in self._became:
            entry_id = self._became[entry_id]
        return entry_id

    def best(self, entry_id: int) -> tuple[StoredView, Seen] | None:
        """Return the view that shows an entry largest, and its detection there; `None` if no view shows it."""
        found = self._best.get(self.resolve(entry_id))
        return None if found is None else (self.views[found[0]], found[1])

    def seen_in(self, view: StoredView, entry_id: int) -> Seen | None:
        """Return the largest detection of an entry in a view; `None` if the view does not show it."""
        entry_id = self.resolve(entry_id)
        shown = (one for one in view.seen if one.entry_id is not None and self.resolve(one.entry_id) == entry_id)
        return max(shown, key=lambda one: one.area_px, default=None)

    def latest(self, entry_id: int) -> StoredView | None:
        """Return the view in which an entry was last seen."""
        found = self._latest.get(self.resolve(entry_id))
        return None if found is None else self.views[found]


def pixels_of(view: StoredView, size_px: int | None = None) -> NDArray[np.uint8] | None:
    """Return the `(H, W, 3)` image of a view, its longer edge at most `size_px`; `None` if it had no colours."""
    if view.jpeg is None:
        return None
    with Image.open(BytesIO(view.jpeg)) as image:
        picture = image.convert("RGB")
    if size_px is not None and max(picture.size) > size_px:
        picture.thumbnail((size_px, size_px))
    return np.asarray(picture)


def crop_of(view: StoredView, box_px: Box, margin_px: int = 20) -> NDArray[np.uint8] | None:
    """Return a part of a view with a margin around it (3D-Mem: 20 px)."""
    picture = pixels_of(view)
    if picture is None:
        return None
    left, top, right, bottom = box_px
    return np.ascontiguousarray(
        picture[max(0, top - margin_px) : bottom + margin_px, max(0, left - margin_px) : right + margin_px]
    )


def boxes_of(detections: Detections) -> list[tuple[int, Box]]:
    """Return number of pixels and bounding box of each detection; `(0, (0, 0, 0, 0))` for one without pixels."""
    extents = _core.mask_extents(detections.masks, num_masks=len(detections.labels))
    return [(area_px, (left, top, right, bottom)) for area_px, left, top, right, bottom in extents.tolist()]


def _jpeg(pixels: NDArray[np.uint8]) -> bytes:
    buffer = BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=JPEG_QUALITY)
    return buffer.getvalue()
