"""Runs on tasks whose houses change during stages: the same records however they are run, and forged ones rejected."""

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from forged_pack import ForgedPack, assert_rejected, line_of, rescored

from evonav.evaluation.records.schema import StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.generation import GenerationParameters, generate_task
from evonav.house import bundled_houses
from evonav.submission.pack import pack
from evonav.submission.verify import verify
from evonav.tasks.files import load_task, write_task
from evonav.tasks.listing import TaskFile, task_files

Row = dict[str, Any]
AGENTS = ["fu", "nearest-frontier"]


@pytest.fixture(scope="module")
def tasks(tmp_path_factory: pytest.TempPathFactory) -> list[TaskFile]:
    values = {"num_stages": [3], "extensions": {"during_stage": {"probability": 1.0, "rounds": [1, 3]}}}
    config = GenerationParameters.model_validate_json(json.dumps(values))
    folder = tmp_path_factory.mktemp("tasks")
    houses = [house for house in bundled_houses() if 3 <= len(house.rooms) <= 5][:2]
    for house in houses:
        write_task(generate_task(house, seed=1, config=config), folder)
    return task_files(folder)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, tasks: list[TaskFile]) -> Path:
    folder = tmp_path_factory.mktemp("run") / "run"
    evaluate(AGENTS, tasks, folder, num_workers=0)
    return folder


@pytest.fixture(scope="module")
def packed(run: Path) -> Path:
    path = run.with_suffix(".gz")
    pack(run, path)
    return path


def records_of(run: Path) -> dict[tuple[str, str, int], str]:
    with RunStore(run) as store:
        return {
            (agent, task_id, stage): text
            for agent in AGENTS
            for task_id in store.meta("num_stages")
            for stage, text in enumerate(store.record_texts(agent, task_id), start=1)
        }


@pytest.mark.slow
def test_records_do_not_depend_on_workers_or_episodes_at_once(run: Path, tasks: list[TaskFile], tmp_path: Path) -> None:
    evaluate(AGENTS, tasks, tmp_path / "many", num_workers=2, episodes_at_once=2)
    found = records_of(run)
    assert found == records_of(tmp_path / "many")
    changed = [json.loads(text)["during"]["at_round"] for text in found.values()]
    assert sum(at is not None for at in changed) >= 6


def test_an_interrupted_run_goes_on_to_the_same_records(run: Path, tasks: list[TaskFile], tmp_path: Path) -> None:
    num_seen = 0

    def interrupt(_: object) -> None:
        nonlocal num_seen
        num_seen += 1
        if num_seen == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate(AGENTS, tasks, tmp_path / "run", num_workers=0, on_progress=interrupt)
    evaluate(AGENTS, tasks, tmp_path / "run", num_workers=0)
    assert records_of(tmp_path / "run") == records_of(run)


def test_an_honest_pack_is_accepted(packed: Path, tasks: list[TaskFile]) -> None:
    verdict = verify(packed, tasks)
    assert verdict.is_accepted, verdict.checks


def during(**fields: Any) -> Callable[[Row], None]:
    def forge(row: Row) -> None:
        row["during"] |= fields
        rescored(row)

    return forge


def another_move(row: Row) -> None:
    row["during"]["change"]["relocations"][0]["to_m"][0] += 0.5


def no_change(row: Row) -> None:
    del row["during"]
    rescored(row)


def target_at_the_end(row: Row) -> None:
    during(target_position_m=[row["terminal"]["x_m"], 0.5, row["terminal"]["z_m"]])(row)


NOT_REACHED = {
    "at_round": None,
    "target_position_m": None,
    "is_target_relocated": False,
    "path_before_m": None,
    "reference_after_m": None,
    "skipped_ids": [],
}
FORGERIES: dict[str, tuple[Callable[[Row], None], str]] = {
    "another round": (during(round=40), "during is another than the task's"),
    "not reached": (during(**NOT_REACHED), r"during\.at_round"),
    "another move": (another_move, "during is another than the task's"),
    "no change": (no_change, "during is another than the task's"),
    "target at the end": (target_at_the_end, r"during\.target_position_m"),
    "a stranger in the way": (during(skipped_ids=["nobody"]), r"during\.skipped_ids"),
    "another path before": (during(path_before_m=0.125), r"during\.path_before_m"),
}


def written(parts: ForgedPack, folder: Path) -> Path:
    """The pack with its lines as evonav writes them; JSON of Python writes small numbers in another way."""
    records = [StageRecord.model_validate(row, strict=False) for mine in parts.rows for row in mine]
    return parts.write(
        folder / "f.gz", [line_of(parts.header), *(record.model_dump_json().encode() for record in records)]
    )


def changed_row(pack: ForgedPack) -> Row:
    return next(row for row in pack.rows[0] if row["during"]["at_round"] is not None)


@pytest.mark.parametrize("name", FORGERIES)
def test_forged_changes_are_rejected(packed: Path, tasks: list[TaskFile], tmp_path: Path, name: str) -> None:
    parts = ForgedPack.of(packed)
    forge, reason = FORGERIES[name]
    row = changed_row(parts)
    before = copy.deepcopy(row)
    forge(row)
    assert row != before
    parts.claim()
    assert_rejected(verify(written(parts, tmp_path), tasks, scores_only=True), "targets", reason)


def test_actions_show_who_stood_in_the_way(packed: Path, tasks: list[TaskFile], tmp_path: Path) -> None:
    """An object that is said to have stayed, for no reason."""
    parts = ForgedPack.of(packed)
    row = changed_row(parts)
    moved = [one["object_id"] for one in row["during"]["change"]["relocations"]]
    row["during"]["skipped_ids"] = [one for one in moved if one != row["target"]["object_id"]][:1]
    parts.claim()
    assert_rejected(verify(written(parts, tmp_path), tasks), "actions", "during")


def test_a_task_with_another_round_is_another_task(
    packed: Path, tasks: list[TaskFile], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("forged")
    for listed in tasks:
        task = load_task(listed.path)
        stages = [
            stage.model_copy(update={"during": stage.during.model_copy(update={"round": 4})})
            for stage in task.oracle_stages
            if stage.during is not None
        ]
        assert len(stages) == 3
        write_task(replace(task, oracle_stages=tuple(stages)).with_checksums(), folder)
    assert_rejected(verify(packed, task_files(folder)), "tasks", "another task")
