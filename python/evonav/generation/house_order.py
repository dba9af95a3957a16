"""Order the houses of a named subset before any task is generated."""

from collections.abc import Iterable

from evonav.errors import HouseError, InvalidArgumentError
from evonav.house import House
from evonav.house.files import HouseText
from evonav.tasks.records import sha256_of
from evonav.tasks.subsets import Subset, SubsetError, parse_subset, subset_key

MIN_ROOMS = 2
"""Smallest number of rooms in a house that can give a task."""


def checked_subset(name: str, split: str, limit: int | None) -> Subset:
    """Parse the name of a subset and check it against the other options.

    Raises:
        InvalidArgumentError: A limit is given as well.
        SubsetError: The name is malformed or of another split.
    """
    subset = parse_subset(name)
    if limit is not None:
        raise InvalidArgumentError(f"arguments `subset` and `limit` are {name!r} and {limit}, expected one of them")
    if subset.split != split:
        raise SubsetError(f"subset {name!r}: the houses are of split {split!r}, not of {subset.split!r}")
    return subset


def house_order(houses: Iterable[HouseText]) -> list[int]:
    """Return the indices of multi-room houses in their file, in the order of subsets; each distinct house once.

    All houses are read. Malformed houses give no task and are left out.
    """
    first: dict[str, int] = {}
    for index, text in enumerate(houses):
        try:
            house = House(text.text, name=text.name)
        except HouseError:
            continue
        if len(house.rooms) >= MIN_ROOMS:
            first.setdefault(sha256_of(house.to_json().encode()), index)
    return [first[sha256] for sha256 in sorted(first, key=subset_key)]
