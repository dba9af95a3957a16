"""Measures the AI2-THOR engine against recordings of AI2-THOR, for docs/studies/simulator-fidelity.md.

    python scripts/studies/measure_fidelity.py $EVONAV_DATA

Everything goes through the published client, an `ai2thor.controller.Controller` that drives the engine; nothing is
fitted here. The study says what the figures mean, `tests/thor/test_thor_fidelity.py` holds them.
"""

import argparse
import gzip
import itertools
import json
import math
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from ai2thor.controller import Controller
from numpy.typing import NDArray

import evonav.thor

Json = dict[str, Any]
Point = tuple[float, float]
"""`(x, z)`."""

GRID_M = 0.25
_NEIGHBOURS = ((GRID_M, 0.0), (0.0, GRID_M), (-GRID_M, 0.0), (0.0, -GRID_M))
# Catalogue assets that are most like cubes, by edge.
_LIKE_A_CUBE = {0.1: "Apple_8", 0.2: "Alarm_Clock_29", 0.3: "Safe_18_2", 0.4: "coffee_machine_11", 0.5: "Safe_18_1"}


@dataclass(frozen=True, slots=True)
class Agreement:
    """How often, or how far, the engine agrees with the recordings in one respect."""

    behaviour: str
    num_all: int
    figure: float
    """What `unit` says."""
    unit: str


@contextmanager
def client(**keywords: Any) -> Iterator[Controller]:  # noqa: ANN401
    """A controller on the engine, without images unless asked for."""
    options = {"x_display": os.environ.get("DISPLAY", "0"), "scene": "Procedural", "width": 300, "height": 300}
    controller = Controller(local_executable_path=evonav.thor.executable(), **(options | keywords))
    try:
        yield controller
    finally:
        controller.stop()


def share(behaviour: str, is_good: Iterable[bool]) -> Agreement:
    """The share of agreeing cases."""
    cases = list(is_good)
    return Agreement(behaviour, len(cases), sum(cases) / len(cases), "share")


# --- The recordings -------------------------------------------------------------------------------------------------


@cache
def _rows(path: Path) -> list[Json]:
    return [json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()]


def _locobot_episodes(data: Path) -> list[Json]:
    return _rows(data / "ram81-procthor-1k" / "procthor-attr-onav-locobot-val.jsonl.gz")


def _locobot_houses(data: Path) -> list[Json]:
    return _rows(data / "ram81-procthor-1k" / "val.jsonl.gz")


def _locobot_starts(data: Path) -> dict[int, set[Point]]:
    """Positions by house: drawn from what AI2-THOR's `GetReachablePositions` answered."""
    starts: dict[int, set[Point]] = defaultdict(set)
    for episode in _locobot_episodes(data):
        starts[episode["scene"]].add(_xz(episode["agentPose"]["position"]))
    return starts


def _cubes(data: Path) -> list[tuple[int, list[Json]]]:
    """House and object records of each episode, once: AI2-THOR wrote them with its agent at the house's start."""
    groups: dict[tuple[int, str], list[Json]] = {}
    for episode in _locobot_episodes(data):
        records = list(episode["targetObjectConfig"]["positions"].values())
        groups[episode["scene"], json.dumps([record["axisAlignedBoundingBox"] for record in records])] = records
    return [(scene, records) for (scene, _), records in sorted(groups.items())]


def _xz(position: Json) -> Point:
    return (round(position["x"], 3) + 0.0, round(position["z"], 3) + 0.0)


def _enter(controller: Controller, house: Json) -> None:
    controller.reset(scene=house)
    agent = house["metadata"]["agent"]
    _teleport(controller, agent["position"], agent["rotation"], agent["horizon"])
    assert controller.last_event.metadata["lastActionSuccess"], controller.last_event.metadata["errorMessage"]


def _teleport(controller: Controller, position: Json, rotation: Json, horizon: float) -> bool:
    """As the mode of the agent wants it."""
    is_locobot = controller.initialization_parameters.get("agentMode") == "locobot"
    standing = {} if is_locobot else {"standing": True}
    event = controller.step("TeleportFull", position=position, rotation=rotation, horizon=horizon, **standing)
    return bool(event.metadata["lastActionSuccess"])


# --- The measures ---------------------------------------------------------------------------------------------------


