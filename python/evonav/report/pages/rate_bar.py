"""Draw a rate with its interval as a small bar in a table's cell."""

from markupsafe import Markup

from evonav.statistics import Interval


def rate_bar(value: float | None, interval: Interval | None) -> Markup:
    """Draw a rate of 0 to 1 with its interval, on a scale of 0 to 100%; nothing without a rate."""
    if value is None:
        return Markup("")
    low, high = interval or (value, value)
    return Markup(
        '<svg class="bar" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true">'
        '<rect class="track" width="100" height="10"/><rect class="value" width="{:.2f}" height="10"/>'
        '<path class="whisker" d="M{:.2f} 5H{:.2f}M{:.2f} 2V8M{:.2f} 2V8"/></svg>'
    ).format(100 * value, 100 * low, 100 * high, 100 * low, 100 * high)
