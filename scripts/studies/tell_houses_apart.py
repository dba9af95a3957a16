"""Train a classifier to tell two sets of houses apart: a two-sample test that also sees combinations of features.

    pip install scikit-learn
    python scripts/studies/tell_houses_apart.py bundled endless:7 --limit 150

Lopez-Paz & Oquab, "Revisiting Classifier Two-Sample Tests", ICLR 2017: if no classifier tells houses that it has not
seen from those of the other set better than by chance, the sets have the same distribution as far as its features
show.
"""

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from random import Random

import numpy as np
from sklearn.ensemble import GradientBoostingClassifier
from sklearn.inspection import permutation_importance

from evonav.cli.options.shared import read_houses
from evonav.errors import InvalidArgumentError
from evonav.generation.house_statistics import CATEGORY, Features, HouseSample, by_stratum, feature_table, sample_of
from evonav.statistics import Interval, wilson

NUM_FEATURES = 60
"""Largest number of features: all that are no counts of a category, then the categories that most houses have."""
NUM_FOLDS = 5
MIN_HOUSES = 2 * NUM_FOLDS
"""Least number of houses of each set."""
NUM_SHUFFLES = 5
"""Times that each feature is shuffled to find what it is worth."""
NUM_SHOWN = 10
"""Features that are printed."""


@dataclass(frozen=True, slots=True)
class ClassifierTest:
    """The result of a classifier that was trained to tell two sets of houses apart."""

    num_houses: int
    """Number of houses of each set; every stratum has as many of one as of the other."""
    accuracy: float
    """Share of houses in folds that it was not trained on which it assigns to their set; 0.5 is chance."""
    interval: Interval
    """95% interval of the accuracy (Wilson)."""
    uses: Mapping[str, float]
    """Accuracy that is lost when a feature is shuffled among these houses, largest first."""


def tell_apart(a: Sequence[HouseSample], b: Sequence[HouseSample], *, seed: int = 0) -> ClassifierTest:
    """Train gradient boosting to tell two sets of houses apart, in five folds.

    Of each stratum that both sets have, as many houses are drawn of one as of the other, and folds have as many of
    one as of the other. So the mix of room specs says nothing.

    Args:
        a: Houses of one set.
        b: Houses of the other one.
        seed: Seed of the draws, the folds and the shuffles.

    Raises:
        InvalidArgumentError: There are too few houses of the same strata.
    """
    sets = _balanced(a, b, Random(seed))
    num_houses = len(sets[0])
    if num_houses < MIN_HOUSES:
        raise InvalidArgumentError(
            f"the sets have {num_houses} houses of the same room specs; a classifier needs at least {MIN_HOUSES}"
        )
    names = _most_usual([*sets[0], *sets[1]])
    table = feature_table([*sets[0], *sets[1]], names)
    labels = np.repeat([0, 1], num_houses)
    folds = np.tile(np.arange(num_houses) % NUM_FOLDS, 2)
    num_right, losses = 0, np.zeros(len(names))
    for fold in range(NUM_FOLDS):
        is_test = folds == fold
        model = GradientBoostingClassifier(random_state=seed)
        model.fit(table[~is_test], labels[~is_test])
        test = table[is_test], labels[is_test]
        num_right += round(float(model.score(*test)) * len(test[1]))
        found = permutation_importance(model, *test, n_repeats=NUM_SHUFFLES, random_state=seed)
        losses += found.importances_mean * len(test[1])
    num_all = 2 * num_houses
    order = np.argsort(-losses, kind="stable")
    uses = {names[index]: float(losses[index]) / num_all for index in order}
    return ClassifierTest(num_houses, num_right / num_all, wilson(num_right, num_all) or (0.0, 1.0), uses)


def _balanced(
    a: Sequence[HouseSample], b: Sequence[HouseSample], random: Random
) -> tuple[list[Features], list[Features]]:
    """Draw as many houses of each stratum from one set as from the other."""
    one, other = by_stratum(a), by_stratum(b)
    drawn: tuple[list[Features], list[Features]] = ([], [])
    for name in (name for name in one if name in other):
        count = min(len(one[name]), len(other[name]))
        drawn[0].extend(random.sample(one[name], count))
        drawn[1].extend(random.sample(other[name], count))
    return drawn


def _most_usual(houses: Sequence[Features]) -> list[str]:
    """Return the features that are compared, those of no category first."""
    shares = Counter(name for features in houses for name in features)
    others = sorted(name for name in shares if not name.startswith(CATEGORY))
    categories = sorted((name for name in shares if name.startswith(CATEGORY)), key=lambda name: (-shares[name], name))
    return [*others, *categories][:NUM_FEATURES]


def main() -> None:
    """Print how often a classifier is right, and which features it uses most."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("houses", nargs=2, help="two sets of houses, as of `evonav houses`")
    parser.add_argument("--limit", type=int, help="houses of each set")
    arguments = parser.parse_args()
    sets = [read_houses(name, None, "auto") for name in arguments.houses]
    found = tell_apart(*([sample_of(text) for text in islice(texts, arguments.limit)] for texts in sets))
    low, high = found.interval
    print(f"right in {found.accuracy:.1%} [{low:.1%}, {high:.1%}] of {2 * found.num_houses} houses; chance is 50%")
    for name, loss in list(found.uses.items())[:NUM_SHOWN]:
        print(f"{name}: {loss:.1%} lost without it")


if __name__ == "__main__":
    main()
