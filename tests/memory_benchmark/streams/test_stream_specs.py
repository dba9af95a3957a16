"""The streams of the default benchmark, their names, and the cache of plans."""

from collections import Counter

import pytest

import evonav
from evonav.errors import HouseError, InvalidArgumentError
from evonav.memory_benchmark.streams import make_plan, make_stream, plan_of
from evonav.memory_benchmark.streams.plan import cached_plan
from evonav.memory_benchmark.streams.spec import KINDS, StreamSpec, read_house, reference_specs

SMALL = StreamSpec("S1", "bundled:4", frames_a_visit=12)


def test_the_default_benchmark_has_five_houses_with_three_seeds_of_every_kind():
    specs = reference_specs()
    assert len({spec.house for spec in specs}) == 5
    assert all(3 <= len(read_house(house).rooms) <= 5 for house in {spec.house for spec in specs})
    assert Counter(spec.kind for spec in specs) == {kind: {"S7": 5, "S8": 45}.get(kind, 15) for kind in KINDS}
    assert len({spec.name for spec in specs}) == len(specs)


def test_the_quick_benchmark_has_one_house_and_one_seed():
    specs = reference_specs(quick=True)
    assert {spec.house for spec in specs} == {"bundled:3"}
    assert Counter(spec.kind for spec in specs) == {kind: 3 if kind == "S8" else 1 for kind in KINDS}


def test_houses_of_a_file_of_ones_own_are_taken(tmp_path):
    file = tmp_path / "mine.jsonl"
    file.write_text("\n".join(house.to_json() for house in evonav.load_houses("bundled")[:4]))
    specs = reference_specs(file, kinds=["S0"])
    assert [spec.house for spec in specs[::3]] == [f"{file}:3", f"{file}:4"]
    assert specs[0].name == "S0/mine-0003/0"
    assert len(make_stream(specs[0]).plan.frames) == specs[0].frames_a_visit


def test_houses_of_a_list_and_of_a_folder_are_found_by_their_names(tmp_path):
    houses = evonav.load_houses("bundled")[:4]
    (tmp_path / "list.json").write_text("[" + ",".join(house.to_json() for house in houses) + "]")
    (tmp_path / "one.json").write_text(houses[2].to_json())
    names = [spec.house for spec in reference_specs(tmp_path, kinds=["S0"])[::3]]
    assert names == [f"{tmp_path}/list.json:1[2]", f"{tmp_path}/list.json:1[3]", f"{tmp_path}/one.json:1"]
    assert [read_house(name).to_json() for name in names] == [houses[at].to_json() for at in (2, 3, 2)]
    with pytest.raises(HouseError, match=r"list.json:1\[7\]: no such house in"):
        read_house(f"{tmp_path}/list.json:1[7]")
    with pytest.raises(HouseError, match="bundled:999"):
        read_house("bundled:999")


def test_houses_with_too_few_rooms_are_refused(tmp_path):
    file = tmp_path / "small.jsonl"
    file.write_text(evonav.load_houses("bundled")[1].to_json())
    with pytest.raises(HouseError, match=r"small.jsonl: no house has at least 3 rooms"):
        reference_specs(file)


@pytest.mark.parametrize(
    ("field", "value"), [("kind", "S10"), ("seed", -1), ("width_px", 0), ("frames_a_visit", 0), ("max_objects", 0)]
)
def test_a_bad_value_is_named(field, value):
    with pytest.raises(InvalidArgumentError, match=f"{field} = {value!r}"):
        StreamSpec(**{"kind": "S0", "house": "bundled:3", field: value})


def test_a_name_tells_what_differs_from_the_default():
    spec = StreamSpec("S8", "folder/houses.jsonl.gz:12", 2, 640, 480, "noisy:poor,miss_rate=0.3")
    assert spec.name == "S8/houses-0012/2/noisy-poor-miss_rate=0.3/640x480".replace("_", "-")


def test_a_wide_image_is_as_wide_as_a_square_one():
    wide, square = StreamSpec("S0", "bundled:4", 0, 640, 480).camera, StreamSpec("S0", "bundled:4").camera
    assert square.intrinsics.focal_px == pytest.approx(150.0)
    assert wide.intrinsics.focal_px == pytest.approx(320.0)


def test_a_plan_is_stored_once_and_read_again(own_cache):
    fresh = make_plan(SMALL, read_house(SMALL.house))
    assert plan_of(SMALL) == fresh
    assert all(path.stat().st_size < 100_000 for path in (own_cache / "streams").iterdir())
    assert plan_of(SMALL) == fresh


def test_a_stored_plan_is_not_made_again_and_a_damaged_one_is(own_cache):
    plan = make_plan(SMALL, read_house(SMALL.house))
    made = []
    for _ in range(2):
        cached_plan({"test": "stored"}, lambda: made.append(1) or plan)
    assert len(made) == 1
    for path in (own_cache / "streams").iterdir():
        path.write_bytes(b"damaged")
    assert cached_plan({"test": "stored"}, lambda: made.append(1) or plan) == plan
    assert len(made) == 2


def test_a_cache_folder_that_cannot_be_written_is_no_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("EVONAV_CACHE", str(tmp_path / "file"))
    assert len(make_stream(SMALL).plan.frames) == 48


def test_errors_of_perception_leave_houses_and_walks_as_they_are():
    spec = StreamSpec("S2", "bundled:4", frames_a_visit=5)
    poor = StreamSpec("S8", "bundled:4", frames_a_visit=5, perception="noisy:poor")
    assert plan_of(spec) == plan_of(poor)
