"""The published generator makes whole houses through AI2-THOR's client on our engine; each is held to what it must be.

The generator has an environment of its own (`make test-procthor`; docs/procthor.md), named by EVONAV_PROCTHOR_PYTHON.
"""

import contextlib
import gzip
import importlib.util
import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

import evonav.thor
from evonav.generation import TaskRejectedError, generate_task
from evonav.house import House, stream_houses
from evonav.world.embedded import EmbeddedSimulator

Json = dict[str, Any]

ROOT = Path(__file__).parents[2]
PYTHON = os.environ.get("EVONAV_PROCTHOR_PYTHON") or (sys.executable if importlib.util.find_spec("procthor") else None)
pytestmark = [
    pytest.mark.skipif(PYTHON is None, reason="procthor is not installed: make test-procthor, or docs/procthor.md"),
    pytest.mark.timeout(900),
]
# Two, two and five rooms; dropped bats and asset groups among them.
SEEDS = range(5, 8)
# The generator lets breakable things hover so high.
HOVER_M = 0.05


def made(out: Path, seeds: str, home: Path, *, workers: int = 2) -> list[str]:
    """Lines of the houses that the example writes."""
    command = [str(PYTHON), str(ROOT / "examples" / "generate_houses.py"), "--executable", evonav.thor.executable()]
    command += ["--seeds", seeds, "--workers", str(workers), "--out", str(out)]
    result = subprocess.run(command, env=os.environ | {"HOME": str(home)}, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr[-3000:]
    assert result.stdout.count("seed ") == len(range(*map(int, seeds.split(":"))))
    return gzip.decompress(out.read_bytes()).decode().splitlines()


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("houses")


@pytest.fixture(scope="module")
def lines(out: Path) -> list[str]:
    found = made(out / "houses.jsonl.gz", f"{SEEDS.start}:{SEEDS.stop}", out)
    assert len(found) >= 2, "the generator's own validation refuses more houses than it should"
    return found


@pytest.fixture(scope="module")
def houses(lines: list[str], out: Path) -> list[House]:
    return list(stream_houses(out / "houses.jsonl.gz"))


def test_every_room_is_walked_into_and_every_asset_is_known(houses: list[House]) -> None:
    for house in houses:
        simulator = EmbeddedSimulator()
        simulator.reset(house.to_json(), name=house.name)
        in_room = Counter(house.room_of(x_m, z_m) for x_m, _, z_m in simulator.reachable_positions().tolist())
        assert all(in_room[room.id] >= 5 for room in house.rooms), in_room


def test_small_objects_stand_on_their_receptacles_without_overlap(houses: list[House]) -> None:
    num_small = 0
    for house in houses:
        simulator = EmbeddedSimulator()
        simulator.reset(house.to_json(), name=house.name)
        bodies = {body.id: body for body in simulator.objects}
        small = [entry for entry in house.objects if entry.id.startswith("small|") and entry.parent_id]
        num_small += len(small)
        for entry in small:
            body, parent = bodies[entry.id], bodies[str(entry.parent_id)]
            # The scene lets what hovers fall: only what had a surface under it stays near its place.
            fallen_m = entry.position_m[1] - body.centre_m[1]
            is_tilted = any(entry.rotation_deg[axis] % 180 for axis in (0, 2))
            assert is_tilted or -0.001 < fallen_m < HOVER_M + 0.02, (house.name, entry.id, fallen_m)
            for axis in (0, 2):
                assert abs(body.centre_m[axis] - parent.centre_m[axis]) < parent.size_m[axis] / 2 + 0.5
        flat = [(bodies[entry.id], entry.id) for entry in small]
        for index, (first, first_id) in enumerate(flat):
            for second, second_id in flat[index + 1 :]:
                overlap_m = min(
                    (first.size_m[i] + second.size_m[i]) / 2 - abs(first.centre_m[i] - second.centre_m[i])
                    for i in range(3)
                )
                # Boxes of turned things share corners; the things themselves are apart.
                assert overlap_m < 0.12, (house.name, first_id, second_id, overlap_m)
    assert num_small > 30


def test_tasks_are_generated_from_fetched_houses(houses: list[House]) -> None:
    num_tasks = 0
    for house in houses:
        with contextlib.suppress(TaskRejectedError):
            generate_task(house, seed=1)
            num_tasks += 1
    assert num_tasks


def test_a_seed_makes_the_same_house_whatever_is_made_with_it(lines: list[str], out: Path) -> None:
    (again,) = made(out / "again.jsonl.gz", f"{SEEDS.start}:{SEEDS.start + 1}", out, workers=1)
    assert json.loads(again) == json.loads(lines[0])
