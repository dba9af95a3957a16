"""Runs of agents in the first bundled task."""

from collections.abc import Sequence
from pathlib import Path

from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.tasks.listing import BUNDLED_TASKS, task_files


def bundled_run(
    folder: Path,
    agents: Sequence[str],
    backend: Backend | None = None,
    *,
    seed: int = 0,
    **limits: int,
) -> list[StageRecord]:
    """Evaluate agents in the first bundled task, in this process, and return all records.

    Args:
        limits: Limits of `ProtocolConfig`.
    """
    config = RunConfig(seed=seed, backend=backend or Backend(), protocol=ProtocolConfig(**limits))
    evaluate(list(agents), task_files(BUNDLED_TASKS, 1), folder, config=config, num_workers=0)
    with RunStore(folder) as store:
        return [StageRecord.model_validate_json(text) for text in store.record_texts()]
