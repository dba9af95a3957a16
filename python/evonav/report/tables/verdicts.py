"""Say who is ahead, in the same words in every table, page and sentence."""

from collections.abc import Sequence

from evonav.counted import counted
from evonav.report.tables.numbers import NONE, points, with_interval
from evonav.report.tables.table import INTERVALS, Table
from evonav.statistics import LEVEL, MIN_CLUSTERS, PairedEffect

VERDICTS = (
    "p: two-sided, the agents' names exchanged in whole houses. Holm: p adjusted for the number of pairs. Ahead: p is "
    f"at most {LEVEL:g} and the interval does not include 0."
)
Pair = tuple[str, str, PairedEffect, PairedEffect | None, int, int]
"""Agents `a` and `b`, effects of `b` less `a` on SR and SPL, and the numbers of stages that only `a`, only `b` did."""


def paired_table(pairs: Sequence[Pair]) -> Table:
    """Build the table of differences between agents on the stages that both scored, with a verdict in words."""
    p_name = p_heading(len(pairs))
    columns = (
        "Agents",
        "SR difference [95% CI]",
        p_name,
        "SR verdict",
        "SPL difference [95% CI]",
        p_name,
        "SPL verdict",
        "n",
        "only first / second",
    )
    rows = tuple(
        (
            f"{b} minus {a}",
            *effect_cells(sr),
            verdict_words(a, b, sr),
            *effect_cells(spl),
            NONE if spl is None else verdict_words(a, b, spl),
            str(sr.n),
            f"{num_only_b} / {num_only_a}",
        )
        for a, b, sr, spl, num_only_a, num_only_b in pairs
    )
    notes = (
        f"Percentage points, on the same stages. {INTERVALS} {VERDICTS}",
        "Only first / second: stages where only the first-named, or the second-named, agent succeeded.",
    )
    return Table("Paired differences", columns, rows, notes)


def verdict_words(a: str, b: str, effect: PairedEffect, *, is_rate: bool = True) -> str:
    """Return the verdict on `b` less `a` in a few words; with a metric that is no rate, nobody is ahead."""
    if effect.verdict in ("a", "b") and not is_rate:
        return "they differ"
    return {
        "equal": "equal on every stage",
        "few": f"too few houses ({effect.num_clusters})",
        "tie": "undecided",
        "a": f"{a} is ahead",
        "b": f"{b} is ahead",
    }[effect.verdict]


def sentence(
    a: str, b: str, effect: PairedEffect, metric: str = "SR", *, is_rate: bool = True, num_pairs: int = 1
) -> str:
    """Describe the difference of `b` less `a` in a metric, with the verdict first.

    Args:
        num_pairs: Number of pairs that are compared; with several, the sentence names both agents.
    """
    scale, unit = (100, "%") if is_rate else (1, "")
    p = f"p = {p_words(effect.adjusted_p)}".replace("= <", "< ")
    p += f" by Holm over {num_pairs} pairs" if num_pairs > 1 else ""
    basis = f"{counted(effect.n, 'stage')} in {counted(effect.num_clusters, 'house')}"
    means = f"{scale * effect.mean_b:.1f} vs {scale * effect.mean_a:.1f}{unit}"
    measured = f"{points(effect, scale)}{' points' if is_rate else ''} ({means}, {p}; {basis})"
    if effect.verdict == "equal":
        return f"{b} and {a} have the same {metric} in each of {counted(effect.n, 'stage')}."
    if effect.verdict == "few":
        return f"{metric}: too few houses to tell {b} from {a}, fewer than {MIN_CLUSTERS} or all alike: {measured}."
    if effect.verdict == "tie":
        least = effect.detectable
        found = "" if least is None else f"{100 * least:.1f} points" if is_rate else f"{least:.2g}"
        reach = f" {counted(effect.num_clusters, 'house')} reliably detect only differences of about {found} or more."
        return f"{metric}: undecided between {b} and {a}: {measured}.{reach if found else ''}"
    if not is_rate:
        return f"{metric}: {b} and {a} differ: {measured}."
    ahead, behind, sign = (b, a, 1) if effect.verdict == "b" else (a, b, -1)
    low, high = sorted(sign * end for end in effect.ci95 or (0.0, 0.0))
    number, _, interval = with_interval(sign * effect.difference, (low, high), scale=scale).partition(" ")
    means = " vs ".join(f"{scale * mean:.1f}" for mean in (effect.mean_b, effect.mean_a)[::sign])
    of = f" of {behind}" if num_pairs > 1 else ""
    return f"{ahead} is ahead{of} by {number} points of {metric} {interval} ({means}%, {p}; {basis})."


def effect_cells(effect: PairedEffect | None, scale: float = 100) -> tuple[str, str]:
    """Return a difference with its interval, by default in percentage points, and its adjusted p."""
    return (NONE, NONE) if effect is None else (points(effect, scale), p_words(effect.adjusted_p))


def p_heading(num_pairs: int) -> str:
    """Return the heading of a column of p, which is adjusted where there are several pairs."""
    return "p (Holm)" if num_pairs > 1 else "p"


def p_words(p: float) -> str:
    """Return p as text: `0.012`; `<0.0001` where it is less."""
    return "<0.0001" if p < 0.0001 else f"{p:.4f}" if p < 0.01 else f"{p:.3f}" if p < 0.1 else f"{p:.2f}"
