"""Files of small houses, and folders of tasks compared byte by byte."""

import gzip
import json
from importlib.resources import files
from typing import Any

from evonav.generation.worker import GenerationOptions
from evonav.house import House
from evonav.tasks.dataset import DatasetRecord, HouseRejection, SourceFile, TaskEntry
from evonav.tasks.parameters import GenerationParameters
from evonav.tasks.records import sha256_of

OPTIONS = GenerationOptions(parameters=GenerationParameters(reference_image_px=64, reference_min_visible_px=4))

MALFORMED, SINGLE = 2, 5
"""Indices of the houses without a task."""


def smallest(count):
    with gzip.open(str(files("evonav") / "data" / "houses.jsonl.gz"), "rt") as lines:
        return sorted(lines, key=len)[:count]


def write_houses(path, count):
    houses = smallest(count)
    single = json.loads(houses[0])
    single["rooms"] = single["rooms"][:1]
    kept = {wall["id"] for wall in single["walls"] if wall["roomId"] == single["rooms"][0]["id"]}
    single["walls"] = [wall for wall in single["walls"] if wall["id"] in kept]
    single |= {"doors": [], "windows": [], "objects": []}
    House(json.dumps(single), name="single")
    houses.insert(MALFORMED, '{"rooms": 3}\n')
    houses.insert(SINGLE, json.dumps(single) + "\n")
    path.write_text("".join(houses))
    return path


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def assert_same(folder, expected):
    there, here = contents(folder), contents(expected)
    assert there.keys() == here.keys()
    # The lock's file says who writes.
    assert [name for name in here if there[name] != here[name] and name != ".lock"] == []


def record_of(entries: tuple[TaskEntry, ...], **changes: Any) -> DatasetRecord:
    """Return the record of tasks of a data set, and of a house that gave none."""
    rejection = HouseRejection(house="a.jsonl:2", reason="too_few_rooms", stage=0, detail="1 room(s)")
    fields: dict[str, Any] = {
        "name": "evonav",
        "split": "test",
        "generator": "evonav 0",
        "sources": (SourceFile(name="a.jsonl", sha256=sha256_of(b"a")),),
        "seed": 0,
        "limit": None,
        "subset": None,
        "allow_unknown_assets": False,
        "parameters": GenerationParameters(),
        "num_houses": len(entries) + 1,
        "num_tasks": len(entries),
        "tasks": entries,
        "rejections": (rejection,),
    }
    return DatasetRecord(**{**fields, **changes})
