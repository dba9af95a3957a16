"""Reading houses from files of every kind, and saying what is wrong with them."""

import functools
import gzip
import json
import pickle
from importlib.resources import as_file, files
from pathlib import Path

import pytest
from build_houses import fallen_ids, unreached_rooms
from recorded_data import data_path, needs_data

from evonav.errors import HouseError, InvalidArgumentError
from evonav.house import House, bundled_houses, stream_houses
from evonav.world.embedded import EmbeddedSimulator

RECORDED = [
    "ram81-procthor-100k-history",
    "ram81-procthor-1k/train.jsonl.gz",
    "ram81-procthor-1k/val.jsonl.gz",
    "ram81-procthor-one-room",
    "roseh-procthor-100k-history",
    "michael-quinlan-hallway-houses",
    "zhiyuan-gao-procthor-houses",
]


@pytest.fixture(scope="module")
def houses() -> list[House]:
    return list(bundled_houses(3))


def test_bundled_houses_are_complete_every_room_is_reached_and_nothing_has_fallen() -> None:
    simulator, num_houses = EmbeddedSimulator(), 0
    for num_houses, house in enumerate(bundled_houses(), start=1):
        assert house.name == f"bundled:{num_houses}"
        assert 2 <= len(house.rooms) <= 10
        assert all(entry.category for entry in house.objects)
        simulator.reset(house.to_json())
        assert not unreached_rooms(simulator, house), house.name
        assert not fallen_ids(simulator, house), house.name
    assert num_houses >= 24


@pytest.mark.parametrize("suffix", [".json", ".json.gz", ".jsonl", ".jsonl.gz"])
def test_all_file_formats_give_the_same_houses(tmp_path: Path, houses: list[House], suffix: str) -> None:
    documents = [house.to_json() for house in houses]
    text = "\n\n".join(documents) if "jsonl" in suffix else f" [{documents[0]},\n {documents[1]}\n, {documents[2]}]\n"
    path = tmp_path / f"houses{suffix}"
    path.write_bytes(gzip.compress(text.encode()) if suffix.endswith("gz") else text.encode())
    loaded = list(stream_houses(path))
    assert [house.to_json() for house in loaded] == documents
    line = {".jsonl": ":5", ".jsonl.gz": ":5"}.get(suffix, ":3[2]")
    assert loaded[2].name == f"{path}{line}"
    assert len(list(stream_houses(path, limit=2))) == 2