def reachable_positions(data: Path) -> list[Agreement]:
    """Recorded LoCoBot starts among the answers of `GetReachablePositions` and `TeleportFull`.

    The recorded ones are a sample of AI2-THOR's set. If ours had many positions more, they would lie at its border, and
    fewer of the recorded ones would be at our border than of ours.
    """
    is_reached, is_teleported, num_border, expected_border = [], [], 0, 0.0
    with client(agentMode="locobot", fieldOfView=60, gridSize=GRID_M, snapToGrid=False) as controller:
        for scene, recorded in sorted(_locobot_starts(data).items()):
            _enter(controller, _locobot_houses(data)[scene])
            y_m = controller.last_event.metadata["agent"]["position"]["y"]
            ours = {_xz(p) for p in controller.step("GetReachablePositions").metadata["actionReturn"]}
            border = {p for p in ours if not all(_xz({"x": p[0] + x, "z": p[1] + z}) in ours for x, z in _NEIGHBOURS)}
            found = recorded & ours
            is_reached += [p in ours for p in recorded]
            num_border += len(found & border)
            expected_border += len(found) * len(border) / len(ours)
            is_teleported += [
                _teleport(controller, {"x": x, "y": y_m, "z": z}, {"x": 0, "y": 0, "z": 0}, 30) for x, z in recorded
            ]
    balance = num_border / expected_border
    return [
        share("LoCoBot starts in GetReachablePositions", is_reached),
        share("LoCoBot starts that TeleportFull takes", is_teleported),
        Agreement("recorded starts at the border of ours / expected", num_border, balance, "ratio"),
    ]


def stretch_starts(data: Path) -> list[Agreement]:
    """Recorded starts of a Stretch robot (radius 0.185 m) that our default agent (0.2 m) fits at."""
    houses = _rows(data / "roseh-procthor-100k-history" / "tiny-val.jsonl.gz")
    starts: dict[int, set[tuple[float, ...]]] = defaultdict(set)
    for kind in ("explorehouse", "fetch2roomtype", "objectnavtype"):
        path = data / "kunalmessi10-procthor-100k-eval" / f"tinyval_June8_procthor_100k_{kind}_val.jsonl.gz"
        for episode in _rows(path):
            if episode["house_number"] < len(houses):
                starts[episode["house_number"]].add(tuple(episode["agent_starting_position"]))
    is_good = []
    with client(snapToGrid=False) as controller:
        for number, positions in sorted(starts.items()):
            _enter(controller, houses[number])
            for x, y, z in positions:
                is_good.append(_teleport(controller, {"x": x, "y": y, "z": z}, {"x": 0, "y": 0, "z": 0}, 0))
    return [share("Stretch starts that TeleportFull takes", is_good)]


