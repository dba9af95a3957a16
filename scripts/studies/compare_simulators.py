"""Evaluates tasks in the embedded simulator and through AI2-THOR's client on our engine; both must answer the same.

    python scripts/studies/compare_simulators.py OUT [--tasks DIR] [--limit N] [--agents fu,ftu] [--workers N]

Compares the records of the two runs as stored, then the images of both simulators, to the byte, at every pose that an
agent decided at.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import astuple
from pathlib import Path

import numpy as np

from evonav.component import Component
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.tasks.listing import BUNDLED_TASKS, TaskFile, task_files
from evonav.world.pose import Pose
from evonav.world.simulator import Simulator

EMBEDDED = Backend()
THOR = Backend(
    simulator=Component(
        "evonav.evaluation.run.components:ai2thor_simulator", {"executable": "evonav"}, {"timeout_s": 60.0}
    )
)


def evaluate_both(
    agents: Sequence[str], tasks: Sequence[TaskFile], out: Path, *, num_workers: int, max_rounds: int = 50
) -> tuple[Path, Path]:
    """Runs of both simulators.

    Returns:
        Their folders, the embedded simulator's first.
    """
    folders = out / "embedded", out / "ai2thor"
    for folder, backend in zip(folders, (EMBEDDED, THOR), strict=True):
        config = RunConfig(backend=backend, protocol=ProtocolConfig(max_rounds=max_rounds))
        evaluate(agents, tasks, folder, config=config, num_workers=num_workers)
    return folders


def differing_records(one: Path, other: Path) -> Iterator[str]:
    """What two runs disagree in, a line each."""
    with RunStore(one) as a, RunStore(other) as b:
        pairs = zip(a.records(), b.records(), strict=True)
        for left, right in pairs:
            place = f"{left.agent} {left.task_id}/{left.stage}"
            if not left.is_scored:
                yield f"{place}: {left.state.value}: {left.error}"
            for name in StageRecord.model_fields:
                if getattr(left, name) != getattr(right, name):
                    yield f"{place}: {name}: {_brief(getattr(left, name))} and {_brief(getattr(right, name))}"
        if list(a.record_texts()) != list(b.record_texts()) or list(a.floor_plans()) != list(b.floor_plans()):
            yield "the stored texts or the maps differ"


def differing_images(run: Path, tasks: Sequence[TaskFile], every: int = 1) -> Iterator[str]:
    """Where the images of the two simulators differ, at the poses of a run; ends with how many were compared."""
    num_images = 0
    with ExitStack() as stack, RunStore(run) as store:
        embedded, thor = EMBEDDED.simulator.create(), THOR.simulator.create()
        for simulator in (embedded, thor):
            stack.callback(simulator.close)
        for task in tasks:
            stages = EMBEDDED.tasks.create(task.path).stages
            records = list(store.records(task_id=task.task_id))
            for number, stage in enumerate(stages, start=1):
                starts = {embedded.reset(stage.house_json), thor.reset(stage.house_json)}
                if len(starts) != 1 or tuple(embedded.objects) != tuple(thor.objects):
                    yield f"{task.task_id}/{number}: start or objects differ"
                if not np.array_equal(embedded.occupancy().cells, thor.occupancy().cells):
                    yield f"{task.task_id}/{number}: occupancy differs"
                poses = {entry.pose for record in records if record.stage == number for entry in record.trace}
                for pose in sorted(poses, key=astuple)[::every]:
                    num_images += 1
                    for name in _differing(embedded, thor, pose):
                        yield f"{task.task_id}/{number}: {name} differs at {pose}"
    if num_images == 0:
        yield "there was no pose to compare images at"


def _differing(one: Simulator, other: Simulator, pose: Pose) -> Iterator[str]:
    left, right = one.render(pose), other.render(pose)
    for name in ("depth_m", "rgb", "instances"):
        a, b = np.asarray(getattr(left, name)), np.asarray(getattr(right, name))
        if (a.dtype, a.shape, a.tobytes()) != (b.dtype, b.shape, b.tobytes()):
            yield f"{name} ({int((a != b).sum())} values)"
    if (left.pose, left.intrinsics) != (right.pose, right.intrinsics):
        yield "camera"


def _brief(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 120 else f"{text[:120]}..."


def main() -> int:
    """Prints the differences; 1 if there are any."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for the two runs")
    parser.add_argument("--tasks", type=Path, help="folder of tasks; default: the bundled ones")
    parser.add_argument("--limit", type=int)
    parser.add_argument("--agents", default="fu,stage-reset,ftu")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=50)
    parser.add_argument("--every", type=int, default=1, help="compare images at every Nth pose")
    options = parser.parse_args()
    tasks = task_files(options.tasks or BUNDLED_TASKS, options.limit)
    folders = evaluate_both(
        options.agents.split(","), tasks, options.out, num_workers=options.workers, max_rounds=options.rounds
    )
    differences = [*differing_records(*folders), *differing_images(folders[0], tasks, options.every)]
    print("\n".join(differences) or f"{len(tasks)} tasks: records and images are the same")
    return 1 if differences else 0


if __name__ == "__main__":
    sys.exit(main())
