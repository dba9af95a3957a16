"""Houses with Objaverse assets, of which no size is published."""

import os
from pathlib import Path

import pytest

from evonav import HouseError
from evonav.house import load_houses
from evonav.world.embedded import EmbeddedSimulator

FOLDER = (
    Path(os.environ.get("EVONAV_SHARED", Path(__file__).parents[3] / "shared")) / "data/roseh-procthor-100k-history"
)


@pytest.mark.skipif(not FOLDER.exists(), reason=f"{FOLDER} is not there")
@pytest.mark.parametrize("split", ["train", "val"])
def test_houses_load_with_category_defaults_and_their_start_is_free(split: str) -> None:
    strict, lenient = EmbeddedSimulator(), EmbeddedSimulator(allow_unknown_assets=True)
    num_refused = num_free = num_houses = 0
    for house in load_houses(FOLDER / f"objaverse-{split}-100.jsonl.gz"):
        num_houses += 1
        try:
            strict.reset(house.to_json(), name=house.name)
        except HouseError as error:
            num_refused += "assetId" in str(error) and house.name in str(error)
        lenient.reset(house.to_json(), name=house.name)
        assert house.start is not None
        num_free += lenient.is_free(house.start[0])
    assert (num_houses, num_free) == (100, 100)
    assert num_refused == 100
