"""Define the kinds of problems of a task, and the report of its validation."""

from collections.abc import Mapping
from typing import Literal

from pydantic import NonNegativeInt

from evonav.records import Record

ProblemKind = Literal[
    "file",
    "schema",
    "checksum",
    "contradiction",
    "stranger",
    "dataset",
    "leak",
    "house",
    "change_record",
    "relocation",
    "state",
    "target",
    "penetration",
    "in_wall",
    "in_floor",
    "out_of_room",
    "unsupported",
    "room_cut_off",
    "start_cut_off",
    "reference_pose",
    "visibility",
    "reference_image",
    "path",
    "crash",
]

KINDS: Mapping[ProblemKind, str] = {
    "file": "missing, unreadable or damaged",
    "schema": "not as the JSON Schema says",
    "checksum": "contents do not match the header's checksum",
    "contradiction": "files contradict each other",
    "stranger": "a file that belongs to no stage of the task",
    "dataset": "dataset.json and the folder differ",
    "leak": "oracle data in a public file",
    "house": "a stage's house cannot be built",
    "change_record": "the change record is not the difference of two houses",
    "relocation": "displacement or `relocated` flags are wrong",
    "state": "the recorded state S is wrong",
    "target": "the target's record is wrong",
    "penetration": "two objects share space",
    "in_wall": "an object is in a wall, door or window",
    "in_floor": "an object is in a floor or ceiling",
    "out_of_room": "an object leaves its room",
    "unsupported": "an object stands on nothing",
    "room_cut_off": "a change cuts off a room",
    "start_cut_off": "the house's own start cannot be reached, which simulators begin at",
    "reference_pose": "not at the reference distance, not facing the target, or not free",
    "visibility": "the target's pixels are not those recorded",
    "reference_image": "not the view from the reference pose",
    "path": "no path, or a path of another length than recorded",
    "crash": "the check itself failed",
}


class Problem(Record):
    """One problem of a task."""

    task_id: str
    stage: NonNegativeInt
    """The stage's number; 0 for the task as a whole."""
    kind: ProblemKind
    detail: str


class Report(Record):
    """The result of validating one task."""

    task_id: str
    num_stages: NonNegativeInt
    problems: tuple[Problem, ...]
    source_counts: dict[str, NonNegativeInt]
    """Number of flaws that the source house itself has, by kind, over the first and all changed stages.

    A flaw such as `penetration` is no problem of the task if its objects were not moved there by the generator.
    """
