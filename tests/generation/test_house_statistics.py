"""Two sets of houses side by side: what differs is found, what does not is not, whatever the mix of room specs."""

import json
import random
from itertools import islice

import pytest

from evonav.errors import InvalidArgumentError
from evonav.generation.house_statistics import HouseSample, compare_houses, features_of, sample_of
from evonav.house import House
from evonav.house.files import HouseText, HouseTexts


def drawn(count: int, seed: int, *, share_of_large: float, shift: float = 0.0) -> list[HouseSample]:
    """Houses whose area depends on their spec, and a feature that is shifted."""
    stream = random.Random(seed)
    samples = []
    for _ in range(count):
        is_large = stream.random() < share_of_large
        area = stream.gauss(100.0 if is_large else 30.0, 5.0)
        features = {"area m2": area, "doors": stream.gauss(3.0 + shift, 1.0), "windows": stream.gauss(2.0, 1.0)}
        samples.append(HouseSample("large" if is_large else "small", features))
    return samples


def test_a_shift_is_found_and_another_mix_is_not_taken_for_one() -> None:
    found = compare_houses(drawn(600, 1, share_of_large=0.2), drawn(400, 2, share_of_large=0.7, shift=0.5))
    by_name = {one.name: one for one in found.features}
    assert by_name["doors"].holm < 1e-4
    assert by_name["doors"].effect == pytest.approx(-0.5, abs=0.15)
    assert by_name["area m2"].holm > 0.05
    assert abs(by_name["area m2"].mean_a - by_name["area m2"].mean_b) < 1.5
    assert by_name["windows"].holm > 0.05


def test_strata_without_partners_are_left_out() -> None:
    a = drawn(50, 1, share_of_large=0.0) + [HouseSample("odd", {"doors": 1.0})] * 9
    found = compare_houses(a, drawn(50, 2, share_of_large=0.0))
    assert (found.num_houses, found.num_left_out) == ((50, 50), (9, 0))
    with pytest.raises(InvalidArgumentError, match="no room spec"):
        compare_houses(drawn(9, 1, share_of_large=0.0), drawn(9, 1, share_of_large=1.0))


def test_features_of_a_house_are_those_of_its_file() -> None:
    texts = list(islice(HouseTexts("bundled"), 5))
    for text in texts:
        document, features = json.loads(text.text), features_of(House(text.text))
        assert sample_of(text).stratum == document["metadata"]["roomSpecId"]
        objects = [item for root in document["objects"] for item in [root, *root.get("children", [])]]
        assert features["objects"] == len(objects)
        assert features["rooms"] == len(document["rooms"])
        assert features["windows"] == len(document["windows"])
        assert features["height m"] == max(c["y"] for wall in document["walls"] for c in wall["polygon"])
        groups = {tuple(i["id"].split("|")[:2]) for i in objects if i["id"].count("|") == 2 and i["id"][0].isdigit()}
        assert features["asset groups"] == len(groups)
    square = [(0.0, 0.0), (0.0, 3.0), (6.0, 3.0), (6.0, 0.0)]
    document["rooms"] = document["rooms"][:1]
    document["rooms"][0]["floorPolygon"] = [{"x": x, "y": 0.0, "z": z} for x, z in square]
    document |= {"objects": [], "walls": document["walls"][:0], "doors": [], "windows": []}
    document["walls"] = [
        {
            "id": "wall|0",
            "roomId": document["rooms"][0]["id"],
            "polygon": [{"x": 0, "y": y, "z": z} for y in (0, 3) for z in (0, 3)],
            "material": {"name": "PureWhite"},
        }
    ]
    features = features_of(House(json.dumps(document)))
    assert (features["area m2"], features["aspect ratio of rooms"]) == (18.0, 2.0)
    del document["metadata"]["roomSpecId"]
    assert sample_of(HouseText("one", json.dumps(document))).stratum == "1 rooms"
