"""Agreement with what AI2-THOR recorded, through its own client, and with docs/studies/simulator-fidelity.md."""

import copy
import json
import re
from pathlib import Path
from typing import Any

import pytest
from recorded_data import data_folder, needs_data

from evonav.house import bundled_houses
from evonav.thor.actions import registry
from evonav.thor.engine import Engine
from evonav.thor.objects import static_records

ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs" / "studies" / "simulator-fidelity.md").read_text(encoding="utf-8")
FAILURES = Path(__file__).with_name("failed_actions.md")

needs_recordings = needs_data(
    "kunalmessi10-procthor-100k-eval",
    "piqiuni-molmospaces-procthor10k",
    "ram81-procthor-100k-history",
    "ram81-procthor-1k",
    "robothor-challenge-val",
    "roseh-procthor-100k-history",
)

REQUIRED_ACTIONS = {
    *("Initialize", "Reset", "CreateHouse", "Pass", "Done"),
    *("MoveAhead", "MoveBack", "MoveLeft", "MoveRight", "RotateLeft", "RotateRight", "LookUp", "LookDown"),
    *("Teleport", "TeleportFull", "GetReachablePositions", "GetShortestPath", "GetShortestPathToPoint"),
    *("ObjectNavExpertAction", "GetObjectInFrame", "SetObjectPoses", "PlaceObjectAtPoint"),
    *("RemoveFromScene", "DisableObject", "InitialRandomSpawn", "SpawnAsset", "GetAssetDatabase"),
    *("AddThirdPartyCamera", "UpdateThirdPartyCamera"),
}


# --- Recordings -----------------------------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def _home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))  # where the client keeps its log and locks


def measured(name: str, **keywords: Any) -> dict[str, tuple[int, float]]:
    """Rows of one of the script's measures: cases and figure, by behaviour."""
    pytest.importorskip("ai2thor", reason="AI2-THOR's client is not installed (extra `thor`)")
    import measure_fidelity

    rows = getattr(measure_fidelity, name)(data_folder(), **keywords)
    return {row.behaviour: (row.num_all, row.figure) for row in rows}


@needs_recordings
def test_recorded_locobot_starts_are_reached() -> None:
    rows = measured("reachable_positions")
    for behaviour in ("LoCoBot starts in GetReachablePositions", "LoCoBot starts that TeleportFull takes"):
        num_all, share = rows[behaviour]
        assert num_all == 434
        assert share >= 0.99
    # A standard deviation of the ratio is 0.07; much less than 1 would mean that our set is wider than AI2-THOR's.
    assert 0.8 < rows["recorded starts at the border of ours / expected"][1] < 1.2


@needs_recordings
def test_recorded_stretch_starts_are_taken() -> None:
    assert measured("stretch_starts") == {"Stretch starts that TeleportFull takes": (18, 1.0)}


@needs_recordings
def test_houses_start_free_and_are_connected() -> None:
    rows = measured("house_starts", num_houses=30)
    assert rows["house starts that TeleportFull takes"][1] >= 0.97
    assert rows["houses all of whose rooms are reached"][1] >= 0.97


@needs_recordings
def test_recorded_object_records() -> None:
    rows = measured("object_records", every=8)
    assert rows["distance of recorded objects, largest difference"][1] < 1e-4
    num_visible, share = rows["visible of recorded cubes, where they are"]
    assert num_visible == 14
    assert share >= 0.9
    assert rows["visible of recorded cubes, where they are not"][1] >= 0.98


@needs_recordings
def test_asset_boxes_equal_those_of_a_procthor_10k_house() -> None:
    ((num_all, error_m),) = measured("asset_boxes").values()
    assert num_all == 201
    assert error_m < 0.01


@needs_recordings
def test_paths_have_the_form_of_recorded_ones() -> None:
    rows = measured("path_corners")
    assert rows["recorded paths: length less the sum of the legs, largest"][1] < 1e-4
    assert rows["paths between recorded starts that we find"][1] >= 0.99
    recorded_m = rows["recorded paths: start moved to the mesh, largest"][1]
    assert rows["our paths: start moved, largest"][1] <= recorded_m < 0.1
    assert abs(rows["our paths: height of corners"][1] - rows["recorded paths: median height of corners"][1]) < 0.001


@needs_recordings
def test_depth_is_planar() -> None:
    rows = measured("planar_depth")
    assert rows["depth of floors, as planar z, median difference"][1] < 1e-4
    assert rows["depth of floors, as distance, median difference"][1] > 0.1


# --- The document ---------------------------------------------------------------------------------------------------


def test_every_required_action_is_served_and_documented() -> None:
    section = DOCUMENT.split("## Actions served")[1].split("\nAnything else")[0]
    documented = set(re.findall(r"`(\w+)`", section))
    assert documented <= set(registry.action_names())
    assert documented >= REQUIRED_ACTIONS


def test_every_field_of_a_record_is_documented(house: dict[str, Any]) -> None:
    section = DOCUMENT.split("## Object metadata")[1].split("\n## ")[0]
    engine = Engine()
    engine.configure()
    assert engine.execute({"action": "CreateHouse", "house": copy.deepcopy(house)}).is_success
    assert {key for record in static_records(engine.scene) for key in record} <= set(re.findall(r"`(\w+)`", section))


def quoted_failures() -> list[Any]:
    """Rows of the table of failures: requests in a fresh house, code, message (`…` stands for anything)."""
    rows = []
    for line in FAILURES.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 3 and cells[0].startswith("`{"):
            requests = re.findall(r"`(\{.*?\})`(?:,|$)", cells[0])
            rows.append(pytest.param(requests, cells[1].strip("`"), cells[2].strip("`"), id=cells[0]))
    return rows


@pytest.fixture(scope="module")
def house() -> dict[str, Any]:
    document: dict[str, Any] = json.loads(next(iter(bundled_houses(1))).to_json())
    return document


@pytest.mark.parametrize(("requests", "code", "message"), quoted_failures())
def test_failures_match_the_documented_messages(
    house: dict[str, Any], requests: list[str], code: str, message: str
) -> None:
    engine = Engine()
    engine.configure()
    for request in (
        {"action": "Initialize", "snapToGrid": False},
        {"action": "CreateHouse", "house": copy.deepcopy(house)},
        {"action": "TeleportFull", **house["metadata"]["agent"]},
    ):
        assert engine.execute(request).is_success
    *before, last = [json.loads(r.replace("{object}", house["objects"][0]["id"])) for r in requests]
    for request in before:
        assert engine.execute(request).is_success, engine.last.error_message
    result = engine.execute(last)
    assert not result.is_success
    assert result.error_code.value == code
    pattern = ".*".join(re.escape(part) for part in message.replace("\\n", "\n").replace("\\t", "\t").split("…"))
    assert re.fullmatch(pattern, result.error_message, re.DOTALL), result.error_message


def test_the_document_quotes_failures() -> None:
    assert len(quoted_failures()) > 30
