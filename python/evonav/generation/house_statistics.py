"""Set two sets of houses side by side: features of each house, and whether the sets differ in them."""

import json
import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError
from evonav.generation.house_check import area_of_m2
from evonav.house import House, HouseObject, Room
from evonav.house.files import HouseText
from evonav.statistics import holm
from evonav.statistics.interval import normal_cdf
from evonav.world.embedded import EmbeddedSimulator

ROOM_TYPES = ("Kitchen", "LivingRoom", "Bedroom", "Bathroom")
MIN_HOUSES = 3
"""Least number of houses of a stratum in each set; strata with fewer are left out."""
MIN_SHARE = 0.02
"""Least share of houses with an object of a category for the category to be compared."""
CATEGORY = "number of "
"""Beginning of the names of features that count the objects of a category."""
MIN_STRAIGHT_M = 1.0
"""Least straight distance of a place whose detour is measured."""
Features = dict[str, float]


@dataclass(frozen=True, slots=True)
class HouseSample:
    """The features of one house."""

    stratum: str
    """Name of its room spec; its number of rooms where the file names none."""
    features: Features


@dataclass(frozen=True, slots=True)
class FeatureComparison:
    """A feature in two sets of houses: means within strata, weighted alike in both sets."""

    name: str
    mean_a: float
    mean_b: float
    effect: float
    """Difference in standard deviations within a stratum."""
    p: float
    """Two-sided, of the difference, by the normal distribution."""
    holm: float
    """p adjusted for the number of features."""


@dataclass(frozen=True, slots=True)
class HouseComparison:
    """Two sets of houses beside each other."""

    num_houses: tuple[int, int]
    """Number of houses in strata that both sets have."""
    num_left_out: tuple[int, int]
    """Number of houses in other strata."""
    strata: Mapping[str, tuple[int, int]]
    """Number of houses in each stratum."""
    features: tuple[FeatureComparison, ...]


def sample_of(text: HouseText) -> HouseSample:
    """Measure a house. Assets without a known size have the usual one of their category.

    Raises:
        HouseError: The house is malformed.
        SimulationError: The agent fits nowhere.
    """
    house = House(text.text, name=text.name)
    spec = json.loads(text.text)["metadata"].get("roomSpecId")
    stratum = f"{len(house.rooms)} rooms" if spec is None else str(spec)
    return HouseSample(stratum, features_of(house) | walking_features(house))


def walking_features(house: House) -> Features:
    """Return how far the agent can walk from the start of a house: free floor, and lengths of paths.

    Raises:
        HouseError: The house has no start.
        SimulationError: The agent fits nowhere.
    """
    simulator = EmbeddedSimulator(allow_unknown_assets=True)
    pose = simulator.reset(house)
    places = simulator.reachable_positions()
    paths_m = np.asarray(simulator.path_lengths_m(pose.position_m, places))
    straight_m = np.hypot(places[:, 0] - pose.x_m, places[:, 2] - pose.z_m)
    is_far = straight_m >= MIN_STRAIGHT_M
    detours = paths_m[is_far] / straight_m[is_far]
    return {
        "free floor m2": float(len(places)) * simulator.config.grid_m**2,
        "path to a place m": float(paths_m.mean()),
        "longest path m": float(paths_m.max()),
        "path by straight line": float(detours.mean()) if is_far.any() else 1.0,
    }


def features_of(house: House) -> Features:
    """Return the features of a house: its structure, its furniture, and the number of objects of each category."""
    found: Features = dict(_structure(house))
    by_room: dict[str, list[HouseObject]] = defaultdict(list)
    for item in house.objects:
        by_room[item.room_id or ""].append(item)
    for room_type in ROOM_TYPES:
        rooms = [room for room in house.rooms if room.room_type == room_type]
        if not rooms:
            continue
        roots = [sum(item.parent_id is None for item in by_room[room.id]) for room in rooms]
        on_them = [sum(item.parent_id is not None for item in by_room[room.id]) for room in rooms]
        found[f"{room_type}: area m2"] = _mean(area_of_m2(room.polygon_m) for room in rooms)
        found[f"{room_type}: on floor and walls"] = _mean(roots)
        found[f"{room_type}: on furniture"] = _mean(on_them)
    categories = Counter(item.category or "unknown" for item in house.objects)
    found["objects"] = float(len(house.objects))
    found["categories"] = float(len(categories))
    found["asset groups"] = float(len({item.id.rpartition("|")[0] for item in house.objects if _is_member(item)}))
    found.update({f"{CATEGORY}{category}": float(count) for category, count in categories.items()})
    return found


