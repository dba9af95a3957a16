"""Packed runs whose headers somebody has tampered with: `verify` rejects each of them, for the right reason.

Where it says so, the forger corrects all scores that follow from what was altered.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from forged_pack import ForgedPack, assert_rejected, rescored

from evonav.submission.verify import verify
from evonav.tasks.listing import TaskFile

Forge = Callable[[ForgedPack], Any]


def test_a_forger_that_alters_nothing_is_accepted(parts: ForgedPack, tasks: list[TaskFile], tmp_path: Path) -> None:
    for mine in parts.rows:
        for row in mine:
            before = dict(row)
            rescored(row)
            assert row == before
    parts.claim()
    assert verify(parts.write(tmp_path / "same.gz"), tasks, scores_only=True).is_accepted


def setting(*path: str | int, value: Any) -> Forge:
    def forge(parts: ForgedPack) -> None:
        at: Any = parts.header
        for step in path[:-1]:
            at = at[step]
        at[path[-1]] = value

    return forge


def camera(**options: Any) -> Forge:
    return setting("config", "backend", "simulator_options", value=options)


def task_twice(parts: ForgedPack) -> None:
    """Every stage of the first task counts twice."""
    parts.header["tasks"].insert(1, parts.header["tasks"][0])
    for mine in parts.rows:
        mine[:4] = [row for row in mine[:4] for _ in range(2)]


def first_task_dropped(parts: ForgedPack) -> None:
    first = parts.header["tasks"].pop(0)["task_id"]
    parts.rows = [[row for row in mine if row["task_id"] != first] for mine in parts.rows]
    parts.claim()


def last_task_dropped(parts: ForgedPack) -> None:
    last = parts.header["tasks"].pop()["task_id"]
    parts.rows = [[row for row in mine if row["task_id"] != last] for mine in parts.rows]
    parts.claim()


def no_agents(parts: ForgedPack) -> None:
    parts.header["agents"], parts.rows = [], []
    parts.claim()


def agent_twice(parts: ForgedPack) -> None:
    parts.header["agents"][1] = "fu"
    parts.rows[1] = parts.rows[0]


def tasks_in_other_order(parts: ForgedPack) -> None:
    parts.header["tasks"].reverse()


HEADERS: dict[str, tuple[Forge, str, str]] = {
    "more rounds": (setting("config", "protocol", "max_rounds", value=80), "protocol", "max_rounds is 80"),
    "a larger radius": (
        setting("config", "protocol", "success_radius_m", value=3.0),
        "protocol",
        "success_radius_m is 3",
    ),
    "a text as radius": (setting("config", "protocol", "success_radius_m", value="2.0"), "protocol", "is '2.0'"),
    "a count with a point": (
        setting("config", "protocol", "max_rounds", value=50.0),
        "protocol",
        r"max_rounds is 50\.0",
    ),
    "truth in place of a number": (
        setting("config", "protocol", "max_views", value=True),
        "protocol",
        "max_views is True",
    ),
    "no protocol": (setting("config", "protocol", value=None), "protocol", "has no protocol"),
    "more protocol": (setting("config", "protocol", "surprise", value=1), "protocol", "surprise is 1"),
    "a huge camera": (camera(width_px=10**9), "protocol", "width_px = 1000000000: must be"),
    "a camera of text": (camera(height_px="300"), "protocol", "height_px = 300: must be"),
    "a camera without sight": (camera(hfov_deg=0.0), "protocol", "hfov_deg = 0.0: must be"),
    "another task's checksum": (setting("tasks", 0, "digest", value="0" * 64), "tasks", "another task than"),
    "more stages": (setting("tasks", 0, "num_stages", value=9), "tasks", "another task than"),
    "a foreign task": (setting("tasks", 0, "task_id", value="aa"), "tasks", "aa is not among"),
    "no tasks": (setting("tasks", value=[]), "tasks", "there is none"),
    "a task twice": (task_twice, "tasks", "each there once"),
    "tasks in another order": (tasks_in_other_order, "tasks", "in order"),
    "a hard task left out": (first_task_dropped, "tasks", "is missing"),
    "the last task left out": (last_task_dropped, "tasks", "only the first 1 of 2"),
    "no agents": (no_agents, "complete", "no agent"),
    "an agent twice": (agent_twice, "complete", "fu is there twice"),
    "an oracle": (setting("agents", 0, value="shortest-path"), "complete", "oracle baseline"),
    "another name": (setting("agents", 0, value="mine"), "complete", "fu .* instead of mine"),
    "control characters": (setting("agents", 0, value="fu\x1b[2J"), "file", "agents.0 = .*: .*printable"),
    "a long name": (setting("agents", 0, value="f" * 10**6), "file", "agents.0 = .*: .*1000 characters"),
    "agents exchanged": (lambda parts: parts.header["agents"].reverse(), "complete", "fu .* instead of ftu"),
    "an agent more": (lambda parts: parts.header["agents"].append("me"), "complete", "14 records of 21 stages"),
    "an agent less": (lambda parts: parts.header["agents"].pop(), "complete", "14 records of 7 stages"),
    "agents in one text": (setting("agents", value="fu"), "file", "agents = 'fu': Input should be"),
    "another format": (setting("format_version", value=2), "file", "format_version"),
    "an unknown field": (setting("surprise", value=1), "file", "surprise = 1: Extra"),
    "a field less": (lambda parts: parts.header.pop("config"), "file", 'missing "config"'),
    "a number as text": (setting("tasks", 0, "num_stages", value="4"), "file", "num_stages = '4': .*valid integer"),
    "no stages": (setting("tasks", 0, "num_stages", value=0), "file", "num_stages"),
    "a checksum that is none": (setting("tasks", 0, "digest", value="../x"), "file", "digest"),
    "NaN in the configuration": (setting("config", "seed", value=float("nan")), "file", "not as evonav writes"),
    "claimed success": (setting("summary", "agents", "fu", "sr", value=0.999), "scores", "agents.fu.sr is 0.999"),
    "claimed interval": (setting("summary", "agents", "fu", "spl_ci95", value=[0.9, 1.0]), "scores", "spl_ci95"),
    "claimed count": (setting("summary", "agents", "fu", "n", value=10**300), "scores", "agents.fu.n is 1000"),
    "claimed states": (setting("summary", "agents", "fu", "counts", "success", value=77), "scores", "counts.success"),
    "another agent's scores": (setting("summary", "agents", "me", value={"sr": 1.0}), "scores", "agents.me.sr"),
    "a summary of text": (setting("summary", value={"agents": "x" * 10**6}), "scores", "agents is x"),
    "an effect of its own": (setting("summary", "paired_differences", value=[]), "scores", "paired_differences"),
}


@pytest.mark.parametrize("name", HEADERS)
def test_a_forged_header_is_rejected(parts: ForgedPack, tasks: list[TaskFile], tmp_path: Path, name: str) -> None:
    forge, check, reason = HEADERS[name]
    forge(parts)
    verdict = verify(parts.write(tmp_path / "f.gz"), tasks, scores_only=True)
    assert_rejected(verdict, check, reason)
    assert max(len(one.detail) for one in verdict.checks) < 3000


def test_only_required_tasks_are_in_the_verdicts_summary(packed: Path, tasks: list[TaskFile]) -> None:
    verdict = verify(packed, tasks, limit=1, scores_only=True)
    assert verdict.is_accepted
    assert verdict.summary is not None
    assert {row["num_tasks"] for row in verdict.summary["agents"].values()} == {1}
    assert {row["num_stages"] for row in verdict.summary["agents"].values()} == {tasks[0].num_stages}
