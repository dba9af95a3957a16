"""What can be wrong with a task."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from pydantic import NonNegativeInt

from evonav.tasks.records import Record

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

KINDS: Mapping[ProblemKind, str] = MappingProxyType(
    {
        "file": "missing, unreadable or damaged",
        "schema": "not as the JSON Schema says",
        "checksum": "contents do not match the header's checksum",
        "contradiction": "files contradict each other",
        "stranger": "a file that belongs to no task",
        "dataset": "dataset.json and the folder differ",
        "leak": "something of the oracle in a public file",
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
        "reference_image": "not what is seen from the reference pose",
        "path": "no way, or of another length than recorded",
        "crash": "the check itself failed",
    }
)


class Problem(Record):
    """One thing that is wrong."""

    task_id: str
    stage: NonNegativeInt
    """0: of the task as a whole."""
    kind: ProblemKind
    detail: str


class Report(Record):
    """All about one task."""

    task_id: str
    num_stages: NonNegativeInt
    problems: tuple[Problem, ...]
    own: dict[str, NonNegativeInt]
    """What the source house itself has of `penetration`, `in_wall` and the like, which nobody moved there: no
    problems. Counted over changed stages and the first."""
