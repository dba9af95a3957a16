"""Rules that decide what an object map forgets, each from a published system."""

from collections.abc import Iterable, Mapping
from dataclasses import fields
from difflib import get_close_matches
from types import MappingProxyType

from evonav.errors import InvalidArgumentError
from evonav.memory.forgetting.rule import ForgettingRule
from evonav.memory.forgetting.rules import (
    Bayes,
    FailedLook,
    LastWins,
    Never,
    RayVotes,
    Reset,
    SeeThrough,
    ShareDeleted,
    StatusWindow,
)

__all__ = [
    "RULES",
    "Bayes",
    "FailedLook",
    "ForgettingRule",
    "LastWins",
    "Never",
    "RayVotes",
    "Reset",
    "SeeThrough",
    "ShareDeleted",
    "StatusWindow",
    "check_name",
    "make",
]

_CLASSES: tuple[type[ForgettingRule], ...] = (
    Never,
    Reset,
    LastWins,
    FailedLook,
    SeeThrough,
    RayVotes,
    StatusWindow,
    ShareDeleted,
    Bayes,
)
RULES: Mapping[str, type[ForgettingRule]] = MappingProxyType({rule.name: rule for rule in _CLASSES})
"""All rules by name; the first line of a class's docstring says what it forgets."""


def make(name: str, **options: object) -> ForgettingRule:
    """Make a rule for one map.

    Args:
        name: A key of `RULES`.
        options: Fields of the rule's class.

    Raises:
        InvalidArgumentError: There is no such rule, or it has no such option; the message names near ones.

    Examples:
        >>> make("ray-votes", window=7).window
        7
    """
    check_name(name)
    known = [field.name for field in fields(RULES[name]) if field.init]  # type: ignore[arg-type]  # all are dataclasses
    for option in options:
        if option not in known:
            raise InvalidArgumentError(f"forgetting rule `{name}` has no option {option!r}{_hint(option, known)}")
    return RULES[name](**options)


def check_name(name: str) -> None:
    """Check the name of a rule.

    Raises:
        InvalidArgumentError: There is no such rule; the message names near ones.
    """
    if name not in RULES:
        raise InvalidArgumentError(f"no forgetting rule {name!r}{_hint(name, RULES)}")


def _hint(name: str, known: Iterable[str]) -> str:
    known = list(known)
    near = get_close_matches(name, known, 1)
    if near:
        return f": did you mean `{near[0]}`?"
    return f": there are {', '.join(known)}" if known else ": it has none"
