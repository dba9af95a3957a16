"""Encode camera images as AI2-THOR sends them: raw bytes, bottom row first.

Instances and classes have AI2-THOR's colours: the first three bytes of a name's MD5 (`ColorEncoding.cs`).
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.thor.scene import Scene
from evonav.thor.transport.fifo import Field, FieldType
from evonav.world.camera import Images
from evonav.world.simulator import SceneObject

FAR_M = 20.0
"""Depth in metres where nothing is in reach: the far plane of the agent's camera."""


Color = tuple[int, int, int]
_BACKGROUND: Color = (0, 0, 0)


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


@dataclass(frozen=True, slots=True)
class Palette:
    """Colours of one version of a scene."""

    entries: list[dict[str, object]]
    """The metadata's `colors`: one entry for each class and each instance, by name."""
    instances_rgba: NDArray[np.uint8]
    """Colours by instance id, shape `(1 + num_bodies, 4)`; row 0 is the background."""
    classes_rgba: NDArray[np.uint8]
    """Colours of the bodies' classes, shape `(1 + num_bodies, 4)`; row 0 is the background."""


_AGENT = (FieldType.RGB_IMAGE, FieldType.DEPTH_IMAGE, FieldType.IDS_IMAGE, FieldType.CLASSES_IMAGE)
_THIRD_PARTY = (
    *(FieldType.THIRD_PARTY_IMAGE, FieldType.THIRD_PARTY_DEPTH),
    *(FieldType.THIRD_PARTY_IMAGE_IDS, FieldType.THIRD_PARTY_CLASSES),
)


def encode(frame: Images, kinds: ImageKinds, palette: Palette, *, is_third_party: bool = False) -> list[Field]:
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


def palette_of(scene: Scene) -> Palette:
    """Return the colours of the scene in its present version."""
    bodies = scene.simulator.objects if scene.house is not None else ()
    names = [instance_name(body) for body in bodies]
    colors = assign([*(body.category for body in bodies), *names])
    entries: list[dict[str, object]] = []
    # The client takes an instance's class from its id, up to the first "|". Ids that do not begin with their class
    # ("2|0", "small|2|0") are also listed under that prefix, before the entries that the client's own tables use.
    for body, name in zip(bodies, names, strict=True):
        if name.split("|")[0] != body.category:
            entries.append({"name": body.category, "color": colors[name]})
    for name in dict.fromkeys([*(body.category for body in bodies), *names]):
        entries.append({"name": name, "color": colors[name]})
    return Palette(
        entries,
        _table(colors[name] for name in names),
        _table(colors[body.category] for body in bodies),
    )


def instance_name(body: SceneObject) -> str:
    """Return a body's name in the colour tables; a ceiling has its room's id, as the room's floor has."""
    return f"Ceiling|{body.id}" if body.kind == "ceiling" else body.id


def assign(names: Iterable[str]) -> dict[str, Color]:
    """Give each name a colour of its own; where two MD5s agree, the alphabetically later name gets another colour."""
    colors: dict[str, Color] = {}
    taken = {_BACKGROUND}
    for name in sorted(set(names)):
        salt = ""
        while (color := _hashed(name + salt)) in taken:
            salt += "+"
        taken.add(color)
        colors[name] = color
    return colors


def _hashed(name: str) -> Color:
    # The digest is an identifier, not a secret. Unity encodes in UTF-8; ids from JSON may contain lone surrogates.
    digest = hashlib.md5(name.encode("utf-8", "surrogatepass"), usedforsecurity=False).digest()
    return (digest[0], digest[1], digest[2])


def _table(colors: Iterable[Color]) -> NDArray[np.uint8]:
    return np.array([(*color, 255) for color in (_BACKGROUND, *colors)], dtype=np.uint8)