def house_starts(data: Path, num_houses: int = 100) -> list[Agreement]:
    """`metadata.agent` of houses that AI2-THOR's generator made: `TeleportFull` takes it; every room is reached."""
    files = ("attr-onav-1k-val-100", "uniform-hard-val-75")
    houses = [h for name in files for h in _rows(data / "ram81-procthor-100k-history" / f"{name}.jsonl.gz")]
    is_taken, is_connected = [], []
    with client(snapToGrid=False) as controller:
        for house in houses[:: max(1, len(houses) // num_houses)]:
            controller.reset(scene=house)
            agent = house["metadata"]["agent"]
            is_taken.append(_teleport(controller, agent["position"], agent["rotation"], agent["horizon"]))
            points = [_xz(p) for p in controller.step("GetReachablePositions").metadata["actionReturn"]]
            rooms = [[(corner["x"], corner["z"]) for corner in room["floorPolygon"]] for room in house["rooms"]]
            is_connected.append(all(any(_is_inside(polygon, p) for p in points) for polygon in rooms))
    return [
        share("house starts that TeleportFull takes", is_taken),
        share("houses all of whose rooms are reached", is_connected),
    ]


def _is_inside(polygon: list[Point], point: Point) -> bool:
    is_in, (x, z) = False, point
    for (x0, z0), (x1, z1) in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        if (z0 > z) != (z1 > z) and x < x0 + (z - z0) / (z1 - z0) * (x1 - x0):
            is_in = not is_in
    return is_in


def object_records(data: Path, every: int = 1) -> list[Agreement]:
    """`visible` and `distance` of recorded cubes of 0.1 to 0.5 m; assets of nearly the size stand in for them.

    Args:
        data: The folder of the recordings.
        every: Of how many episodes in which none was visible one is taken.
    """
    distances_m, boxes_m, verdicts = [], [], []
    with client(agentMode="locobot", fieldOfView=60, gridSize=GRID_M, snapToGrid=False) as controller:
        assets = controller.step("GetAssetDatabase").metadata["actionReturn"]
        for number, (scene, cubes) in enumerate(_cubes(data)):
            if number % every and not any(cube["visible"] for cube in cubes):
                continue
            house = _locobot_houses(data)[scene]
            stands_in = [_stand_in(assets, place, cube) for place, cube in enumerate(cubes)]
            _enter(controller, house | {"objects": [*house["objects"], *stands_in]})
            at_m = list(controller.last_event.metadata["agent"]["position"].values())
            for cube in cubes:
                distances_m.append(abs(math.dist(at_m, cube["position"].values()) - cube["distance"]))
            ours = {record["objectId"]: record for record in controller.last_event.metadata["objects"]}
            for entry, cube in zip(stands_in, cubes, strict=True):
                record = ours[entry["id"]]
                centres_m = [list(r["axisAlignedBoundingBox"]["center"].values()) for r in (record, cube)]
                boxes_m.append(float(np.max(np.abs(np.subtract(*centres_m)))))
                verdicts.append((cube["visible"], record["visible"]))
    return [
        Agreement("distance of recorded objects, largest difference", len(distances_m), float(max(distances_m)), "m"),
        Agreement("where the stand-ins of recorded cubes lie, 95th percentile", len(boxes_m), _q(boxes_m, 95), "m"),
        share("visible of recorded cubes, the same", (recorded == own for recorded, own in verdicts)),
        share("visible of recorded cubes, where they are", (own for recorded, own in verdicts if recorded)),
        share("visible of recorded cubes, where they are not", (not own for recorded, own in verdicts if not recorded)),
    ]


def _stand_in(assets: Json, number: int, cube: Json) -> Json:
    """A house file's entry, its bottom where the cube's is."""
    box = cube["axisAlignedBoundingBox"]
    asset_id = _LIKE_A_CUBE[min(_LIKE_A_CUBE, key=lambda edge_m: abs(edge_m - box["size"]["y"]))]
    y_m = box["center"]["y"] - box["size"]["y"] / 2 + assets[asset_id]["boundingBox"]["y"] / 2
    return {
        "assetId": asset_id,
        "id": f"{asset_id}|cube|{number}",
        "kinematic": True,
        "position": {"x": box["center"]["x"], "y": y_m, "z": box["center"]["z"]},
        "rotation": {"x": 0, "y": 0, "z": 0},
    }


def asset_boxes(data: Path) -> list[Agreement]:
    """Boxes that MolmoSpaces measured in a ProcTHOR-10K house against `GetAssetDatabase`, of what stands square."""
    dump = json.loads(
        (data / "piqiuni-molmospaces-procthor10k" / "procthor-10k_train_1_base_scene_full.json").read_text()
    )
    with client() as controller:
        assets = controller.step("GetAssetDatabase", raise_for_failure=True).metadata["actionReturn"]
    errors_m = []
    for record in dump["records"]:
        x_m, z_m, y_m = record["aabb_size"]  # z is up there
        ours_m = [assets[record["asset_id"]]["boundingBox"][axis] for axis in "xyz"]
        turned_m = [[x_m, y_m, z_m], [z_m, y_m, x_m]]
        errors_m.append(min(float(np.max(np.abs(np.subtract(ours_m, size_m)))) for size_m in turned_m))
    return [Agreement("asset boxes, median largest difference of an edge", len(errors_m), _q(errors_m, 50), "m")]


def path_corners(data: Path) -> list[Agreement]:
    """Corners of recorded NavMesh paths, and of ours between recorded LoCoBot starts: the same arithmetic."""
    recorded = [row for path in sorted((data / "robothor-challenge-val").glob("*.json.gz")) for row in _json(path)]
    legs_m = [abs(_length_m(row["shortest_path"]) - row["shortest_path_length"]) for row in recorded]
    starts_m = [math.dist(_xz(row["initial_position"]), _xz(row["shortest_path"][0])) for row in recorded]
    heights_m = [corner["y"] for row in recorded for corner in row["shortest_path"]]
    own_starts_m, own_heights_m, is_found = [], [], []
    with client(agentMode="locobot", fieldOfView=60, snapToGrid=False) as controller:
        for scene, points in sorted(_locobot_starts(data).items()):
            _enter(controller, _locobot_houses(data)[scene])
            ordered = sorted(points)
            for (x0, z0), (x1, z1) in itertools.pairwise(ordered):
                ends = {"position": {"x": x0, "y": 0.9, "z": z0}, "target": {"x": x1, "y": 0.9, "z": z1}}
                metadata = controller.step("GetShortestPathToPoint", **ends, allowedError=0.1).metadata
                is_found.append(bool(metadata["lastActionSuccess"]))
                if is_found[-1]:
                    corners = metadata["actionReturn"]["corners"]
                    own_starts_m.append(math.dist((x0, z0), _xz(corners[0])))
                    own_heights_m += [corner["y"] for corner in corners]
    return [
        Agreement("recorded paths: length less the sum of the legs, largest", len(legs_m), max(legs_m), "m"),
        Agreement("recorded paths: start moved to the mesh, largest", len(starts_m), max(starts_m), "m"),
        Agreement("recorded paths: median height of corners", len(heights_m), _q(heights_m, 50), "m"),
        share("paths between recorded starts that we find", is_found),
        Agreement("our paths: start moved, largest", len(own_starts_m), max(own_starts_m), "m"),
        Agreement("our paths: height of corners", len(own_heights_m), _q(own_heights_m, 50), "m"),
    ]


def planar_depth(data: Path) -> list[Agreement]:
    """Floor in our depth images, as planar z of AI2-THOR's camera and as distance from it."""
    planar_m, radial_m = [], []
    with client(agentMode="default", renderDepthImage=True, renderInstanceSegmentation=True) as controller:
        for house in _locobot_houses(data)[:10:2]:
            _enter(controller, house)
            event = controller.step("Pass")
            rooms = [room["id"] for room in house["rooms"]]
            is_floor = np.any([event.instance_masks[room] for room in rooms if room in event.instance_masks], axis=0)
            rows = (np.arange(300) + 0.5 - 150.0) / 150.0  # tangent below the axis, at 90 degrees
            cols = rows[None, :]
            horizon_rad = math.radians(event.metadata["agent"]["cameraHorizon"])
            down = (rows * math.cos(horizon_rad) + math.sin(horizon_rad))[:, None] + np.zeros_like(cols)
            seen = is_floor & (down > 0.2)
            z_m = event.metadata["cameraPosition"]["y"] / down[seen]
            ray_m = (np.sqrt(1 + rows[:, None] ** 2 + cols**2))[seen] * z_m
            planar_m.append(_off(event.depth_frame[seen], z_m))
            radial_m.append(_off(event.depth_frame[seen], ray_m))
    planar, radial = np.concatenate(planar_m), np.concatenate(radial_m)
    return [
        Agreement("depth of floors, as planar z, median difference", len(planar), float(np.median(planar)), "m"),
        Agreement("depth of floors, as distance, median difference", len(radial), float(np.median(radial)), "m"),
    ]


def _off(depth_m: NDArray[np.float32], expected_m: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs(depth_m - expected_m)


def _json(path: Path) -> list[Json]:
    rows: list[Json] = json.loads(gzip.decompress(path.read_bytes()))
    return rows


def _length_m(corners: list[Json]) -> float:
    points = [(c["x"], c["y"], c["z"]) for c in corners]
    return sum(math.dist(a, b) for a, b in itertools.pairwise(points))


def _q(values: list[float], percentile: float) -> float:
    return float(np.percentile(values, percentile))


MEASURES: tuple[Callable[[Path], list[Agreement]], ...] = (
    reachable_positions,
    stretch_starts,
    house_starts,
    object_records,
    asset_boxes,
    path_corners,
    planar_depth,
)


def main() -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="the folder of the recordings")
    parser.add_argument("--only", choices=[measure.__name__ for measure in MEASURES], help="one of the measures")
    arguments = parser.parse_args()
    sys.stdout.write("| behaviour | n | figure |\n| --- | --- | --- |\n")
    for measure in MEASURES:
        if arguments.only in (None, measure.__name__):
            for row in measure(arguments.data):
                sys.stdout.write(f"| {row.behaviour} | {row.num_all:,} | {row.figure:.4g} {row.unit} |\n")
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
