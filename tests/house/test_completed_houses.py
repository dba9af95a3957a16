"""Houses that lack something are completed as they are read: sizes of unknown assets, and a start."""

import gzip
import json

import pytest

from evonav.errors import HouseError, StoreError, TaskError
from evonav.generation.dataset import generate_dataset
from evonav.house import bundled_houses, stream_houses
from evonav.house.asset_sizes import read_asset_sizes
from evonav.house.files import HouseTexts
from evonav.tasks import load_task
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.house_options import HouseOptions

HEX = "0123456789abcdef0123456789abcdef"
SIZES = {HEX: {"category": "dining table", "size_m": [1.2, 0.7, 0.8], "receptacle": True}}


@pytest.fixture(scope="module")
def holodeck():
    """A small house as Holodeck writes it: Objaverse ids, a free room name, no start."""
    (house,) = stream_houses("bundled:86")
    document = json.loads(house.to_json())
    document["objects"][0] |= {"assetId": HEX, "objectType": "ObjaTable"}
    document["rooms"][0]["roomType"] = "home office"
    del document["metadata"]["agent"]
    return document


@pytest.fixture
def file_of(tmp_path):
    def write(name, value):
        path = tmp_path / name
        path.write_text(json.dumps(value))
        return path

    return write


def completed(document, path, start="file"):
    (text,) = HouseTexts(path("house.json", document), HouseOptions.of(path("sizes.json", SIZES), start))
    return text.text


def test_sizes_become_part_of_the_house(holodeck, file_of):
    document = json.loads(completed(holodeck, file_of))
    entry = {"size_m": [1.2, 0.7, 0.8], "category": "DiningTable", "receptacle": True}
    assert document["metadata"].pop("evonav_assets") == {HEX: entry}
    assert document == holodeck
    simulator = EmbeddedSimulator()
    simulator.reset(completed(holodeck, file_of))
    (table,) = [body for body in simulator.objects if body.id == holodeck["objects"][0]["id"]]
    assert table.category == "DiningTable"
    assert max(abs(a - b) for a, b in zip(sorted(table.size_m), [0.7, 0.8, 1.2], strict=True)) < 1e-6
    with pytest.raises(HouseError, match=r"--assets.*--allow-unknown-assets"):
        simulator.reset(json.dumps(holodeck))


def test_published_annotations_are_read_in_each_of_their_forms(tmp_path):
    metadata = {"primaryProperty": "CanPickup", "secondaryProperties": ["CanOpen"]}
    box = {"min": {"x": -1, "y": 0, "z": -0.5}, "max": {"x": 1, "y": 0.5, "z": 0.5}}
    size = {"x": 2, "y": 0.5, "z": 1}
    entries = {
        "a": {"uid": "a", "category": "tv stand", "thor_metadata": {"assetMetadata": {**metadata, "boundingBox": box}}},
        "b": {"annotations": {"category": "rug"}, "assetMetadata": {"boundingBox": {"size": size}}},
        "c": {"uid": "c", "category": "rug", "receptacle": True, "assetMetadata": {"boundingBox": size}},
        "d": {"uid": "d", "category": "rug", "thor_metadata": {}},
    }
    path = tmp_path / "annotations.json.gz"
    path.write_bytes(gzip.compress(json.dumps(entries).encode()))
    found = read_asset_sizes(path).entries
    edges = (2.0, 0.5, 1.0)
    assert {asset_id: size.model_dump(exclude_defaults=True) for asset_id, size in found.items()} == {
        "a": {"size_m": edges, "category": "TVStand", "pickupable": True, "openable": True},
        "b": {"size_m": edges, "category": "Rug"},
        "c": {"size_m": edges, "category": "Rug", "receptacle": True},
    }


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"category": "Sofa", "size_m": [1, 2]}, 'missing "size_m.2"'),
        ({"category": "Sofa", "size_m": [1, -2, 1]}, "size_m.1 = -2: Input should be greater than 0"),
        ({"category": "Sofa", "size_m": [1, 2, 300]}, "size_m.2 = 300"),
        ({"category": "", "size_m": [1, 2, 1]}, "category = '': .*expected a name"),
        ({"size_m": [1, 2, 1]}, 'missing "category"'),
        ({"category": "Sofa", "size_m": [1, 2, 1], "size": 3}, "size = 3: Extra inputs are not permitted"),
        ({"category": "Sofa", "size_m": [1, 2, 1], "openable": 1}, "openable = 1: .*boolean"),
        ({"uid": "x", "category": "Sofa", "assetMetadata": {"boundingBox": 3}}, "the annotation has no boundingBox"),
        ([1], "Input should be .*AssetSize, got"),
    ],
)
def test_wrong_entries_are_named(file_of, entry, message):
    path = file_of("sizes.json", {HEX: entry})
    with pytest.raises(HouseError, match=f"sizes.json: asset {HEX}: {message}"):
        read_asset_sizes(path)


