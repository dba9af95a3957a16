"""Compute the four distribution functions that the tests and intervals need.

All of them have closed forms, because degrees of freedom and counts are whole numbers here. SciPy has them, too, but
it would be half of the size of an installation.
"""

import math

TAIL_95 = 0.05
"""Share outside of a two-sided 95% interval."""


def normal_cdf(x: float) -> float:
    """Return the chance that a standard normal variable is at most `x`."""
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def student_quantile(num_degrees: int) -> float:
    """Return the quantile of Student's t with `num_degrees` that is exceeded one time in forty.

    Source: the finite series of Abramowitz & Stegun, "Handbook of Mathematical Functions", 1964, 26.7.3 and 26.7.4,
    solved by Newton's method.

    Args:
        num_degrees: Degrees of freedom, at least 1.
    """
    log_factor = math.lgamma((num_degrees + 1) / 2) - math.lgamma(num_degrees / 2)
    factor = 2.0 / math.sqrt(math.pi) * math.exp(log_factor)
    angle = math.atan(1.9 / math.sqrt(num_degrees))
    for _ in range(100):
        slope = factor * math.cos(angle) ** (num_degrees - 1)
        step = (1.0 - TAIL_95 - _student_inside(angle, num_degrees)) / slope
        angle += step
        # The inside grows ever more slowly, so every step falls short of the solution until rounding ends it.
        if step <= 1e-16 * angle:
            break
    return math.sqrt(num_degrees) * math.tan(angle)


def _student_inside(angle: float, num_degrees: int) -> float:
    """Return the chance that Student's t is within `tan(angle) * sqrt(num_degrees)` of 0."""
    is_odd = num_degrees % 2
    cos2, term = math.cos(angle) ** 2, math.cos(angle) if is_odd else 1.0
    terms = []
    for k in range(1 + is_odd, num_degrees, 2):
        terms.append(term)
        term *= cos2 * k / (k + 1)
    series = math.sin(angle) * math.fsum(terms)
    return 2.0 / math.pi * (angle + series) if is_odd else series


def chi_square_tail(num_degrees: int, statistic: float) -> float:
    """Return the chance that a chi-square variable is above `statistic`.

    Source: the finite series of Abramowitz & Stegun, 26.4.4 and 26.4.5.

    Args:
        num_degrees: Degrees of freedom, at least 1.
        statistic: Test statistic, not negative.
    """
    half = statistic / 2.0
    if half == 0.0:
        return 1.0
    is_odd = num_degrees % 2
    powers = [k + 0.5 * is_odd for k in range((num_degrees - is_odd) // 2)]
    terms = [math.exp(power * math.log(half) - half - math.lgamma(power + 1.0)) for power in powers]
    return min(1.0, math.fsum(terms + [math.erfc(math.sqrt(half))] * is_odd))


def fair_binomial_cdf(num_heads: int, num_tosses: int) -> float:
    """Return the chance of at most `num_heads` heads in tosses of a fair coin, correctly rounded."""
    ways, total = 1, 0
    for k in range(num_heads + 1):
        total += ways
        ways = ways * (num_tosses - k) // (k + 1)
    return total / (1 << num_tosses)
