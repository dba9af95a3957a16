"""Houses with Objaverse assets, of which no size is published."""

import json
from collections.abc import Iterable

import pytest
from recorded_data import data_path, needs_data

from evonav.errors import HouseError
from evonav.house import House, bundled_houses, stream_houses
from evonav.world.embedded import EmbeddedSimulator

FOLDER = "roseh-procthor-100k-history"


def with_unknown_assets(house: House) -> House:
    """Return the house with every third object on the floor made an asset that no catalogue has."""
    document = json.loads(house.to_json())
    for index, entry in enumerate(document["objects"][::3]):
        entry["assetId"] = f"{index:032x}"
    return House(json.dumps(document), name=house.name)


def check_category_defaults(houses: Iterable[House], num_expected: int) -> None:
    strict, lenient = EmbeddedSimulator(), EmbeddedSimulator(allow_unknown_assets=True)
    num_refused = num_free = num_houses = 0
    for house in houses:
        num_houses += 1
        try:
            strict.reset(house.to_json(), name=house.name)
        except HouseError as error:
            num_refused += "assetId" in str(error) and house.name in str(error)
        lenient.reset(house.to_json(), name=house.name)
        assert house.start is not None
        num_free += lenient.is_free(house.start[0])
    assert (num_houses, num_free, num_refused) == (num_expected, num_expected, num_expected)


def test_houses_with_unknown_assets_load_with_category_defaults() -> None:
    check_category_defaults(map(with_unknown_assets, bundled_houses(10)), 10)


@pytest.mark.parametrize("split", ["train", "val"])
@needs_data(FOLDER)
def test_recorded_houses_load_with_category_defaults_and_their_start_is_free(split: str) -> None:
    check_category_defaults(stream_houses(data_path(f"{FOLDER}/objaverse-{split}-100.jsonl.gz")), 100)
