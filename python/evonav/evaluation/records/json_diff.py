"""Where two records of the same stage differ, in words."""

import json
from collections.abc import Iterator, Sequence
from typing import Any

MAX_DIFFERENCES = 5


def record_differences(stored: str, again: str, verb: str) -> tuple[str, ...]:
    """The first few differences; none if the texts are equal to the byte.

    Args:
        stored: A record as JSON.
        again: The same stage's, from elsewhere.
        verb: How `again` came about: `replayed`.
    """
    if again == stored:
        return ()
    was, is_now = json.loads(stored), json.loads(again)
    # An older evonav recorded less: what is not there cannot differ.
    shared = {key: value for key, value in is_now.items() if key in was}
    found = list(_departures(was, shared, "", verb))
    return tuple(found[:MAX_DIFFERENCES]) or (() if len(shared) < len(is_now) else ("the same values in other bytes",))


def _departures(was: Any, is_now: Any, where: str, verb: str) -> Iterator[str]:  # noqa: ANN401 - JSON
    if isinstance(was, dict) and isinstance(is_now, dict):
        for key in dict.fromkeys([*was, *is_now]):
            yield from _departures(was.get(key), is_now.get(key), f"{where}.{key}" if where else key, verb)
    elif isinstance(was, list) and isinstance(is_now, list) and len(was) == len(is_now):
        for index, (a, b) in enumerate(zip(was, is_now, strict=True)):
            yield from _departures(a, b, f"{where}[{index}]", verb)
    elif was != is_now:
        yield f"{where}: {_short(was)} stored, {_short(is_now)} {verb}"


def _short(value: Any) -> str:  # noqa: ANN401 - JSON
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"{len(value)} items"
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:59]}…"
