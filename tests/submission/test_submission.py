"""Packed runs: true ones are accepted, and whatever is altered in one is found."""

import json
import re
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.submission.file import About
from evonav.submission.pack import pack
from evonav.submission.rescore import rescore
from evonav.submission.verify import verify
from evonav.tasks.listing import TaskFile, task_files

SELF_REPORTED = (
    r"agent",
    r"trace\.\d+\.(choice|num_entries|num_frontiers)",
    r"trace\.\d+\.(counters|details)\..*",
    r"(trace\.\d+\.chosen_entry|entries\.\d+)\.(entry_id|label|centre_m\.\d|size_m\.\d|num_detections)",
    # What it held between rounds and stages, which records tell of the end of a stage alone.
    r"(memory_at_start|stale_entries\.\d+|moved_objects\.\d+)\..*",
    r"num_forgotten",
)
"""What an agent says of itself: no part of a score, and mostly nothing can tell whether it is true."""


@pytest.fixture(scope="module")
def tasks() -> list[TaskFile]:
    from evonav.tasks.listing import BUNDLED_TASKS

    return task_files(BUNDLED_TASKS, 1)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, tasks: list[TaskFile]) -> Path:
    folder = tmp_path_factory.mktemp("packed") / "run"
    evaluate(["ftu"], tasks, folder, num_workers=0)
    return folder


@pytest.fixture(scope="module")
def packed(run: Path) -> Path:
    target = run.with_name("run.evonav.jsonl.gz")
    pack(run, target, about=About(title="A title", authors="Us"))
    return target


def test_true_submission_is_accepted_and_has_the_runs_scores(packed: Path, run: Path, tasks: list[TaskFile]) -> None:
    verdict = verify(packed, tasks)
    assert verdict.is_accepted, verdict.checks
    assert verdict.is_rescored
    assert verdict.submission is not None
    assert verdict.submission.about.title == "A title"
    summary = json.loads((run / "summary.json").read_text())
    assert verdict.submission.summary["agents"]["ftu"] == summary["agents"]["ftu"]


def test_equal_runs_give_equal_files(packed: Path, run: Path, tmp_path: Path) -> None:
    pack(run, tmp_path / "again.gz", about=About(title="A title", authors="Us"))
    assert (tmp_path / "again.gz").read_bytes() == packed.read_bytes()


def leaves(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if isinstance(value, dict) and value:
        for key, part in value.items():
            yield from leaves(part, (*path, key))
    elif isinstance(value, list) and value:
        for index, part in enumerate(value):
            yield from leaves(part, (*path, index))
    else:
        yield path


def altered(document: Any, path: tuple[str | int, ...]) -> Any:
    document = json.loads(json.dumps(document))
    at = document
    for step in path[:-1]:
        at = at[step]
    old = at[path[-1]]
    new: Any
    if isinstance(old, bool):
        new = not old
    elif isinstance(old, int):
        new = old + 1
    elif isinstance(old, float):
        new = old + 1e-6
    elif isinstance(old, str):
        new = old + "x"
    else:  # null, or an empty list or object
        new = [1] if isinstance(old, list) else {"x": 1} if isinstance(old, dict) else 1.5
    at[path[-1]] = new
    return document


def test_any_altered_field_of_a_record_is_found_by_carrying_the_actions_out(run: Path, tasks: list[TaskFile]) -> None:
    backend = Backend()
    case, simulator = backend.tasks.create(tasks[0].path), backend.simulator.create()
    with RunStore(run) as store:
        records = {record.stage: record for record in store.records("ftu")}
    document = json.loads(records[1].model_dump_json())
    assert document["entries"], "an agent without memory would leave the list of entries untried"
    seen: dict[str, str] = {}
    for path in leaves(document):
        name = ".".join(map(str, path))
        kind = re.sub(r"\d+", "N", name)
        if path[0] == "trace" and path[1] != len(document["trace"]) // 2:
            continue
        if kind in seen and "position_m" not in kind:
            continue
        seen[kind] = name
        try:
            forged = StageRecord.model_validate(altered(document, path), strict=False)
        except ValueError:
            continue  # not a record at all: the file is refused
        if forged == records[1]:
            continue
        _, differences = next(iter(rescore(case, {**records, 1: forged}, simulator, ProtocolConfig())))
        if path[0] == "sensing" or "face_m" in path:  # counts by what came of it, which may be nothing
            continue
        is_own_words = any(re.fullmatch(pattern, name) for pattern in SELF_REPORTED)
        assert differences or is_own_words, name
    assert len(seen) > 60
    simulator.close()


def test_incomplete_runs_and_baselines_are_refused(run: Path, tasks: list[TaskFile], tmp_path: Path) -> None:
    import shutil

    with pytest.raises(InvalidArgumentError, match="no agent 'fu'; it has ftu"):
        pack(run, tmp_path / "x.gz", agents=["fu"])
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    with RunStore(copy) as store:
        store.forget_episode("ftu", tasks[0].task_id, 2)
    with pytest.raises(InvalidArgumentError, match="ftu is incomplete: 1 of"):
        pack(copy, tmp_path / "x.gz")
    baselines = ["random-walk", "shortest-path", "stay-still"]
    evaluate(baselines, tasks, tmp_path / "still", num_workers=0)
    with pytest.raises(InvalidArgumentError, match="no agent to pack"):
        pack(tmp_path / "still", tmp_path / "x.gz")
    for agent in baselines:
        with pytest.raises(InvalidArgumentError, match=f"{agent} is a baseline"):
            pack(tmp_path / "still", tmp_path / "x.gz", agents=[agent])
    with pytest.raises(StoreError, match="no run here"):
        pack(tmp_path / "nowhere", tmp_path / "x.gz")
    assert not (tmp_path / "x.gz").exists()
    evaluate(["ftu"], tasks, tmp_path / "still", num_workers=0)
    assert pack(tmp_path / "still", tmp_path / "x.gz").agents == ("ftu",), "baselines are left out by default"


def test_run_of_another_protocol_packs_but_is_rejected(tasks: list[TaskFile], tmp_path: Path) -> None:
    config = RunConfig(protocol=ProtocolConfig(max_rounds=3))
    evaluate(["fu"], tasks, tmp_path / "short", config=config, num_workers=0)
    pack(tmp_path / "short", tmp_path / "short.gz")
    verdict = verify(tmp_path / "short.gz", tasks)
    failed = [check for check in verdict.checks if not check.is_passed]
    assert [check.name for check in failed] == ["protocol"]
    assert failed[0].detail == "max_rounds is 3, the benchmark's is 50"
    assert asdict(ProtocolConfig())["max_rounds"] == 50


def test_agent_that_says_nothing_of_itself_is_accepted(tasks: list[TaskFile], tmp_path: Path) -> None:
    agent = f"{Path(__file__).parents[2] / 'examples' / 'own_agent.py'}:OwnAgent"
    evaluate([agent], tasks, tmp_path / "silent", num_workers=0)
    pack(tmp_path / "silent", tmp_path / "silent.gz")
    assert verify(tmp_path / "silent.gz", tasks).is_accepted
