"""Fit how much the goal's picture tells: the numbers of `evonav.decision.appearance`.

    python scripts/data/calibrate_goal_pictures.py --out OUT

Tasks are generated for half of the bundled houses, by the hash of their content, without those of bundled tasks. For
every goal, the target and the objects of its category in the same house are looked at from random places within 4 m;
the three views that show one largest are compared with the reference image. A logistic regression, in which targets and
others weigh the same, gives the logarithm of the likelihood ratio. No agent moves, and no rate of success is used.
"""

import argparse
import hashlib
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import evonav
from evonav.decision.appearance import goal_layout
from evonav.house.files import HouseTexts
from evonav.memory.colours import Layout, distance, layouts
from evonav.memory.views import NUM_LARGEST
from evonav.tasks.manifest import Task
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

REACH_M, MIN_AREA_PX, NUM_PLACES, MAX_TURN_RAD = 4.0, 60, 8, 0.6
"""Views: farthest place, smallest object, number of places to try, largest angle between view and object."""
NUM_PARTS = 5
"""Number of parts of the cross-validation, by house."""


def design_tasks(out: Path) -> list[Task]:
    """Return tasks of the design houses that no bundled task uses."""
    used = {task.task_id.split("-")[1].lstrip("0") for task in evonav.load_tasks("bundled")}
    texts = {}
    for house in HouseTexts("bundled"):
        canonical = json.dumps(json.loads(house.text), sort_keys=True)
        digest = hashlib.sha256(canonical.encode()).hexdigest()
        if int(digest[0], 16) % 2 == 0 and house.name.split(":")[1] not in used:
            texts.setdefault(digest, canonical)
    out.mkdir(parents=True, exist_ok=True)
    path = out / "houses.jsonl"
    path.write_text("\n".join(texts[digest] for digest in sorted(texts)), encoding="utf-8")
    return list(evonav.generate_tasks(path, out / "tasks", workers=1))


def compared(task: Task, stage: int, simulator: EmbeddedSimulator) -> Iterator[tuple[bool, float, float]]:
    """Yield, for the target and each object of its category, if it is the target, and its two distances."""
    home = simulator.reset(task.house_json(stage))
    target = task.oracle(stage).target
    pictured = goal_layout(task.public(stage))
    name = hashlib.sha256(f"{task.task_id} {stage}".encode()).hexdigest()
    draws = np.random.default_rng([0, int(name[:8], 16)])
    for index, body in enumerate(simulator.objects):
        if body.category == target.category:
            seen = _largest(simulator, home, index, body.centre_m, draws)
            if seen:
                near, whole = (np.mean([getattr(one, part) for one in seen], axis=0) for part in ("near", "whole"))
                yield body.id == target.id, distance(pictured.near, near), distance(pictured.whole, whole)


def _largest(
    simulator: EmbeddedSimulator,
    home: Pose,
    index: int,
    centre_m: tuple[float, float, float],
    draws: np.random.Generator,
) -> list[Layout]:
    """Return the layouts around an object in the views that show it largest."""
    x_m, _, z_m = centre_m
    reachable_m = simulator.reachable_positions()
    is_near = np.hypot(reachable_m[:, 0] - x_m, reachable_m[:, 2] - z_m) < REACH_M
    found: list[tuple[int, Layout]] = []
    for place in draws.permutation(np.flatnonzero(is_near))[:NUM_PLACES]:
        from_x_m, _, from_z_m = reachable_m[place].tolist()
        turn_rad = draws.uniform(-MAX_TURN_RAD, MAX_TURN_RAD)
        yaw_rad = math.atan2(x_m - from_x_m, z_m - from_z_m) + turn_rad
        frame = simulator.render(replace(home, x_m=from_x_m, z_m=from_z_m, yaw_rad=yaw_rad))
        assert frame.rgb is not None, "rendered with colours"
        rows, cols = np.nonzero(frame.instances == index + 1)
        if len(rows) >= MIN_AREA_PX:
            middle_px = ((int(cols.min()) + int(cols.max()) + 1) / 2, (int(rows.min()) + int(rows.max()) + 1) / 2)
            found.append((len(rows), layouts(frame.rgb, [middle_px])[0]))
    return [layout for _, layout in sorted(found, key=lambda pair: -pair[0])[:NUM_LARGEST]]


def fitted(distances: NDArray[np.float64], is_target: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return constant and weights of a logistic regression in which both classes weigh the same."""
    rows = np.column_stack([np.ones(len(distances)), distances])
    weights = np.where(is_target, 0.5 / is_target.mean(), 0.5 / (1.0 - is_target.mean()))
    found = np.zeros(rows.shape[1])
    for _ in range(100):  # Newton's steps, with a little ridge
        likely = 1.0 / (1.0 + np.exp(-rows @ found))
        gradient = rows.T @ (weights * (likely - is_target)) + 0.01 * found
        curvature = (rows * (weights * likely * (1.0 - likely))[:, None]).T @ rows + 0.01 * np.eye(len(found))
        found -= np.linalg.solve(curvature, gradient)
    return found


def main() -> None:
    """Print the numbers, and how well they tell targets from others in houses that they were not fitted to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder for the tasks")
    tasks = design_tasks(parser.parse_args().out)
    simulator = EmbeddedSimulator(SimulatorConfig(style="default"))
    rows: list[tuple[int, int, bool, float, float]] = []
    for number, task in enumerate(tasks):
        for stage in range(1, task.num_stages + 1):
            rows += [(number, stage, *one) for one in compared(task, stage, simulator)]
    table = np.array(rows, np.float64)
    is_target, distances = table[:, 2] == 1.0, table[:, 3:]
    print(f"{len(tasks)} tasks, {is_target.sum()} targets, {(~is_target).sum()} other objects")
    print("constant, near, whole:", fitted(distances, is_target).round(2).tolist())
    scores = np.zeros(len(table))
    for part in range(NUM_PARTS):
        is_left_out = table[:, 0] % NUM_PARTS == part
        numbers = fitted(distances[~is_left_out], is_target[~is_left_out])
        scores[is_left_out] = numbers[0] + distances[is_left_out] @ numbers[1:]
    pairs = scores[is_target][:, None] > scores[~is_target][None]
    stages = [np.flatnonzero((table[:, :2] == one).all(axis=1)) for one in np.unique(table[:, :2], axis=0)]
    shared = [of for of in stages if len(of) > 1 and is_target[of].any()]
    first = np.mean([is_target[of[np.argmax(scores[of])]] for of in shared])
    chance = np.mean([1.0 / len(of) for of in shared])
    print(f"houses left out: a target scores above another object in {pairs.mean():.0%} of pairs")
    print(f"with namesakes ({len(shared)} goals): the target scores highest in {first:.0%} (by chance {chance:.0%})")
    for low, high in ((-99.0, -2.0), (-2.0, -1.0), (-1.0, 0.0), (0.0, 1.0), (1.0, 2.0), (2.0, 99.0)):
        is_in = (scores >= low) & (scores < high)
        if is_in.any():
            share = is_target[is_in].sum() / is_target.sum()
            others = (~is_target[is_in]).sum() / (~is_target).sum()
            print(f"log ratio {low:g} to {high:g}: {share:.0%} of targets, {others:.0%} of others")


if __name__ == "__main__":
    main()
