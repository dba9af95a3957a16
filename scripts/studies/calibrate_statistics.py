"""Do intervals cover, and are tests of no difference wrong one time in twenty? (docs/studies/statistics.md).

    python scripts/studies/calibrate_statistics.py --runs 1000

Runs are made up: houses differ in difficulty, an agent has luck of its own in a house, stages of a house share both,
and three to five stages come from each. Half of the scenarios have no true difference between the two agents; what is
true in the others is measured on a very large draw.
"""

import argparse
import sys
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.statistics import mcnemar, paired_effect, wilson

NUM_RESAMPLES = 2000


@dataclass(frozen=True)
class World:
    """How houses and agents vary, in logits; `gap` is what the second agent is better by."""

    name: str
    house_sd: float
    luck_sd: float
    gap: float
    is_skewed: bool = False
    """The second agent's gain is large in a fifth of houses and a small loss in the others."""


WORLDS = (
    World("independent stages, no difference", 0.0, 0.0, 0.0),
    World("houses differ, no difference", 1.0, 0.5, 0.0),
    World("agents' luck by house, no difference", 1.0, 1.5, 0.0),
    World("few houses decide, no difference", 1.0, 0.5, 0.0, is_skewed=True),
    World("houses differ, 6 points", 1.0, 0.5, 0.33),
)


@dataclass(frozen=True)
class Outcomes:
    """Stages of one simulated run: success and SPL of both agents."""

    houses: NDArray[np.int64]
    success: NDArray[np.float64]
    spl: NDArray[np.float64]


def draw(world: World, num_houses: int, generator: np.random.Generator, balance: float = 0.0) -> Outcomes:
    """A run of two agents."""
    sizes = generator.integers(3, 6, num_houses)
    houses = np.repeat(np.arange(num_houses), sizes)
    base = 0.5 + generator.normal(0, world.house_sd, num_houses)
    luck = generator.normal(0, world.luck_sd, (2, num_houses))
    if world.is_skewed:
        luck[1] += np.where(generator.random(num_houses) < 0.2, 2.5, -balance)
    shared = generator.normal(0, 0.8, len(houses))  # a hard stage is hard for both
    logits = (base + luck)[:, houses] + shared + np.array([[0.0], [world.gap]])
    success = (generator.random(logits.shape) < 1 / (1 + np.exp(-logits))).astype(np.float64)
    return Outcomes(houses, success, success * generator.beta(5, 2, success.shape))


def balanced(world: World) -> float:
    """The loss elsewhere that makes a skewed world's agents equal."""
    if not world.is_skewed:
        return 0.0
    low, high = 0.0, 2.0
    for _ in range(18):
        middle = (low + high) / 2
        run = draw(world, 150_000, np.random.default_rng(7), middle)
        low, high = (middle, high) if run.success[1].mean() > run.success[0].mean() else (low, middle)
    return (low + high) / 2


def calibrate(world: World, num_houses: int, num_runs: int) -> str:
    """A row of the table."""
    balance = balanced(world)
    large = draw(world, 400_000, np.random.default_rng(11), balance)
    truth = {name: values[1].mean() - values[0].mean() for name, values in (("sr", large.success), ("spl", large.spl))}
    is_null = world.gap == 0.0
    if is_null:
        truth["sr"] = 0.0
    rate = large.success[0].mean()
    hits: dict[str, list[bool]] = {}
    for i in range(num_runs):
        run = draw(world, num_houses, np.random.default_rng([23, num_houses, i]), balance)
        names = [f"{house:04}" for house in run.houses]
        sr = paired_effect(run.success[0], run.success[1], names, num_resamples=NUM_RESAMPLES, seed=i)
        spl = paired_effect(run.spl[0], run.spl[1], names, num_resamples=NUM_RESAMPLES, seed=i)
        alone = paired_effect(np.zeros(len(names)), run.success[0], names, num_resamples=NUM_RESAMPLES, seed=i)
        naive = wilson(int(run.success[0].sum()), len(names))
        only_a = int((run.success[0] > run.success[1]).sum())
        only_b = int((run.success[1] > run.success[0]).sum())
        for key, value in {
            "rate": _in(alone.ci95, rate),
            "wilson": _in(naive, rate),
            "sr": _in(sr.ci95, truth["sr"]),
            "spl": _in(spl.ci95, truth["spl"]),
            "p_sr": sr.p <= 0.05,
            "p_spl": spl.p <= 0.05,
            "mcnemar": mcnemar(only_a, only_b) <= 0.05,
        }.items():
            hits.setdefault(key, []).append(value)
    cells = [f"{100 * np.mean(hits[key]):.1f}" for key in ("rate", "wilson", "sr", "spl", "p_sr", "p_spl", "mcnemar")]
    return f"| {world.name} | {num_houses} | {' | '.join(cells)} |"


def _in(interval: tuple[float, float] | None, value: float) -> bool:
    return interval is not None and interval[0] <= value <= interval[1]


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=1000, help="simulated runs a row")
    parser.add_argument("--houses", type=int, nargs="+", default=[10, 20, 90])
    asked = parser.parse_args()
    began = time.process_time()
    sys.stdout.write(
        "| world | houses | rate: covered % | rate, Wilson % | SR difference % | SPL difference % "
        "| SR p <= 0.05, % | SPL p <= 0.05, % | plain McNemar, % |\n"
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n"
    )
    for world in WORLDS:
        for num_houses in asked.houses:
            sys.stdout.write(calibrate(world, num_houses, asked.runs) + "\n")
            sys.stdout.flush()
    sys.stdout.write(f"\n{asked.runs} runs a row, {time.process_time() - began:.0f} s\n")


if __name__ == "__main__":
    main()
