"""Which houses a named subset takes, before any task is made."""

from collections.abc import Iterable

from evonav.errors import HouseError, InvalidArgumentError
from evonav.house import House
from evonav.house.files import HouseText
from evonav.tasks.records import sha256_of
from evonav.tasks.subsets import Subset, SubsetError, parse_subset, subset_key

MIN_ROOMS = 2
"""Of the houses that tasks are made of."""


def wanted_of(name: str, split: str, limit: int | None) -> Subset:
    """A named subset, checked against what else is asked for.

    Raises:
        InvalidArgumentError: There is a limit as well.
        SubsetError: The name is none, or of another split.
    """
    subset = parse_subset(name)
    if limit is not None:
        raise InvalidArgumentError(f"arguments `subset` and `limit` are {name!r} and {limit}, expected one of them")
    if subset.split != split:
        raise SubsetError(f"subset {name!r}: the houses are of split {split!r}, not of {subset.split!r}")
    return subset


def house_order(houses: Iterable[HouseText]) -> list[int]:
    """Places of multi-room houses in their file, in the order of subsets; a house that is there twice counts once.

    Reads all houses. Those that cannot be read can give no task, and are left out.
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
