"""Whole runs under simulated perception: the ground truth's where it is perfect."""

from pathlib import Path

from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.evaluation.run.settings import PerceptionSettings
from evonav.tasks.listing import BUNDLED_TASKS, task_files


def records(out: Path, word: str, num_workers: int) -> list[str]:
    """Of two bundled tasks, a few rounds a stage."""
    backend = Backend(perception=PerceptionSettings(make=word).component())
    config = RunConfig(seed=3, backend=backend, protocol=ProtocolConfig(max_rounds=6))
    evaluate(["fu"], task_files(BUNDLED_TASKS, 2, None), out, config=config, num_workers=num_workers)
    with RunStore(out) as store:
        return [record.model_dump_json() for record in store.records("fu")]


def test_records_of_perfect_perception_are_the_truths(tmp_path: Path) -> None:
    poor = records(tmp_path / "1", "noisy:poor", 1)
    exact = records(tmp_path / "gt", "gt", 0)
    assert records(tmp_path / "perfect", "noisy:perfect", 0) == exact
    assert poor != exact
    assert len(poor) >= 6
