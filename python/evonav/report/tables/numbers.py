"""Write numbers with their intervals, the same way in tables, plots and sentences."""

from evonav.statistics import Estimate, Interval, PairedEffect

NONE = "–"
"""Text of a cell without a value."""


def number(value: float | None, *, scale: float = 1, digits: int = 1, is_signed: bool = False, unit: str = "") -> str:
    """Return a number as text.

    Args:
        value: `None` where there is nothing to show.
    """
    return NONE if value is None else f"{scale * value:{_form(digits, is_signed)}}{unit}"


def with_interval(
    value: float | None,
    interval: Interval | None,
    *,
    scale: float = 1,
    digits: int = 1,
    is_signed: bool = False,
    unit: str = "",
) -> str:
    """Return a number with its interval: `61.1 [54.0, 68.2]`.

    Args:
        interval: `None` where resampling gives none, for a single house or houses that all agree: `61.1 [–]`.
    """
    if value is None:
        return NONE
    form = _form(digits, is_signed)
    ends = NONE if interval is None else ", ".join(f"{scale * end:{form}}" for end in interval)
    return f"{number(value, scale=scale, digits=digits, is_signed=is_signed, unit=unit)} [{ends}]"


def _form(digits: int, is_signed: bool) -> str:
    return f"{'+' if is_signed else ''}.{digits}f"


def percent(value: float | None) -> str:
    """Return a rate of 0 to 1 in percent."""
    return number(value, scale=100)


def rate(value: float | None, interval: Interval | None) -> str:
    """Return a rate of 0 to 1 in percent, with its interval."""
    return with_interval(value, interval, scale=100)


def points(effect: PairedEffect, scale: float = 100) -> str:
    """Return a difference in percentage points, with its interval: `+6.3 [-1.2, +13.9]`."""
    return with_interval(effect.difference, effect.ci95, scale=scale, is_signed=True)


def estimate_text(
    estimate: Estimate | None, *, scale: float = 100, digits: int = 1, is_signed: bool = False, has_n: bool = False
) -> str:
    """Return an estimate with its interval, by default in percent, and with its n in parentheses if `has_n`."""
    if estimate is None or estimate.value is None:
        return NONE
    text = with_interval(estimate.value, estimate.ci95, scale=scale, digits=digits, is_signed=is_signed)
    return f"{text} ({estimate.n})" if has_n else text


def scaled(interval: Interval | None, scale: float = 100) -> Interval | None:
    """Return an interval in other units, by default in percent."""
    return None if interval is None else (scale * interval[0], scale * interval[1])
