"""Write a number of things in words."""

import re


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: `1 house`, `2 houses`, `1,000 entries`; the noun is in the singular."""
    if number != 1:
        noun = re.sub(r"([^aeiou])y$", r"\1ie", noun) + "s"
    return f"{number:,} {noun}"
