"""Object records against those that AI2-THOR wrote itself."""

import gzip
import json
import os
from pathlib import Path
from typing import Any

import pytest

from evonav.house import bundled_houses
from evonav.thor import objects
from evonav.thor.engine import Engine

Json = dict[str, Any]

ROOT = Path(__file__).parents[2]
SHARED = Path(os.environ.get("EVONAV_SHARED", ROOT.parent / "shared")) / "data"
RECORDED = SHARED / "ram81-procthor-1k"
needs_recorded = pytest.mark.skipif(not RECORDED.is_dir(), reason="recorded data is not in ../shared ($EVONAV_SHARED)")


def engine_of(house: Json) -> Engine:
    engine = Engine()
    engine.configure()
    assert engine.execute({"action": "CreateHouse", "house": house}).is_success
    start = engine.scene.simulator.pose
    engine.agent.x_m, engine.agent.z_m = start.x_m, start.z_m
    return engine


def rows(path: Path) -> list[Json]:
    return [json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()]


def recorded_cubes() -> list[Json]:
    episodes = rows(RECORDED / "procthor-attr-onav-locobot-val.jsonl.gz")
    return [record for episode in episodes for record in episode["targetObjectConfig"]["positions"].values()]


@needs_recorded
def test_records_have_the_fields_of_recorded_ones() -> None:
    house = json.loads(next(iter(bundled_houses(1))).to_json())
    scene = engine_of(house).scene
    fields = set(recorded_cubes()[0])
    assert all(set(record) == fields for record in objects.static_records(scene))