def test_one_document_and_directories(tmp_path: Path, houses: list[House]) -> None:
    for name, house in zip(("b.json", "a.jsonl", "c.txt"), houses, strict=True):
        (tmp_path / name).write_text(house.to_json())
    loaded = list(stream_houses(tmp_path))
    assert [house.name for house in loaded] == [f"{tmp_path / 'a.jsonl'}:1", f"{tmp_path / 'b.json'}:1"]
    assert loaded[1].to_json() == houses[0].to_json()
    (tmp_path / "empty.json").write_text("[ ]")
    assert list(stream_houses(tmp_path / "empty.json")) == []


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("no.json", None, "cannot be read"),
        ("h.txt", b"{}", "expected a folder, a file"),
        ("h.json", b"", "EOF"),
        ("h.json", b"\xff\xfe", "cannot be read"),
        ("h.json", b"[" * 100_000, "h.json:1"),
        ("h.json", b"[{}", "metadata"),
        ("h.json", b"[1 2]", "h.json:1[0]: house"),
        ("h.json", b"[]\n]", "text follows the list"),
        ("h.json", b'[\n"a" "b"]', 'is "a", expected an object'),
        ("h.json", b"{} {}", "trailing"),
        ("h.json.gz", b"not gzip", "cannot be read"),
        ("h.jsonl.gz", gzip.compress(b"{}" * 5000, mtime=0)[:40], "cannot be read"),
        ("h.jsonl", b'\n{"metadata": {"agent": NaN}}', "h.jsonl:2"),
        ("h.jsonl", b'{"metadata": {}, "metadata": {}}', "given twice"),
    ],
)
def test_unreadable_files_are_house_errors(tmp_path: Path, name: str, content: bytes | None, said: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(HouseError) as refusal:
        list(stream_houses(path))
    assert said in str(refusal.value)
    assert name in str(refusal.value)


def test_empty_directory_and_negative_limit(tmp_path: Path) -> None:
    with pytest.raises(HouseError, match=r"no \.json"):
        list(stream_houses(tmp_path))
    with pytest.raises(InvalidArgumentError, match="limit"):
        stream_houses(tmp_path, limit=-1)


def test_errors_name_file_line_object_and_field(tmp_path: Path, houses: list[House]) -> None:
    document = json.loads(houses[1].to_json())
    document["objects"][2]["position"]["y"] = "high"
    path = tmp_path / "houses.jsonl"
    path.write_text(houses[0].to_json() + "\n" + json.dumps(document) + "\n")
    stream = stream_houses(path)
    assert next(stream).name.endswith(":1")
    with pytest.raises(HouseError) as refusal:
        next(stream)
    named = f'house {path}:2: {document["objects"][2]["id"]}: field `position.y`: is "high", expected a number'
    assert str(refusal.value) == named


def test_a_house_is_a_value(houses: list[House]) -> None:
    house = houses[0]
    assert pickle.loads(pickle.dumps(house)) == house
    assert house != houses[1]
    table = next(entry for entry in house.objects if entry.child_ids)
    child = next(entry for entry in house.objects if entry.parent_id == table.id)
    assert child.room_id == table.room_id
    x_m, y_m, z_m = child.position_m
    move = {"id": child.id, "position_m": [x_m, y_m, z_m + 0.1], "rotation_deg": [0, 90, 0], "parent": None}
    moved = house.apply(json.dumps({"moves": [move]}))
    after = next(entry for entry in moved.objects if entry.id == child.id)
    assert (after.position_m, after.parent_id) == ((x_m, y_m, z_m + 0.1), None)
    assert len(moved.objects) == len(house.objects)
    with pytest.raises(InvalidArgumentError, match="moves"):
        house.apply('{"move": []}')
    with pytest.raises(HouseError, match="no object of the house"):
        house.apply(json.dumps({"moves": [{**move, "id": "nothing"}]}))


@functools.cache
def text_of(path: Path) -> str:
    content = path.read_bytes()
    return (gzip.decompress(content) if path.suffix == ".gz" else content).decode()


def test_bundled_houses_survive_reading_and_writing() -> None:
    with as_file(files("evonav") / "data" / "houses.jsonl.gz") as path:
        check_reading_and_writing(path)


@pytest.mark.slow
@pytest.mark.parametrize("source", [pytest.param(source, marks=needs_data(source)) for source in RECORDED])
def test_recorded_houses_survive_reading_and_writing(source: str) -> None:
    check_reading_and_writing(data_path(source))


def check_reading_and_writing(source: Path) -> None:
    houses = list(stream_houses(source))
    assert houses
    for house in houses[:: max(1, len(houses) // 50)]:
        path, _, place = house.name.rpartition(":")
        text = text_of(Path(path))
        line, _, index = place.partition("[")
        document = json.loads(text.splitlines()[int(line) - 1] if ".jsonl" in path else text)
        source_document = document[int(index[:-1])] if index else document
        # Equal values, equal order of keys.
        assert json.dumps(json.loads(house.to_json())) == json.dumps(source_document)


def test_a_house_without_the_wall_of_a_door_is_refused(tmp_path: Path, houses: list[House]) -> None:
    document = json.loads(houses[0].to_json())
    wall_id = document["doors"][0]["wall1"]
    document["walls"] = [wall for wall in document["walls"] if wall["id"] != wall_id]
    path = tmp_path / "house.json"
    path.write_text(json.dumps(document))
    with pytest.raises(HouseError, match="wall1"):
        list(stream_houses(path))


@needs_data("zhiyuan-gao-procthor-houses/partial_houses")
def test_incomplete_houses_are_read_or_refused() -> None:
    """One house saved after each generator step: before its outer walls exist, its outer door has no wall."""
    without_outer_walls = {"1_DOORS.json", "2_LIGHTS.json", "3_SKYBOX.json"}
    for path in sorted(data_path("zhiyuan-gao-procthor-houses/partial_houses").iterdir()):
        if path.name in without_outer_walls:
            with pytest.raises(HouseError, match="wall1"):
                list(stream_houses(path))
        else:
            assert len(list(stream_houses(path))) == 1
