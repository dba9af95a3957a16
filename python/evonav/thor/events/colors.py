"""Assign AI2-THOR's colours to instances and classes: the first three bytes of a name's MD5 (`ColorEncoding.cs`)."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.thor.scene import Scene
from evonav.world.simulator import SceneObject

Color = tuple[int, int, int]
_BACKGROUND: Color = (0, 0, 0)


@dataclass(frozen=True, slots=True)
class Palette:
    """Colours of one version of a scene."""

    entries: list[dict[str, object]]
    """The metadata's `colors`: one entry for each class and each instance, by name."""
    instances_rgba: NDArray[np.uint8]
    """Colours by instance id, shape `(1 + num_bodies, 4)`; row 0 is the background."""
    classes_rgba: NDArray[np.uint8]
    """Colours of the bodies' classes, shape `(1 + num_bodies, 4)`; row 0 is the background."""


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
