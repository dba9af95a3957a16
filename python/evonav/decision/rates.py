"""Rates as people write them: `wrong=0.1,lost=0.01`."""

from collections.abc import Sequence

from evonav.errors import InvalidArgumentError


def read_rates(text: str, known: Sequence[str]) -> dict[str, float]:
    """Read `name=number,name=number`.

    Raises:
        InvalidArgumentError: A name is unknown, occurs twice, or has no number.
    """
    rates: dict[str, float] = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        name, _, value = item.partition("=")
        if name not in known or name in rates:
            raise InvalidArgumentError(f"{item}: expected each of {', '.join(known)} once, as name=number")
        try:
            rates[name] = float(value)
        except ValueError:
            raise InvalidArgumentError(f"{item}: expected a number after {name}=") from None
    return rates
