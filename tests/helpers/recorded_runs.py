"""Fixtures of recorded runs: one made up by hand, and one of agents for the viewer."""

from pathlib import Path

import pytest
from made_up_run import WriteRun, entry, record_run, stage_record

from evonav.component import Component
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.tasks.listing import BUNDLED_TASKS, task_files


@pytest.fixture
def write_run(tmp_path: Path) -> WriteRun:
    """Writes a run and returns its folder: six tasks of two stages, agents `fu` and `ftu`."""

    def write(name: str = "run", num_tasks: int = 6, *, is_complete: bool = True) -> Path:
        records = []
        tasks = [f"task-{i}" for i in range(num_tasks)]
        stale = entry("Plate", (2.3, 0.8, 2.0), is_stale=True)
        for i, task_id in enumerate(tasks):
            for stage in (1, 2):
                # fu finds the target in every stage 1, ftu in all but one stage; fu trusts its memory in stage 2.
                fu = EndState.SUCCESS if stage == 1 else EndState.FAILURE
                ftu = EndState.FAILURE if (i, stage) == (0, 1) else EndState.SUCCESS
                chosen = stale if stage == 2 else None
                records.append(stage_record("fu", task_id, stage, fu, chosen=chosen, entries=[stale] if chosen else []))
                records.append(stage_record("ftu", task_id, stage, ftu))
        if not is_complete:
            last = tasks[-1]
            records = [r for r in records if not (r.agent == "ftu" and r.task_id == last)]
            records.append(stage_record("ftu", last, 1, EndState.ERRORED))
        return record_run(tmp_path / name, records, dict.fromkeys(tasks, 2), ["fu", "ftu"])

    return write


@pytest.fixture(scope="session")
def viewed_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundled task in which entries go stale, an agent that is shown images, and one that tells nothing."""
    path = tmp_path_factory.mktemp("run")
    config = RunConfig(
        backend=Backend(decision=Component("viewer_run:scripted")), protocol=ProtocolConfig(max_rounds=9)
    )
    evaluate(["fu", "random-walk"], task_files(BUNDLED_TASKS, 2)[1:], path, config=config, num_workers=0)
    return path
