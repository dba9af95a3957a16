"""Random looks of a house: other materials, other colours, another light.

Only colours change. Depth, instances, collision and navigation stay as they are, bit for bit. What a change draws
depends on its seed and on the names of the things in the house alone, so a look is the same in every process and
order.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Literal, TypeAlias

from evonav.errors import InvalidArgumentError

Split: TypeAlias = Literal["train", "val", "test"]
"""A split of ProcTHOR's assets."""

Range: TypeAlias = tuple[float, float]

_SEEDS = 2**64


@dataclass(frozen=True, slots=True)
class Materials:
    """Give surfaces other materials of their class.

    A floor becomes another of ProcTHOR's floors, the walls of a room get another paint, tile or plaster, and an object
    gets the materials of another asset of its category. Windows stay. Objects of the same asset, and the walls of one
    room, still look alike.

    Examples:
        >>> from evonav.world.appearance import Materials
        >>> Materials(seed=3, categories=["Sofa"], room_types=["LivingRoom"])
        Materials(seed=3, categories=('Sofa',), room_types=('LivingRoom',), splits=None)
    """

    seed: int = 0
    categories: Sequence[str] | None = None
    """Categories of what changes, such as `Sofa`, `Floor`, `Wall`, `Ceiling` or `Doorway`. Default: all."""
    room_types: Sequence[str] | None = None
    """Types of the rooms in which it is, such as `Kitchen`. Default: all, and what is in no room."""
    splits: Sequence[Split] | None = None
    """Splits of ProcTHOR's assets whose materials are used, beside the assets of all splits. Default: all."""

    def __post_init__(self) -> None:
        """Check the seed and the names."""
        _check_seed(self.seed)
        for name in ("categories", "room_types", "splits"):
            object.__setattr__(self, name, _names(name, getattr(self, name)))


@dataclass(frozen=True, slots=True)
class Colors:
    """Give surfaces any colours, as strong and as bright as AI2-THOR's `RandomizeColors` does; textures stay.

    A material of an object has one colour. Pictures, screens and what is seen through windows stay.
    """

    seed: int = 0
    categories: Sequence[str] | None = None
    """Categories of what changes, as in `Materials`."""
    room_types: Sequence[str] | None = None
    """Types of the rooms in which it is, as in `Materials`."""

    def __post_init__(self) -> None:
        """Check the seed and the names."""
        _check_seed(self.seed)
        for name in ("categories", "room_types"):
            object.__setattr__(self, name, _names(name, getattr(self, name)))


@dataclass(frozen=True, slots=True)
class Lighting:
    """Give the light in each room, and the sun, another brightness and colour; seen in the style `default` alone.

    A fifth of a room's light stays as it is. Rooms with an open border between them have one light.
    """

    seed: int = 0
    brightness: Range = (0.5, 1.5)
    """Least and greatest factor of the brightness."""
    randomize_color: bool = True
    """Whether the colour changes too."""
    hue: Range = (0.0, 1.0)
    """Least and greatest hue, from 0 to 1; 0 and 1 are red, 1/3 is green, 2/3 is blue."""
    saturation: Range = (0.0, 0.3)
    """Least and greatest saturation, from 0 (white) to 1. AI2-THOR's default, (0.5, 1), gives rooms of one colour."""
    synchronized: bool = False
    """Whether all rooms and the sun get the same factor and colour."""

    def __post_init__(self) -> None:
        """Check the seed and that ranges are two numbers; the core checks their limits."""
        _check_seed(self.seed)
        for name in ("brightness", "hue", "saturation"):
            object.__setattr__(self, name, _range(name, getattr(self, name)))


Change: TypeAlias = Materials | Colors | Lighting


def with_change(changes: Sequence[Change], change: Change) -> tuple[Change, ...]:
    """Return changes and one more, without those of its kind that it replaces as a whole."""
    return (*(one for one in changes if not _replaces(change, one)), change)


def changes_json(changes: Sequence[Change]) -> str:
    """Return changes as the core reads them.

    Raises:
        InvalidArgumentError: One is no change.
    """
    return json.dumps([_document(change) for change in changes])


def _document(change: Change) -> dict[str, object]:
    if not isinstance(change, Materials | Colors | Lighting):
        raise InvalidArgumentError(f"{change!r} is no change of a look: expected `Materials`, `Colors` or `Lighting`")
    return {"kind": type(change).__name__.lower(), **asdict(change)}


def _replaces(change: Change, earlier: Change) -> bool:
    if type(change) is not type(earlier):
        return False
    if isinstance(change, Lighting):
        return True
    is_everything = change.categories is None and change.room_types is None
    return is_everything or replace(change, seed=0) == replace(earlier, seed=0)


def _check_seed(seed: object) -> None:
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < _SEEDS:
        raise InvalidArgumentError(f"argument `seed` is {seed!r}, expected an integer from 0 to 2^64 - 1")


def _names(name: str, value: object) -> tuple[str, ...] | None:
    if value is None:
        return None
    if isinstance(value, str) or not isinstance(value, Sequence) or not all(isinstance(one, str) for one in value):
        raise InvalidArgumentError(f"argument `{name}` is {value!r}, expected a list of names")
    return tuple(value)


def _range(name: str, value: object) -> Range:
    if isinstance(value, Sequence) and len(value) == 2 and all(_is_number(one) for one in value):
        return (float(value[0]), float(value[1]))
    raise InvalidArgumentError(f"argument `{name}` is {value!r}, expected two numbers")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
