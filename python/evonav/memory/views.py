"""Store views for prompts and for a second look: a small image each, with its detections."""

from bisect import insort
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evonav import _core
from evonav.errors import InvalidArgumentError
from evonav.memory.colours import Layout, colour_shares, layouts
from evonav.sensors.observation import Detections, View
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

JPEG_QUALITY = 90
"""Quality of stored images: about 20 KB for 300 x 300 pixels, a tenth of the raw data; an episode has hundreds."""

NUM_LARGEST = 3
"""Number of views of an entry from which its colours are taken."""

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
    colours: tuple[float, ...] | None = None
    """Share of each of `evonav.tasks.language.COLOURS`; `None` if the store keeps no colours."""
    layout: Layout | None = None
    """Colours of the view around the middle of its box; `None` if the store keeps none."""


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
    """The view's detections, in their order; none if the store keeps none."""
    jpeg: bytes | None
    """The image; `None` if the view had no colours."""


class ViewStore:
    """Views in the order of their arrival."""

    def __init__(
        self, *, names_colours: bool = False, keeps_layouts: bool = False, keeps_detections: bool = True
    ) -> None:
        """Create an empty store.

        Args:
            names_colours: True to keep the colours of detections by name, in place of the views' images.
            keeps_layouts: True to keep, with `names_colours`, those around detections as well.
            keeps_detections: False to keep no detections; then no view shows any entry.
        """
        self.views: list[StoredView] = []
        self._keeps_detections = keeps_detections
        self._names_colours = names_colours
        self._keeps_layouts = keeps_layouts
        self._became: dict[int, int] = {}
        self._largest: dict[int, list[tuple[int, Seen]]] = {}
        """The views that show an entry largest, by id, with its detections there, the largest first."""
        self._latest: dict[int, int] = {}

    def add(self, view: View, entry_ids: Sequence[int | None], *, stage: int, round_: int) -> StoredView:
        """Store a view.

        Args:
            entry_ids: Entry of each detection, as in `ObjectUpdate`.
        """
        seen = self._seen(view, entry_ids) if self._keeps_detections else ()
        jpeg = None
        if view.rgb is not None and not self._names_colours:
            buffer = BytesIO()
            Image.fromarray(view.rgb).save(buffer, "JPEG", quality=JPEG_QUALITY)
            jpeg = buffer.getvalue()
        stored = StoredView(len(self.views), stage, round_, view.pose, view.intrinsics, seen, jpeg)
        self.views.append(stored)
        for one in seen:
            if one.entry_id is not None:
                entry_id = self.resolve(one.entry_id)
                self._latest[entry_id] = stored.id
                self._keep_largest(entry_id, [(stored.id, one)])
        return stored

    def _seen(self, view: View, entry_ids: Sequence[int | None]) -> tuple[Seen, ...]:
        detections = view.detections
        boxes = boxes_of(detections)
        named = [tuple(row) for row in colour_shares(view).tolist()] if self._names_colours else [None] * len(boxes)
        around: Sequence[Layout | None] = [None] * len(boxes)
        if self._keeps_layouts:
            if view.rgb is None:
                raise InvalidArgumentError("view.rgb is None: ask for colours with `SensorConfig(needs_rgb=True)`")
            middles_px = [((left + right) / 2.0, (top + bottom) / 2.0) for _, (left, top, right, bottom) in boxes]
            around = layouts(view.rgb, middles_px)
        return tuple(
            Seen(entry_id, label, confidence, area_px, box_px, colours, layout)
            for entry_id, label, confidence, (area_px, box_px), colours, layout in zip(
                entry_ids, detections.labels, detections.confidences.tolist(), boxes, named, around, strict=True
            )
        )

    def follow(self, merged: Mapping[int, int] | Sequence[tuple[int, int]]) -> None:
        """Record that entries were absorbed by others; pairs are those of `ObjectUpdate.merged`."""
        for old, new in dict(merged).items():
            self._became[old] = new
            target = self.resolve(new)
            if (latest := self._latest.pop(old, None)) is not None:
                self._latest[target] = max(latest, self._latest.get(target, -1))
            self._keep_largest(target, self._largest.pop(old, []))

    def _keep_largest(self, entry_id: int, found: Sequence[tuple[int, Seen]]) -> None:
        ranked = self._largest.setdefault(entry_id, [])
        for pair in found:
            insort(ranked, pair, key=lambda one: -one[1].area_px)
        del ranked[NUM_LARGEST:]

    def resolve(self, entry_id: int) -> int:
        """Return the entry that an entry has become."""
        while entry_id in self._became:
            entry_id = self._became[entry_id]
        return entry_id

    def best(self, entry_id: int) -> tuple[StoredView, Seen] | None:
        """Return the view that shows an entry largest, and its detection there; `None` if no view shows it."""
        return next(iter(self.largest(entry_id)), None)

    def largest(self, entry_id: int) -> list[tuple[StoredView, Seen]]:
        """Return the `NUM_LARGEST` views that show an entry largest, and its detections there, the largest first."""
        return [(self.views[view_id], seen) for view_id, seen in self._largest.get(self.resolve(entry_id), ())]

    def seen_in(self, view: StoredView, entry_id: int) -> Seen | None:
        """Return the largest detection of an entry in a view; `None` if the view does not show it."""
        entry_id = self.resolve(entry_id)
        shown = (one for one in view.seen if one.entry_id is not None and self.resolve(one.entry_id) == entry_id)
        return max(shown, key=lambda one: one.area_px, default=None)

    def latest(self, entry_id: int) -> StoredView | None:
        """Return the view in which an entry was last seen."""
        found = self._latest.get(self.resolve(entry_id))
        return None if found is None else self.views[found]


def pixels_of(jpeg: bytes) -> NDArray[np.uint8]:
    """Return the `(H, W, 3)` image in a JPEG file.

    Raises:
        InvalidArgumentError: The file is no JPEG.
    """
    with _opened(jpeg) as image:
        return np.asarray(image.convert("RGB"))


def jpeg_size(jpeg: bytes) -> tuple[int, int]:
    """Return width and height in pixels of a JPEG file.

    Raises:
        InvalidArgumentError: The file is no JPEG.
    """
    with _opened(jpeg) as image:
        return image.size


@contextmanager
def _opened(jpeg: bytes) -> Iterator[Image.Image]:
    try:
        with Image.open(BytesIO(jpeg), formats=("JPEG",)) as image:
            yield image
    except Exception as error:  # Pillow has many kinds for files that are broken
        raise InvalidArgumentError(f"jpeg: no image: {error}") from error


def thumbnail(pixels: NDArray[np.uint8], size_px: int) -> NDArray[np.uint8]:
    """Return an image of which the longer edge has `size_px` pixels."""
    picture = Image.fromarray(pixels)
    picture.thumbnail((size_px, size_px))
    return np.asarray(picture)


def boxes_of(detections: Detections) -> list[tuple[int, Box]]:
    """Return number of pixels and bounding box of each detection; `(0, (0, 0, 0, 0))` for one without pixels."""
    extents = _core.mask_extents(detections.stored_masks, num_masks=len(detections.labels))
    return [(area_px, (left, top, right, bottom)) for area_px, left, top, right, bottom in extents.tolist()]
