"""Collect what is shown of a house: its plan, its numbers, what is odd in it, and whether it gives a task."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from evonav.counted import counted
from evonav.drawing.pictures import Picture, house_picture
from evonav.generation.house_check import HouseCheck, odd_bodies, task_outcome
from evonav.generation.validation.problems import KINDS, ProblemKind
from evonav.house import House


@dataclass(frozen=True, slots=True)
class HouseView:
    """Everything that is shown of a house."""

    found: HouseCheck
    summary: str
    rooms: tuple[tuple[str, str, str, str], ...]
    """Id, type, floor area and number of objects of each room."""
    task: str
    odd: str
    """Flaws that published houses have, too; empty if there are none."""
    picture: Picture | None


def house_view(found: HouseCheck, *, allow_unknown_assets: bool = False) -> HouseView:
    """Collect what is shown of a house.

    Args:
        allow_unknown_assets: Give assets without a known size the usual one of their category.
    """
    house = found.house
    if house is None:
        return HouseView(found, "cannot be read", (), "no", "", None)
    is_built = found.num_places > 0
    odd = odd_bodies(house, allow_unknown_assets=allow_unknown_assets) if is_built else Counter[ProblemKind]()
    return HouseView(
        found=found,
        summary=summary_of(house),
        rooms=tuple(_rooms(house)),
        task=task_outcome(house, allow_unknown_assets=allow_unknown_assets) if is_built else "no: the house is wrong",
        odd=_odd(odd),
        picture=house_picture(house),
    )


def summary_of(house: House) -> str:
    """Return the numbers of a house in one line."""
    area_m2 = sum(area_of_m2(room.polygon_m) for room in house.rooms)
    parts = (counted(len(house.rooms), "room"), f"{area_m2:.1f} m2", counted(len(house.objects), "object"))
    categories = {item.category for item in house.objects}
    return f"{', '.join(parts)} of {counted(len(categories), 'category')}, {counted(len(house.doors), 'door')}"


def area_of_m2(outline_m: Sequence[tuple[float, float]]) -> float:
    """Return the area that an outline encloses."""
    following = zip(outline_m, [*outline_m[1:], *outline_m[:1]], strict=True)
    return abs(sum(x0 * z1 - x1 * z0 for (x0, z0), (x1, z1) in following)) / 2.0


def _rooms(house: House) -> list[tuple[str, str, str, str]]:
    inside = Counter(item.room_id for item in house.objects)
    return [
        (room.id, room.room_type, f"{area_of_m2(room.polygon_m):.1f}", str(inside[room.id])) for room in house.rooms
    ]


def _odd(found: Counter[ProblemKind]) -> str:
    parts = [f"{KINDS[kind]} ({number})" for kind, number in sorted(found.items())]
    return f"{'; '.join(parts)}: published houses have such flaws, too" if parts else ""
