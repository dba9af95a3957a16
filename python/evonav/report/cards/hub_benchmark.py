"""Describe the benchmark and results of agents in the Hugging Face Hub's formats.

`eval.yaml` in a dataset's repository defines its leaderboards (https://huggingface.co/docs/hub/eval-results, "Eval.yaml
specification"); `.eval_results/*.yaml` in a model's repository holds its results
(https://github.com/huggingface/hub-docs/blob/main/eval_results.yaml).
"""

import re
from collections.abc import Mapping
from types import MappingProxyType

from evonav.errors import InvalidArgumentError
from evonav.report.cards.yaml_text import Yaml, yaml_text

EVAL_NAME = "eval.yaml"
RESULTS_DIR = ".eval_results"
"""Folder of results in a model's repository."""
FRAMEWORK = "evonav"
CONFIG = "default"
PERCEPTIONS: Mapping[str, str] = MappingProxyType({"gt": "ground_truth", "predicted": "predicted"})
"""Perceptions with a leaderboard, by the first part of their names, and their part of the leaderboard's id."""
REPO = re.compile(r"[\w.-]+/[\w.-]+", re.ASCII)
"""Form of a repository's name on the Hub."""
_EVAL_HEAD = """\
# The Hub's description of a benchmark: https://huggingface.co/docs/hub/eval-results, "Eval.yaml specification".
# Each task is a leaderboard of one value; `evonav pack --dataset` writes the results for it.
# The Hub checks this file when it is pushed, and accepts only the frameworks of
# https://github.com/huggingface/huggingface.js/blob/main/packages/tasks/src/eval.ts
# Until `evonav` is in that list, leave this file out: hf upload ... --exclude eval.yaml
"""


METRICS = ("sr", "spl")
"""Metrics with a leaderboard: success rate and SPL."""


def leaderboard_id(metric: str, perception: str) -> str | None:
    """Return the id of the leaderboard for `sr` or `spl` under a perception; `None` if there is none for it."""
    part = PERCEPTIONS.get(perception.partition(":")[0])
    return None if part is None else f"{metric}_{part}"


def eval_yaml(name: str, description: str, split: str) -> str:
    """Return `eval.yaml`: a leaderboard for each metric and perception, on the whole split."""
    tasks: list[Yaml] = [
        {"id": f"{metric}_{part}", "config": CONFIG, "split": split}
        for part in PERCEPTIONS.values()
        for metric in METRICS
    ]
    return _EVAL_HEAD + yaml_text(
        {"name": name, "description": description, "evaluation_framework": FRAMEWORK, "tasks": tasks}
    )


def eval_results_yaml(
    dataset: str, perception: str, percentages: Mapping[str, float], details: Mapping[str, Yaml]
) -> str:
    """Return a file of `.eval_results`: an entry for each metric of one agent.

    Args:
        dataset: Repository of the tasks on the Hub, with `@REVISION` if one is meant.
        perception: Perception, as `--perception` names it.
        percentages: Value of each of `METRICS` in percent, as the paper's tables give it.
        details: Date, source and notes, as the format names them.

    Raises:
        InvalidArgumentError: No leaderboard is for the perception, or the repository's name is malformed.
    """
    name, _, revision = dataset.partition("@")
    if not REPO.fullmatch(name):
        raise InvalidArgumentError(
            f"--dataset {dataset!r}: expected a repository of the Hub, such as my-lab/evonav-test"
        )
    entries: list[Yaml] = []
    for metric in METRICS:
        task_id = leaderboard_id(metric, perception)
        if task_id is None:
            known = " and ".join(PERCEPTIONS)
            raise InvalidArgumentError(f"--dataset: the Hub has leaderboards for {known} perception, not {perception}")
        of = {"id": name, "task_id": task_id, **({"revision": revision} if revision else {})}
        entries.append({"dataset": of, "value": round(percentages[metric], 2), **details})
    return yaml_text(entries)
