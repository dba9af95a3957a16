"""Packed runs that only the execution of their actions finds out: all else follows from what was altered."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from forged_pack import ForgedPack, assert_rejected, line_of, rescored

from evonav.submission.verify import verify
from evonav.tasks.listing import TaskFile


def a_longer_reference_path(row: dict[str, Any]) -> None:
    row["reference_length_m"] += 1.0


def a_straighter_walk(row: dict[str, Any]) -> None:
    entry = next(entry for entry in row["trace"] if len(entry["path_m"]) > 2)
    entry["path_m"][1] = [
        0.999 * entry["path_m"][1][axis] + 0.0005 * (entry["path_m"][0][axis] + entry["path_m"][2][axis])
        for axis in (0, 1)
    ]
    entry["path_m"][1][0] += 0.001


def a_target_in_sight(row: dict[str, Any]) -> None:
    entry = next(entry for entry in row["trace"] if not entry["is_target_visible"])
    entry["is_target_visible"] = True


def another_action(row: dict[str, Any]) -> None:
    entry = next(entry for entry in row["trace"] if entry["action"]["kind"] == "navigate_to")
    entry["action"]["position_m"] = [0.0, 0.0]


def another_heading(row: dict[str, Any]) -> None:
    row["trace"][-1]["pose"]["yaw_rad"] += 0.5


def a_fresh_entry(row: dict[str, Any]) -> None:
    entry = next(entry for entry in row["entries"] if not entry["is_stale"])
    entry["is_stale"] = True


def a_better_memory(row: dict[str, Any]) -> None:
    row["memory_at_end"]["num_right"] += 1


def a_blocked_step(row: dict[str, Any]) -> None:
    row["trace"][0]["is_action_success"] = not row["trace"][0]["is_action_success"]


def a_box_nearby(row: dict[str, Any]) -> None:
    row["terminal_box_distance_m"] = 0.01


@pytest.mark.parametrize(
    ("forge", "reason"),
    [
        (a_longer_reference_path, "reference_length_m"),
        (a_straighter_walk, "path_m|path_length_m"),
        (a_target_in_sight, "is_target_visible|num_target_visible"),
        (another_action, "trace|rounds|state"),
        (another_heading, "yaw_rad"),
        (a_fresh_entry, "is_stale"),
        (a_better_memory, "num_right"),
        (a_blocked_step, "is_action_success"),
        (a_box_nearby, "terminal_box_distance_m"),
    ],
)
def test_the_actions_tell_what_scores_do_not(
    parts: ForgedPack, tasks: list[TaskFile], tmp_path: Path, forge: Callable[[dict[str, Any]], None], reason: str
) -> None:
    row = max(parts.rows[0][:4], key=lambda row: len(row["trace"]))
    before = line_of(row)
    forge(row)
    rescored(row)
    assert line_of(row) != before
    parts.claim()
    path = parts.write(tmp_path / "f.gz")
    assert verify(path, tasks, limit=1, scores_only=True).is_accepted, "the forger's scores follow"
    assert_rejected(verify(path, tasks, limit=1), "actions", reason)


@pytest.mark.parametrize("simulator", ["os:system", "evonav.evaluation.run.components:ai2thor_simulator", "", "x.py:f"])
def test_no_other_simulator_is_taken_from_a_file(
    parts: ForgedPack, tasks: list[TaskFile], tmp_path: Path, simulator: str
) -> None:
    parts.header["config"]["backend"]["simulator"] = simulator
    assert_rejected(verify(parts.write(tmp_path / "f.gz"), tasks), "actions", "only in evonav's own simulator")