def test_files_that_are_no_sizes_are_refused(tmp_path, file_of):
    with pytest.raises(HouseError, match="expected an object with an entry for each asset id"):
        read_asset_sizes(file_of("list.json", []))
    with pytest.raises(HouseError, match=r"none\.json: cannot be read"):
        read_asset_sizes(tmp_path / "none.json")


def test_a_start_is_chosen_where_there_is_none(holodeck, file_of):
    document = json.loads(completed(holodeck, file_of, "auto"))
    agent = document["metadata"]["agent"]
    assert agent == json.loads(completed(holodeck, file_of, "auto"))["metadata"]["agent"]
    assert document["metadata"]["evonav_start"] == "auto"
    simulator = EmbeddedSimulator()
    pose = simulator.reset(json.dumps(document))
    position = agent["position"]
    assert (pose.x_m, pose.z_m) == (position["x"], position["z"])
    assert len(simulator.reachable_positions()) > 50


def test_houses_that_lack_nothing_keep_their_text(file_of):
    house = next(bundled_houses(1))
    (text,) = HouseTexts(file_of("h.json", json.loads(house.to_json())), HouseOptions.of(None, "auto"))
    assert json.loads(text.text) == json.loads(house.to_json())
    assert HouseOptions.of() is None


def test_tasks_hold_the_sizes_and_the_folder_knows_them(holodeck, file_of, tmp_path):
    houses, out = file_of("house.json", holodeck), tmp_path / "tasks"
    with pytest.raises(TaskError, match=r"no_start.*--start auto"):
        generate_dataset(HouseTexts(houses, HouseOptions.of(file_of("sizes.json", SIZES))), tmp_path / "none")
    options = HouseOptions.of(file_of("sizes.json", SIZES), "auto")
    made = generate_dataset(HouseTexts(houses, options), out)
    task = load_task(made.roots[0])
    for stage in range(1, task.num_stages + 1):
        assert json.loads(task.house_json(stage))["metadata"]["evonav_assets"].keys() == {HEX}
    again = generate_dataset(HouseTexts(houses, options), out)
    assert again.num_new == 0
    other = {HEX: SIZES[HEX] | {"size_m": [1.0, 0.7, 0.8]}}
    with pytest.raises(StoreError, match="completed"):
        generate_dataset(HouseTexts(houses, HouseOptions.of(file_of("sizes.json", other), "auto")), out)


def test_one_bundled_house_is_named_by_its_number():
    (house,) = stream_houses("bundled:3")
    assert house.name == "bundled:3"
    assert [one.name for one in stream_houses("bundled", 2)] == ["bundled:1", "bundled:2"]
    assert next(stream_houses("bundled")) == next(bundled_houses())
    with pytest.raises(HouseError, match="bundled has fewer houses"):
        list(stream_houses("bundled:1000"))
    with pytest.raises(HouseError, match="where N is a number from 1"):
        stream_houses("bundled:first")
