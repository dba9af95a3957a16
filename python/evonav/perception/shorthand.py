"""Read and write the short names of perceptions on the command line and in sweep files.

gt                               the simulator's masks and labels
noisy[:PRESET][,KEY=VALUE...]    ground truth with simulated errors: `noisy:poor,miss_rate=0.3`
predicted[:STACK][,KEY=VALUE...] detections of models: `predicted`, `predicted:unigoal`
MODULE:FUNCTION[,KEY=VALUE...]   a perception of your own
"""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from evonav.component import Component
from evonav.errors import InvalidArgumentError
from evonav.records import did_you_mean

if TYPE_CHECKING:
    from evonav.perception import Perception

GROUND_TRUTH = "evonav.perception.ground_truth:GroundTruthPerception"
NOISY = "evonav.perception.simulated:noisy_perception"
PREDICTED = "evonav.perception.predicted:predicted_perception"
STACKS = ("auto", "3d-mem", "unigoal", "transformers", "mini", "coco")
"""Stacks of models; `auto`: UniGoal's for UniGoal, 3D-Mem's for all others."""
_HOST_OPTIONS = ("models", "device")
"""Options that depend on this machine: the folder of the models' weights, and the device."""
NAMES = ("gt", "noisy", "predicted")
GRAMMAR = "gt, noisy[:PRESET][,KEY=VALUE...], predicted[:STACK][,KEY=VALUE...] or module:function"


def parse_perception(word: str, options: Mapping[str, Any] | None = None) -> "Component[Perception]":
    """Return the component of the perception with a short name.

    Args:
        word: The short name, see the module. A value is JSON, or else a string.
        options: Further keywords, such as those of a sweep file's table; they override those of the short name.

    Raises:
        InvalidArgumentError: There is no such perception or stack, or a keyword is malformed.
    """
    head, *parts = word.strip().split(",")
    kind, colon, variant = (text.strip() for text in head.partition(":"))
    given = {**_keywords(word, parts), **(options or {})}
    if kind == "gt":
        if colon or given:
            raise InvalidArgumentError(f"perception {word!r}: gt has no variants and no keys")
        return Component(GROUND_TRUTH)
    if colon and not variant:
        raise InvalidArgumentError(f"perception {word!r}: nothing after the colon; expected {GRAMMAR}")
    if kind == "noisy":
        return Component(NOISY, {"preset": variant, **given} if variant else given)
    if kind == "predicted":
        if variant and variant not in STACKS:
            raise InvalidArgumentError(f"perception {word!r}: no stack {variant!r}; {did_you_mean(variant, STACKS)}")
        host = {key: given.pop(key) for key in _HOST_OPTIONS if key in given}
        return Component(PREDICTED, {"stack": variant or "auto", **given}, host)
    if not colon:
        raise InvalidArgumentError(f"perception {word!r}: expected {GRAMMAR}; {did_you_mean(kind, NAMES)}")
    return Component(f"{kind}:{variant}", given)


def short_name_of(make: str, options: Mapping[str, Any]) -> str:
    """Return the short name of the perception in a run's records: the inverse of `parse_perception`."""
    left = dict(options)
    head = {GROUND_TRUTH: "gt", NOISY: "noisy", PREDICTED: "predicted"}.get(make, make)
    variant = left.pop("preset", None) if make == NOISY else left.pop("stack", None) if make == PREDICTED else None
    head = head if variant in (None, "auto") else f"{head}:{variant}"
    values = ((key, value if isinstance(value, str) else json.dumps(value)) for key, value in left.items())
    return ",".join([head, *(f"{key}={value}" for key, value in values)])


def _keywords(word: str, parts: list[str]) -> dict[str, Any]:
    keywords: dict[str, Any] = {}
    for part in parts:
        key, equals, text = (side.strip() for side in part.partition("="))
        if not equals or not key.isidentifier() or not text or key in keywords:
            raise InvalidArgumentError(f"perception {word!r}: {part.strip()!r}: expected each KEY=VALUE once")
        try:
            keywords[key] = json.loads(text)
        except ValueError:
            keywords[key] = text
    return keywords
