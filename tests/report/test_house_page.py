"""`evonav houses show` and `check` say what is wrong and odd in a house, and whether it gives a task."""

import json

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.generation.house_check import check_house
from evonav.house import stream_houses

HEX = "0123456789abcdef0123456789abcdef"


@pytest.fixture(scope="module")
def document():
    (house,) = stream_houses("bundled:86")
    return json.loads(house.to_json())


def run(*words):
    found = CliRunner().invoke(app, ["houses", *map(str, words)], env={"COLUMNS": "200"})
    return found.exit_code, found.stdout


def changed(document, **changes):
    return json.dumps({**document, **changes})


def without_start(document):
    return {key: value for key, value in document["metadata"].items() if key != "agent"}


def test_a_bundled_house_is_shown_with_its_numbers_and_gives_a_task(tmp_path):
    code, text = run("show", "bundled:86", "--out", tmp_path / "house.html")
    assert code == 0
    assert text.startswith("bundled:86: 3 rooms, 55.6 m2, 70 objects of 40 categories, 2 doors")
    assert "room|6     Kitchen           16.7 m2    21 objects" in text
    assert "gives a task: yes: 4 stages with seed 0" in text
    page = (tmp_path / "house.html").read_text()
    assert "<svg" in page
    assert "LivingRoom" in page
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "").replace("http-equiv", "")
    assert run("show", "bundled:86", "--out", tmp_path / "house.svg")[0] == 0
    assert "<svg" in (tmp_path / "house.svg").read_text()


def test_what_is_missing_is_wrong_and_its_remedy_is_named(document, tmp_path):
    objects = [document["objects"][0] | {"assetId": HEX}, *document["objects"][1:]]
    path = tmp_path / "house.json"
    path.write_text(changed(document, objects=objects, metadata=without_start(document)))
    code, text = run("check", path)
    assert code == 1
    first = document["objects"][0]["id"]
    assert f"wrong: {first}: field `assetId`: is '{HEX}', of which the catalogue knows no size" in text
    assert "(--assets)" in text
    assert "wrong: house: field `metadata.agent`: is missing" in text
    assert text.endswith("1 of 1 house wrong\n")
    code, text = run("show", path)
    assert code == 1
    assert "gives a task: no: the house is wrong" in text
    sizes = tmp_path / "sizes.json"
    sizes.write_text(json.dumps({HEX: {"category": "DiningTable", "size_m": [1.5, 0.7, 1.0]}}))
    code, text = run("check", path, "--assets", sizes, "--start", "auto")
    assert (code, text.startswith("fine ")) == (0, True)
    code, text = run("show", path, "--allow-unknown-assets", "--start", "auto")
    assert "its size is a guess from its category" in text


def test_odd_houses_are_fine_with_notes(document):
    rooms = [document["rooms"][0] | {"roomType": "home office"}, *document["rooms"][1:]]
    found = check_house("odd", changed(document, rooms=rooms))
    (note,) = found.findings
    assert found.is_fine
    assert str(note).startswith("room|2: field `roomType`: is 'home office', none of Bathroom, Bedroom, Kitchen")
    assert "no new object" in note.message
    agent = json.loads(json.dumps(document["metadata"]["agent"]))
    agent["position"]["x"] = 60.0
    moved = check_house("moved", changed(document, metadata={**document["metadata"], "agent": agent}))
    assert any(finding.field == "metadata.agent" and "m away" in finding.message for finding in moved.findings)


def test_houses_that_cannot_be_read_are_named_with_the_rest(document, tmp_path):
    path = tmp_path / "houses.jsonl"
    path.write_text(f"{json.dumps(document)}\n{changed(document, rooms=[])}\n")
    code, text = run("check", "--only-wrong", path)
    assert code == 1
    lines = text.splitlines()
    assert lines[0] == f"wrong  {path}:2"
    assert "house: field `rooms`: is empty, expected at least one room" in lines[1]
    assert lines[2] == "1 of 2 houses wrong"
    assert run("show", f"{path}:1")[0] == 0
    assert "cannot be read" in run("show", f"{path}:2")[1]
