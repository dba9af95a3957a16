"""Describe where two records of the same stage differ."""

import json
from collections.abc import Sequence
from itertools import islice
from typing import Any

from evonav.json_diff import json_differences

MAX_DIFFERENCES = 5


def record_differences(stored: str, again: str, verb: str) -> tuple[str, ...]:
    """Return the first few differences as text; none if the two records are equal to the byte.

    Args:
        again: Another record of the same stage as JSON.
        verb: The origin of `again`, such as `replayed`.
    """
    if again == stored:
        return ()
    found = tuple(
        f"{one.path}: {_short(one.left)} stored, {_short(one.right)} {verb}"
        for one in islice(json_differences(json.loads(stored), json.loads(again)), MAX_DIFFERENCES)
    )
    return found or ("the same values in other bytes",)


def _short(value: Any) -> str:  # noqa: ANN401 - JSON
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"{len(value)} items"
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:59]}…"
