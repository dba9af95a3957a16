"""How often the right category is among the first five: by the instruction's words, and by meaning (`evonav[text]`).

    python scripts/measure_text_ranking.py TASKS [MORE]

The categories ranked are all of those in the stage's house. Prints shares with 95% intervals from a bootstrap over
houses, for the unified instruction, and for one whose nouns are replaced by everyday words that evonav's list of
synonyms does not hold ("recliner" for an arm chair), where the category has such a word.
"""

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

from evonav.decision.text.language import parse_goal
from evonav.decision.text.matcher import Matcher
from evonav.decision.text.ranking import similarity_of_label
from evonav.evaluation.run.components import load_case
from evonav.statistics import ClusterBootstrap
from evonav.tasks.language import noun_of
from evonav.world.embedded import EmbeddedSimulator

EVERYDAY = {
    "ArmChair": "recliner",
    "Bed": "place to sleep",
    "Bottle": "flask",
    "Bread": "loaf",
    "CellPhone": "smartphone",
    "Chair": "seat",
    "CoffeeMachine": "espresso maker",
    "Cup": "tumbler",
    "Desk": "writing table",
    "DiningTable": "table for meals",
    "DishSponge": "scrubber",
    "Dresser": "chest of drawers",
    "Faucet": "tap",
    "FloorLamp": "standing light",
    "Fridge": "icebox",
    "GarbageCan": "wastebasket",
    "HousePlant": "potted fern",
    "Laptop": "notebook computer",
    "Mug": "coffee cup",
    "Newspaper": "daily paper",
    "Painting": "framed artwork",
    "Pan": "skillet",
    "Pillow": "cushion",
    "Pot": "saucepan",
    "RemoteControl": "TV clicker",
    "ShelvingUnit": "storage rack",
    "Sofa": "loveseat",
    "Statue": "sculpture",
    "TeddyBear": "plush toy",
    "Television": "TV screen",
    "Toilet": "lavatory",
    "Vase": "flower jar",
    "Watch": "timepiece",
}


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tasks", nargs="+", type=Path)
    args = parser.parse_args()
    matcher = Matcher()
    hits: dict[tuple[str, str], dict[str, list[bool]]] = defaultdict(lambda: defaultdict(list))
    simulator = EmbeddedSimulator(allow_unknown_assets=True)
    for task in sorted(path.parent for folder in args.tasks for path in folder.glob("**/task.json")):
        case = load_case(task)
        for stage in case.stages:
            simulator.reset(stage.house_json)
            labels = sorted({body.category for body in simulator.objects if body.kind == "object"})
            goal = stage.public
            said = {"unified": goal.unified_instruction}
            noun = noun_of(goal.category)
            if goal.category in EVERYDAY and noun in goal.unified_instruction:
                said["everyday words"] = goal.unified_instruction.replace(noun, EVERYDAY[goal.category])
            for kind, text in said.items():
                parsed = parse_goal(text, "")
                words = {label: matcher.label_score(parsed, label) for label in labels}
                meaning = {label: similarity_of_label(text, label) for label in labels}
                for name, scores in (("words", words), ("text", meaning)):
                    first = sorted(labels, key=lambda label: (-scores[label], label))[:5]
                    hits[kind, name][case.house].append(goal.category in first)
    for (kind, name), houses in hits.items():
        names = [house for house, found in houses.items() for _ in found]
        values = np.array([[hit] for found in houses.values() for hit in found], np.float64)
        (share,) = ClusterBootstrap(names).column_means(values)
        ends = "" if share.ci95 is None else " [{:.3f}, {:.3f}]".format(*share.ci95)
        print(f"{kind}, by {name}: {share.value:.3f}{ends}, n = {share.n} in {share.num_clusters} houses")


if __name__ == "__main__":
    main()
