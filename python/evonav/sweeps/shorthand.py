"""Expand the short forms of sweep files (`tasks = ["bundled:2"]`)."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from evonav.errors import InvalidArgumentError
from evonav.tasks.subsets import SubsetError, parse_subset

MAX_NAME_CHARACTERS = 64


def _listed_text(value: Any) -> Any:  # noqa: ANN401 - as read
    """Split a string at its commas; other values are returned as they are."""
    if isinstance(value, str):
        return [word.strip() for word in value.split(",") if word.strip()]
    return value


def _agents(value: Any, place: str) -> Any:  # noqa: ANN401 - as read
    agents = _listed_text(value)
    if isinstance(agents, list):
        twice = next((agent for i, agent in enumerate(agents) if agent in agents[:i]), None)
        if twice is not None:
            raise InvalidArgumentError(f"{place}: {twice!r} is named twice")
    return agents


def _seeds(value: Any, place: str) -> Any:  # noqa: ANN401 - as read
    if isinstance(value, int) and not isinstance(value, bool):
        return [value]
    if isinstance(value, str):
        try:
            value = [int(word) for word in _listed_text(value)]
        except ValueError:
            raise InvalidArgumentError(f"{place} = {value!r}: expected whole numbers, such as [0, 1, 2]") from None
    if isinstance(value, list) and len({str(seed) for seed in value}) < len(value):
        raise InvalidArgumentError(f"{place} = {value}: a seed is named twice")
    return value


def _tasks(word: str, place: str) -> tuple[str, dict[str, Any]]:
    folder, colon, part = word.rpartition(":")
    table: dict[str, Any] = {"folder": word}
    name = Path(word).name
    if colon and part.isdigit():
        table, name = {"folder": folder, "limit": int(part)}, f"{Path(folder).name}-{part}"
    elif colon and folder:
        try:
            parse_subset(part)
        except SubsetError:
            raise InvalidArgumentError(
                f"{place}: {word!r}: expected FOLDER, FOLDER:LIMIT or FOLDER:SUBSET, such as tasks:20 or tasks:test-90"
            ) from None
        table, name = {"folder": folder, "subset": part}, f"{Path(folder).name}-{part}"
    return name, table


def _decision(word: str, place: str) -> tuple[str, dict[str, Any]]:
    from evonav.decision.noisy import NoiseRates, read_rates

    kind, colon, rest = word.partition(":")
    if kind == "vlm" and colon:
        return rest, {"kind": "vlm", "model": rest}
    if kind in ("text", "looks") and colon:
        try:
            return word, {"kind": kind, "noise": read_rates(rest, NoiseRates.model_fields)}
        except InvalidArgumentError as error:
            raise InvalidArgumentError(f"{place}: {word!r}: {error}") from None
    return word, {"kind": word}


def _perception(word: str, place: str) -> tuple[str, dict[str, Any]]:
    return word, {"make": word}


def _simulator(word: str, place: str) -> tuple[str, dict[str, Any]]:
    return word, {"kind": word}


def _axis(read: Any) -> Any:  # noqa: ANN401 - a function of (word, place)
    """Expand a list of short forms, each under a name made from it; tables stay as they are."""

    def spell(value: Any, place: str) -> Any:  # noqa: ANN401 - as read
        has_commas = read in (_decision, _perception)  # within a word
        entries = _listed_text(value) if not has_commas else [value] if isinstance(value, str) else value
        if isinstance(entries, dict):
            return {
                name: read(entry, f"{place}.{name}")[1] if isinstance(entry, str) else entry
                for name, entry in entries.items()
            }
        if not isinstance(entries, list):
            return entries
        table: dict[str, Any] = {}
        for word in entries:
            if not isinstance(word, str):
                raise InvalidArgumentError(f"{place}: {word!r}: expected a word; give tables names of their own")
            name, entry = read(word, place)
            name = re.sub(r"__+", "_", re.sub(r"[^A-Za-z0-9._-]+", "-", name)).strip("-._")[:MAX_NAME_CHARACTERS]
            if name in table:
                raise InvalidArgumentError(
                    f"{place}: {word!r} and another are both called {name!r}: give them names, {name} = ..., "
                    "in a table instead of a list"
                )
            table[name] = entry
        return table

    return spell


SHORT_FORMS: Mapping[str, Callable[[Any, str], Any]] = {
    "agents": _agents,
    "seeds": _seeds,
    "tasks": _axis(_tasks),
    "decisions": _axis(_decision),
    "perceptions": _axis(_perception),
    "simulators": _axis(_simulator),
}


def listed(pattern: Any) -> Any:  # noqa: ANN401 - as read
    """Return a pattern in which single values are lists of one."""
    if not isinstance(pattern, dict):
        return pattern
    return {key: value if isinstance(value, list) else [value] for key, value in pattern.items()}
