"""What objects cover of the floor plan, against their boxes and an independent count of an L-counter's area."""

import json

import pytest
import shapely

from evonav import _core
from evonav.errors import HouseError
from evonav.house import House, bundled_houses

SIZES_M = {asset: size_m for asset, _, size_m in _core.assets()}


OPENING = frozenset({"Box", "Fridge", "Laptop", "Microwave", "Safe", "Toilet", "WashingMachine", "GarbageBag"})
"""Their lids and doors, shut or not, are not where the asset's box ends."""


@pytest.mark.parametrize("number", range(4))
def test_footprints_fill_the_box_of_their_asset(number: int) -> None:
    house = list(bundled_houses(4))[number]
    found = house.footprints(allow_unknown_assets=False)
    assert [entry[0] for entry in found] == [entry.id for entry in house.objects]
    num_checked = 0
    for (_, category, parts), entry in zip(found, house.objects, strict=True):
        if category in OPENING or entry.rotation_deg[0] or entry.rotation_deg[2]:
            continue
        width_m, height_m, depth_m = SIZES_M[entry.asset_id]
        x_m, y_m, z_m = entry.position_m
        shadow = shapely.union_all([shapely.MultiPoint(outline).convex_hull for outline, _, _ in parts])
        # Yaw is clockwise seen from above, Shapely's angles are not: this turns back.
        own = shapely.affinity.rotate(shadow, entry.rotation_deg[1], origin=(x_m, z_m))
        box = (x_m - width_m / 2, z_m - depth_m / 2, x_m + width_m / 2, z_m + depth_m / 2)
        assert own.bounds == pytest.approx(box, abs=0.01), category
        low_m, high_m = min(low for _, low, _ in parts), max(high for _, _, high in parts)
        assert high_m - low_m == pytest.approx(height_m, abs=0.01), category
        if entry.parent_id is None:
            assert (low_m + high_m) / 2 == pytest.approx(y_m, abs=0.01)
        num_checked += 1
    assert num_checked > 20


@pytest.mark.parametrize("number", range(4))
def test_outlines_are_those_of_the_parts_to_the_millimetre_each_once_lower_ones_first(number: int) -> None:
    house = list(bundled_houses(4))[number]
    found = iter(_core.object_outlines(house))
    for object_id, category, parts in house.footprints(allow_unknown_assets=True):
        outlines = [[(round(x, 3), round(z, 3)) for x, z in one] for one, _, _ in sorted(parts, key=lambda one: one[2])]
        once = [outline for index, outline in enumerate(outlines) if outline not in outlines[:index]]
        xs, zs = zip(*(point for outline, _, _ in parts for point in outline), strict=True)
        ys = [height for _, low, high in parts for height in (low, high)]
        box = [(min(axis), max(axis)) for axis in (xs, ys, zs)]
        (x0, x1), _, (z0, z1) = [(round(low, 3), round(high, 3)) for low, high in box]
        centre_m, size_m = tuple((low + high) / 2 for low, high in box), tuple(high - low for low, high in box)
        corners_m = [(x0, z0), (x1, z0), (x1, z1), (x0, z1)]
        assert next(found) == (object_id, category, centre_m, size_m, corners_m, once)
    assert next(found, None) is None


def test_an_l_counter_is_an_l_and_an_unknown_asset_is_an_error_unless_allowed() -> None:
    document = json.loads(next(iter(bundled_houses(1))).to_json())
    counter = {**document["objects"][0], "id": "counter", "assetId": "Countertop_L_8x6", "children": []}
    document["objects"] = [counter]
    ((_, category, parts),) = House(json.dumps(document), name="L").footprints(allow_unknown_assets=False)
    assert category == "CounterTop"
    shadow = shapely.union_all([shapely.MultiPoint(outline).convex_hull for outline, _, _ in parts])
    assert shadow.area < 0.7 * shadow.envelope.area
    counter["assetId"] = "no_such_asset"
    house = House(json.dumps(document), name="unknown")
    with pytest.raises(HouseError, match="no_such_asset"):
        house.footprints(allow_unknown_assets=False)
