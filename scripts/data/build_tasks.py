"""Makes the tasks that come with evonav: `python scripts/data/build_tasks.py [--check]`, in about half a minute.

The first houses with test assets of each number of rooms, seed 0, the paper's parameters. The output is a function of
this list, of `python/evonav/data/houses.jsonl.gz` and of the code; `--check` says whether it is what is there.
"""

import argparse
import hashlib
import io
import shutil
import sys
from collections import Counter
from pathlib import Path

from PIL import Image

from evonav.generation import GenerationParameters, TaskRejectedError, generate_task
from evonav.house import House, bundled_houses
from evonav.tasks import Task, load_tasks, write_task
from evonav.tasks.dataset import DatasetRecord, SourceFile, entry_of, write_dataset

ROOT = Path(__file__).resolve().parents[2] / "python" / "evonav" / "data" / "tasks"
HOUSES = ROOT.parent / "houses.jsonl.gz"
SEED = 0
FIRST_TEST_HOUSE = 84
"""Line of the first house with test assets."""
NUM_TASKS = {2: 5, 3: 4, 4: 4, 5: 4, 6: 3, 7: 2, 8: 1, 10: 1}
"""Tasks by number of rooms."""


def chosen_houses() -> list[House]:
    """The houses of the tasks, in file order."""
    houses = [house for number, house in enumerate(bundled_houses(), start=1) if number >= FIRST_TEST_HOUSE]
    taken: Counter[int] = Counter()
    chosen = []
    for house in houses:
        num_rooms = len(house.rooms)
        if taken[num_rooms] < NUM_TASKS.get(num_rooms, 0):
            taken[num_rooms] += 1
            chosen.append(house)
    return chosen


def build_tasks() -> list[Task]:
    """The tasks, in order of task id."""
    parameters = GenerationParameters()
    tasks = []
    for house in chosen_houses():
        try:
            tasks.append(generate_task(house, seed=SEED, config=parameters, dataset="evonav-mini", split="test"))
        except TaskRejectedError as error:
            sys.stderr.write(f"left out: {error}\n")
    return sorted(tasks, key=lambda task: task.task_id)


def record_of(tasks: list[Task]) -> DatasetRecord:
    """`dataset.json`."""
    sha256 = hashlib.sha256(HOUSES.read_bytes()).hexdigest()
    return DatasetRecord(
        name="evonav-mini",
        split="test",
        generator=tasks[0].header.generator,
        sources=(SourceFile(name=HOUSES.name, sha256=sha256),),
        seed=SEED,
        limit=None,
        subset=None,
        allow_unknown_assets=False,
        parameters=tasks[0].header.parameters,
        num_houses=len(tasks),
        num_tasks=len(tasks),
        tasks=tuple(entry_of(task) for task in tasks),
        rejections=(),
    )


def compress(path: Path) -> None:
    """Writes an image again, as small as Pillow can without loss."""
    content = io.BytesIO()
    with Image.open(path) as image:
        image.save(content, "PNG", optimize=True)
    path.write_bytes(content.getvalue())


def main() -> int:
    """Writes the tasks, or compares them with those there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="compare only; 1 if they differ")
    parser.add_argument("--out", type=Path, default=ROOT, help="folder of the tasks; what is there is removed")
    arguments = parser.parse_args()
    root = arguments.out
    tasks = build_tasks()
    if arguments.check:
        there = {task.task_id: task.header for task in load_tasks(root)}
        differing = {task.task_id for task in tasks if there.pop(task.task_id, None) != task.header} | there.keys()
        for task_id in sorted(differing):
            sys.stderr.write(f"differs: {task_id}\n")
        return int(bool(differing))
    if root.exists():
        shutil.rmtree(root)
    for task in tasks:
        for image in (write_task(task, root) / "public").glob("*.png"):
            compress(image)
    write_dataset(record_of(tasks), root)
    num_bytes = sum(path.stat().st_size for path in root.rglob("*") if path.is_file())
    num_stages = sum(task.num_stages for task in tasks)
    sys.stdout.write(f"{len(tasks)} tasks, {num_stages} stages, {num_bytes / 1e6:.2f} MB in {root}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
