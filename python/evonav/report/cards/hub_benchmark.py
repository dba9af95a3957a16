"""Describe the benchmark and results of agents in the Hugging Face Hub's formats.

`eval.yaml` in a dataset's repository defines its leaderboards (https://huggingface.co/docs/hub/eval-results, "Eval.yaml
specification"); `.eval_results/*.yaml` in a model's repository holds its results
(https://github.com/huggingface/hub-docs/blob/main/eval_results.yaml).
"""

from collections.abc import Mapping
from types import MappingProxyType

from evonav.report.cards.yaml_text import Yaml, yaml_text

EVAL_NAME = "eval.yaml"
FRAMEWORK = "evonav"
CONFIG = "default"
PERCEPTIONS: Mapping[str, str] = MappingProxyType({"gt": "ground_truth", "predicted": "predicted"})
"""Perceptions with a leaderboard, by the first part of their names, and their part of the leaderboard's id."""
_EVAL_HEAD = """\
# The Hub's description of a benchmark: https://huggingface.co/docs/hub/eval-results, "Eval.yaml specification".
# Each task is a leaderboard of one value; `evonav pack --dataset` writes the results for it.
# The Hub checks this file when it is pushed, and accepts only the frameworks of
# https://github.com/huggingface/huggingface.js/blob/main/packages/tasks/src/eval.ts
# Until `evonav` is in that list, leave this file out: hf upload ... --exclude eval.yaml
"""


def leaderboard_id(metric: str, perception: str) -> str | None:
    """Return the id of the leaderboard for `sr` or `spl` under a perception; `None` if there is none for it."""
    part = PERCEPTIONS.get(perception.partition(":")[0])
    return None if part is None else f"{metric}_{part}"


def eval_yaml(name: str, description: str, split: str) -> str:
    """Return `eval.yaml`: a leaderboard for each metric and perception, on the whole split."""
    tasks: list[Yaml] = [
        {"id": f"{metric}_{part}", "config": CONFIG, "split": split}
        for part in PERCEPTIONS.values()
        for metric in ("sr", "spl")
    ]
    return _EVAL_HEAD + yaml_text(
        {"name": name, "description": description, "evaluation_framework": FRAMEWORK, "tasks": tasks}
    )