def _structure(house: House) -> Iterable[tuple[str, float]]:
    areas_m2 = [area_of_m2(room.polygon_m) for room in house.rooms]
    yield "rooms", float(len(house.rooms))
    yield "area m2", sum(areas_m2)
    yield "aspect ratio of rooms", _mean(_aspect(room) for room in house.rooms)
    yield "corners of rooms", _mean(len(room.polygon_m) for room in house.rooms)
    frames = sum(door.asset_id.startswith("Doorframe") for door in house.doors)
    yield "doors", float(len(house.doors) - frames)
    yield "doorframes", float(frames)
    yield "double doors", float(sum("Double" in door.asset_id for door in house.doors))
    yield "windows", float(len(house.windows))
    yield "open sides of walls", float(sum(wall.is_empty for wall in house.walls))
    yield "height m", max(wall.height_m for wall in house.walls)


def _is_member(item: HouseObject) -> bool:
    """Return whether the id of an object is that of a member of an asset group: `room|group|member`."""
    numbers = item.id.split("|")
    return len(numbers) == len(("room", "group", "member")) and all(number.isdigit() for number in numbers)


def _aspect(room: Room) -> float:
    edges = np.ptp(np.array(room.polygon_m), axis=0)
    return float(edges.max() / edges.min())


def _mean(values: Iterable[float]) -> float:
    return float(np.mean(list(values)))


def compare_houses(a: Sequence[HouseSample], b: Sequence[HouseSample]) -> HouseComparison:
    """Compare two sets of houses, within strata.

    Sets may have other mixes of room specs. So houses are compared with those of the same spec, and a spec counts as
    much as it has houses in the smaller of the two sets.

    Raises:
        InvalidArgumentError: No spec has enough houses in both sets.
    """
    sets = [by_stratum(a), by_stratum(b)]
    shared = [name for name in sets[0] if min(len(one.get(name, ())) for one in sets) >= MIN_HOUSES]
    if not shared:
        raise InvalidArgumentError(f"the sets have no room spec of which both have at least {MIN_HOUSES} houses")
    names = _feature_names([sample for one in sets for name in shared for sample in one[name]])
    weights = np.array([min(len(one[name]) for one in sets) for name in shared], dtype=np.float64)
    weights /= weights.sum()
    averages, variances, errors = [], [], []
    for one in sets:
        tables = [feature_table(one[name], names) for name in shared]
        averages.append(sum(w * t.mean(axis=0) for w, t in zip(weights, tables, strict=True)))
        variances.append(sum(w * t.var(axis=0, ddof=1) for w, t in zip(weights, tables, strict=True)))
        errors.append(sum(w**2 * t.var(axis=0, ddof=1) / len(t) for w, t in zip(weights, tables, strict=True)))
    difference = np.asarray(averages[0] - averages[1])
    spread = np.sqrt(np.asarray(variances[0] + variances[1]) / 2.0)
    error = np.sqrt(np.asarray(errors[0] + errors[1]))
    ps = [_p(d, e) for d, e in zip(difference.tolist(), error.tolist(), strict=True)]
    effects = [_ratio(d, s) for d, s in zip(difference.tolist(), spread.tolist(), strict=True)]
    columns = zip(names, averages[0], averages[1], effects, ps, holm(ps), strict=True)
    features = [FeatureComparison(name, float(a), float(b), *rest) for name, a, b, *rest in columns]
    strata = {name: (len(sets[0][name]), len(sets[1][name])) for name in shared}
    counts = tuple(sum(strata[name][i] for name in shared) for i in range(2))
    return HouseComparison(
        num_houses=(counts[0], counts[1]),
        num_left_out=(len(a) - counts[0], len(b) - counts[1]),
        strata=strata,
        features=tuple(features),
    )


def by_stratum(samples: Sequence[HouseSample]) -> dict[str, list[Features]]:
    """Return the features of houses by their stratum, in the order of its names."""
    found: dict[str, list[Features]] = defaultdict(list)
    for sample in samples:
        found[sample.stratum].append(sample.features)
    return dict(sorted(found.items()))


def _feature_names(houses: Sequence[Features]) -> list[str]:
    """Return the features of at least some houses, in the order in which houses have them; categories last, by name."""
    shares = Counter(name for features in houses for name in features)
    usual = [name for name in shares if shares[name] >= MIN_SHARE * len(houses)]
    return [name for name in usual if not name.startswith(CATEGORY)] + sorted(
        name for name in usual if name.startswith(CATEGORY)
    )


def feature_table(houses: Sequence[Features], names: Sequence[str]) -> NDArray[np.float64]:
    """Return named features of `N` houses, `(N, M)`; 0 where a house has none, such as the area of its kitchen."""
    return np.array([[features.get(name, 0.0) for name in names] for features in houses])


def _p(difference: float, error: float) -> float:
    if error == 0.0:
        return 1.0 if difference == 0.0 else 0.0
    return 2.0 * normal_cdf(-abs(difference) / error)


def _ratio(difference: float, spread: float) -> float:
    if spread == 0.0:
        return 0.0 if difference == 0.0 else math.copysign(math.inf, difference)
    return float(difference / spread)
