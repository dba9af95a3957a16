"""Whatever an agent says costs its own stage at most, in any process, and the run can be resumed."""

import json
import sqlite3
from contextlib import closing
from dataclasses import replace

import pytest
from hostile_values import ENDS, ERRORS, RAW, STAGES
from toy_house import write_tasks
from toy_run import TOY, records, texts

from evonav.agents.hosting import wire
from evonav.component import Component
from evonav.errors import StoreError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.report.pages.run_page import write_report
from evonav.tasks.listing import task_files

SHORT = ProtocolConfig(max_rounds=2)


def evaluate_long(agent, num_stages, folder, num_workers, protocol=SHORT):
    """Evaluate an agent of hostile_values on one task of so many stages, and return its records."""
    if not (folder / "tasks").exists():
        write_tasks(folder / "tasks")
    tasks = [replace(task, num_stages=num_stages) for task in task_files(folder / "tasks", 1)]
    backend = replace(TOY, tasks=Component("hostile_values:load_long", {"num_stages": num_stages}))
    config = RunConfig(backend=backend, protocol=protocol)
    name = f"hostile_values:{agent}"
    evaluate([name], tasks, folder / "run", config=config, num_workers=num_workers, num_retries=0)
    return records(folder / "run", name)


@pytest.fixture(scope="module", params=[0, 1], ids=["in this process", "in its own"])
def num_workers(request):
    return request.param


def check(found, messages, kind=ErrorKind.AGENT):
    assert len(found) == len(messages) + 1
    assert found[-1].is_scored  # and the agent goes on
    for record, message in zip(found, messages, strict=False):
        if message is None:
            assert record.is_scored, record.error
            continue
        assert record.state is EndState.ERRORED, message
        assert record.error.kind in (kind, ErrorKind.DECISION)
        assert message in record.error.message
        assert len(record.error.message) <= wire.MAX_FAILURE
        assert record.memory_lost_at is None


@pytest.mark.slow
def test_what_an_agent_says_costs_its_stage_alone(tmp_path, num_workers):
    messages = [message for *_, message in STAGES]
    found = evaluate_long("Saying", len(STAGES), tmp_path, num_workers)
    check([*found, found[-1]], messages)
    before = texts(tmp_path / "run")
    assert evaluate_long("Saying", len(STAGES), tmp_path, num_workers) == found
    with RunStore(tmp_path / "run") as store:
        store.forget_episode("hostile_values:Saying", found[0].task_id, len(STAGES) // 2)
    evaluate_long("Saying", len(STAGES), tmp_path, num_workers)
    assert texts(tmp_path / "run") == before
    page = write_report(tmp_path / "run").read_text(encoding="utf-8")
    assert "<script>alert(1)" not in page


@pytest.mark.slow
def test_what_an_agent_raises_costs_its_stage_alone(tmp_path, num_workers):
    found = evaluate_long("Raising", len(ERRORS) + 1, tmp_path, num_workers)
    # `str` that exits ends no process either: a description of the error is not the agent's to refuse.
    check(found, [message for _, message in ERRORS])
    with RunStore(tmp_path / "run") as store:
        assert all(len(failure.traceback) <= 20_000 for failure in store.failures())


@pytest.mark.slow
def test_an_agent_that_exits_ends_its_stage_and_not_the_run(tmp_path, num_workers):
    found = evaluate_long("Ending", len(ENDS) + 1, tmp_path, num_workers)
    kind = ErrorKind.CRASH if num_workers else ErrorKind.AGENT
    assert [record.error and record.error.kind for record in found] == [kind] * len(ENDS) + [None]
    assert found[-1].is_scored


@pytest.mark.slow
def test_an_agent_in_its_own_process_cannot_forge_answers(tmp_path):
    found = evaluate_long("Forging", len(RAW) + 1, tmp_path, 1)
    check(found, [message for *_, message in RAW])
    with RunStore(tmp_path / "run") as store:
        for costs in store.costs().values():
            assert all(isinstance(value, int | float) and abs(value) < 1e15 for value in costs.values())


@pytest.mark.slow
def test_all_rounds_of_a_stage_together_are_bounded(tmp_path, num_workers):
    found = evaluate_long("Talkative", 2, tmp_path, num_workers, ProtocolConfig(max_rounds=40))
    check(found, ["bytes of JSON in a stage: must be at most 32000000"])


@pytest.fixture
def poisoned(tmp_path):
    """A run in whose file somebody put a null where a number belongs."""
    evaluate_long("Raising", 3, tmp_path, 0)
    path = tmp_path / "run" / "records.sqlite"
    with closing(sqlite3.connect(path)) as db, db:
        ((text,),) = db.execute("SELECT record FROM stages WHERE stage = 2").fetchall()
        record = json.loads(text)
        record["entries"] = [{**json.loads(entry_text()), "centre_m": [0.0, None, 0.0]}]
        db.execute("UPDATE stages SET record = ? WHERE stage = 2", (json.dumps(record),))
    return tmp_path


def entry_text():
    return (
        '{"entry_id": 1, "label": "Mug", "centre_m": [0, 0, 0], "size_m": [1, 1, 1],'
        ' "num_detections": 1, "is_stale": false}'
    )


NAMED = "the record of hostile_values:Raising, toy-moved, stage 2 is not valid: entries.0.centre_m.1 = None"


def test_a_reader_names_a_record_that_is_not_valid(poisoned):
    with RunStore(poisoned / "run") as store, pytest.raises(StoreError, match=NAMED) as caught:
        list(store.records())
    assert "\n" not in str(caught.value)


def test_a_run_with_such_a_record_is_left_as_it_is(poisoned):
    before = texts(poisoned / "run")
    with pytest.raises(StoreError, match=NAMED):
        evaluate_long("Raising", 3, poisoned, 0)
    assert texts(poisoned / "run") == before
