"""Encode camera images as AI2-THOR sends them: raw bytes, bottom row first."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.thor.events.colors import Palette
from evonav.thor.transport.fifo import Field, FieldType
from evonav.world.camera import Images
from evonav.world.simulator import Frame

FAR_M = 20.0
"""Depth in metres where nothing is in reach: the far plane of the agent's camera."""


@dataclass(frozen=True, slots=True)
class ImageKinds:
    """The kinds of images that an event contains."""

    rgb: bool
    depth: bool
    instances: bool
    classes: bool

    @property
    def needs_instances(self) -> bool:
        """Whether instance ids must be rendered."""
        return self.instances or self.classes


_AGENT = (FieldType.RGB_IMAGE, FieldType.DEPTH_IMAGE, FieldType.IDS_IMAGE, FieldType.CLASSES_IMAGE)
_THIRD_PARTY = (
    *(FieldType.THIRD_PARTY_IMAGE, FieldType.THIRD_PARTY_DEPTH),
    *(FieldType.THIRD_PARTY_IMAGE_IDS, FieldType.THIRD_PARTY_CLASSES),
)


def encode(frame: Frame | Images, kinds: ImageKinds, palette: Palette, *, is_third_party: bool = False) -> list[Field]:
    """Return the images of one camera, each with its field type."""
    rgb, depth, instances, classes = _THIRD_PARTY if is_third_party else _AGENT
    far_m = np.inf if is_third_party else FAR_M  # a third-party camera has a far plane of its own
    fields: list[Field] = []
    if kinds.rgb and frame.rgb is not None:
        fields.append((rgb, np.ascontiguousarray(frame.rgb[::-1])))
    if kinds.depth:
        fields.append((depth, np.minimum(frame.depth_m[::-1], np.float32(far_m))))
    if kinds.instances and frame.instances is not None:
        fields.append((instances, _painted(frame.instances, palette.instances_rgba)))
    if kinds.classes and frame.instances is not None:
        fields.append((classes, _painted(frame.instances, palette.classes_rgba)))
    return fields


def blank(width_px: int, height_px: int) -> Images:
    """Return the images of a scene without a house."""
    size = (height_px, width_px)
    depth_m = np.full(size, FAR_M, dtype=np.float32)
    return Images(depth_m, np.zeros((*size, 3), dtype=np.uint8), np.zeros(size, dtype=np.int32))


def _painted(instances: NDArray[np.int32], rgba: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Return `(H, W)` pixels of four bytes, bottom row first."""
    painted: NDArray[np.uint32] = np.take(rgba.view(np.uint32)[:, 0], instances[::-1])
    return painted
