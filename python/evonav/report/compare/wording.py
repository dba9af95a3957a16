"""Write a comparison as tables and sentences."""

from collections.abc import Iterable, Sequence

from evonav.counted import counted
from evonav.report.compare.compare import METRICS, STRATA, Comparison, Flip
from evonav.report.export import csv_text
from evonav.report.tables.table import (
    INTERVALS,
    SPL_NOTE,
    STRICT_NOTE,
    Table,
    latex_tables,
    markdown_tables,
    mode_words,
)
from evonav.report.tables.verdicts import VERDICTS, effect_cells, p_heading, paired_table, sentence, verdict_words

RATES = frozenset(
    {
        *METRICS,
        "ring_spl",
        "is_geodesic_success",
        "has_stopped",
        "precision",
        "recall",
        "precision_at_start",
        "recall_at_start",
    }
)
"""Measures of 0 to 1, shown in percent; others are shown in their own unit."""
MAX_FLIPS = 5
"""Stages that flipped, each way, in a terminal."""

METHOD = f"Differences are of the same stages. {INTERVALS} {VERDICTS}"
EXPLORING = "Use parts to explore, not as claims: their p is not adjusted for the number of parts."


def metric_name(field: str) -> str:
    """Return a metric's name as tables show it."""
    return METRICS.get(field, field.replace("_", " "))


def pair_table(comparisons: Sequence[Comparison]) -> Table:
    """Build the table with one row per pair, on all stages that both scored."""
    return paired_table(
        [
            (one.a, one.b, effects["success"], effects.get("spl"), one.all.num_only_a, one.all.num_only_b)
            for one in comparisons
            for effects in (one.all.effects,)
        ]
    )


def measure_table(comparisons: Sequence[Comparison], field: str) -> Table:
    """Build a table of one metric on all stages, for a terminal: one row per pair."""
    rows = tuple(
        (f"{one.b} minus {one.a}", *effect_cells(effect, scale_of(field)), says(one, field))
        for one in comparisons
        if (effect := one.all.effects.get(field)) is not None
    )
    columns = ("", "difference [95% CI]", p_heading(len(comparisons)), "verdict")
    sizes = sorted({one.all.n for one in comparisons})
    return Table(f"{metric_name(field)}, n = {'-'.join(map(str, sizes))}", columns, rows)


def comparison_table(one: Comparison) -> Table:
    """Build a table of one pair with one row per metric, on all stages that both finished."""
    effects = one.all.effects
    rows = tuple(
        (
            metric_name(field),
            *(f"{scale_of(field) * mean:.1f}" for mean in (effect.mean_b, effect.mean_a)),
            *effect_cells(effect, scale_of(field)),
            says(one, field),
        )
        for field, effect in effects.items()
    )
    columns = ("%", one.b, one.a, "difference [95% CI]", "p", "verdict")
    only = f"Only {one.b} succeeded in {counted(one.all.num_only_b, 'stage')}, only {one.a} in {one.all.num_only_a}."
    return Table(f"{one.b} minus {one.a}, n = {one.all.n}", columns, rows, (only, METHOD, *_notes_on(effects)))


def terminal_tables(comparisons: Sequence[Comparison]) -> list[Table]:
    """Return the tables that fit eighty columns; the files contain the rest."""
    if len(comparisons) > 1:
        fields = list(dict.fromkeys(field for one in comparisons for field in one.all.effects))
        return [table for field in fields if (table := measure_table(comparisons, field)).rows]
    (one,) = comparisons
    rows = tuple(
        (part.label, str(part.n), *(f"{100 * mean:.1f}" for mean in (sr.mean_b, sr.mean_a)), *effect_cells(sr))
        for part in one.parts
        for sr in (part.effects["success"],)
    )
    columns = ("SR %", "n", one.b, one.a, "difference [95% CI]", "p")
    parts = Table(f"SR of {one.b} minus {one.a} by kind of stage", columns, rows, (EXPLORING,))
    return [table for table in (comparison_table(one), parts, _short_flips(one)) if table.rows]


def _short_flips(one: Comparison) -> Table:
    shown = []
    for winner in (one.b, one.a):
        shown += [flip for flip in one.flips if flip.winner == winner][:MAX_FLIPS]
    rows = tuple((f"{flip.task_id} {flip.stage}", flip.category, _stratum(flip), flip.winner) for flip in shown)
    columns = ("Task and stage", "", "", "succeeded")
    num_more = len(one.flips) - len(rows)
    notes = [f"{counted(num_more, 'more stage')} with different outcomes."] if num_more else []
    notes.append("Files of --out list all, with the command that replays each.")
    return Table(f"Stages with different outcomes: {one.b} and {one.a}", columns, rows, tuple(notes))


def part_table(one: Comparison, fields: Sequence[str] = (), *, has_counts: bool = True) -> Table:
    """Build a table of one pair, on all stages, by stratum and by mode.

    Args:
        fields: Metrics to show; default: all.
        has_counts: Whether to show both rates, and in how many stages only one of the two succeeded.
    """
    fields = fields or list(one.all.effects)
    rows = []
    for part in one.parts:
        sr = part.effects["success"]
        only, rates = f"{part.num_only_b} / {part.num_only_a}", (f"{100 * x:.1f}" for x in (sr.mean_b, sr.mean_a))
        effects = [cell for field in fields for cell in effect_cells(part.effects.get(field), scale_of(field))]
        rows.append((part.label, str(part.n), *((only, *rates) if has_counts else ()), *effects))
    counts = ("only first / second", f"SR % {one.b}", f"SR % {one.a}") if has_counts else ()
    names = (name for field in fields for name in (f"{metric_name(field)} difference [95% CI]", "p"))
    notes = (METHOD, EXPLORING) if has_counts else ()
    columns = ("Stages", "n", *counts, *names)
    return Table(f"{one.b} minus {one.a}", columns, tuple(rows), (*notes, *_notes_on(fields)))


def part_tables(one: Comparison) -> list[Table]:
    """Build the same as tables that a page is wide enough for: SR and SPL with the counts, then other metrics."""
    first = [field for field in one.all.effects if field in ("success", "spl")]
    others = [field for field in one.all.effects if field not in first]
    more = [part_table(one, others[i : i + 3], has_counts=False) for i in range(0, len(others), 3)]
    return [part_table(one, first), *more]


def _notes_on(fields: Iterable[str]) -> tuple[str, ...]:
    """Return notes on metrics whose name does not say enough."""
    notes = {"spl": SPL_NOTE, "is_strict_success": STRICT_NOTE}
    return tuple(note for field, note in notes.items() if field in fields)


def flip_table(one: Comparison) -> Table:
    """List stages where exactly one of the two succeeded, those of `b` first."""
    rows = [
        (f"{flip.task_id} {flip.stage}", flip.category, where(flip), winner, f"{flip.loser}: {flip.cause}")
        for winner in (one.b, one.a)
        for flip in one.flips
        if flip.winner == winner
    ]
    columns = ("Task and stage", "category", "stage is", "succeeded", "failed")
    return Table(f"Stages with different outcomes: {one.b} and {one.a}", columns, tuple(rows))


def statements(comparisons: Sequence[Comparison]) -> list[str]:
    """Return the sentences that the comparison supports, and the warnings."""
    return findings(comparisons) + warnings(comparisons)


def findings(comparisons: Sequence[Comparison]) -> list[str]:
    """Describe SR and SPL of every pair, in words."""
    lines = []
    for one in comparisons:
        for field in ("success", "spl"):
            effect = one.all.effects.get(field)
            if effect is not None:
                lines.append(sentence(one.a, one.b, effect, metric_name(field), num_pairs=len(comparisons)))
    return lines


def warnings(comparisons: Sequence[Comparison]) -> list[str]:
    """Describe stages that were left out, and settings in which the runs differ."""
    lines = []
    for one in comparisons:
        if one.dropped:
            reasons = ", ".join(f"{count} {reason}" for reason, count in one.dropped.items())
            num = sum(one.dropped.values())
            num_dropped = f"{counted(num, 'stage')} {'is' if num == 1 else 'are'}"
            lines.append(f"{one.b} and {one.a}: {num_dropped} not compared: {reasons}.")
        if one.settings:
            differing = "; ".join(f"{key}: {b} / {a}" for key, (a, b) in one.settings.items())
            lines.append(f"{one.b} and {one.a} were run with different settings: {differing}.")
    return lines


def says(one: Comparison, field: str = "success") -> str:
    """Return the verdict about a metric on all stages, after adjustment, in a few words."""
    return verdict_words(one.a, one.b, one.all.effects[field], is_rate=field in RATES)


def comparison_csv(comparisons: Sequence[Comparison]) -> str:
    """Return every number, unrounded: one CSV row per pair, part and metric."""
    rows: list[dict[str, object]] = []
    for one in comparisons:
        for part in one.parts:
            for name, effect in part.effects.items():
                low, high = effect.ci95 or (None, None)
                relative_low, relative_high = effect.relative_ci95 or (None, None)
                rows.append(
                    {
                        "a": one.a,
                        "b": one.b,
                        "part": part.key,
                        "metric": name,
                        "n": effect.n,
                        "num_houses": effect.num_clusters,
                        "mean_a": effect.mean_a,
                        "mean_b": effect.mean_b,
                        "difference": effect.difference,
                        "low": low,
                        "high": high,
                        "relative": effect.relative,
                        "relative_low": relative_low,
                        "relative_high": relative_high,
                        "p": effect.p,
                        "p_holm": effect.adjusted_p if part is one.all else None,
                        "standard_error": effect.standard_error,
                        "detectable": effect.detectable,
                        "num_only_a": part.num_only_a,
                        "num_only_b": part.num_only_b,
                        "mcnemar_p": part.mcnemar_p,
                        "verdict": effect.verdict,
                    }
                )
    return csv_text(list(rows[0]), [list(row.values()) for row in rows])


def all_tables(comparisons: Sequence[Comparison]) -> list[Table]:
    """Return the tables of a report: the pairs, then each pair's parts and flips."""
    tables = [pair_table(comparisons)]
    for one in comparisons:
        tables += [part_table(one), flip_table(one)]
    return [table for table in tables if table.rows]


def comparison_markdown(comparisons: Sequence[Comparison]) -> str:
    """Return sentences, tables, and the command that replays each stage that flipped."""
    parts = ["# Comparison\n", "".join(f"- {line}\n" for line in statements(comparisons))]
    parts.append(markdown_tables(all_tables(comparisons)))
    for one in comparisons:
        if one.flips:
            commands = "\n".join(flip.command for flip in one.flips)
            parts.append(f"## Replays: {one.b} and {one.a}\n\n```bash\n{commands}\n```\n")
    return "\n".join(parts)


def comparison_latex(comparisons: Sequence[Comparison]) -> str:
    """Return the pairs and every pair's parts as tables for `booktabs`; sentences as comments."""
    lines = "".join(f"% {line}\n" for line in statements(comparisons))
    return lines + latex_tables([pair_table(comparisons), *(part_table(one) for one in comparisons)])


def where(flip: Flip) -> str:
    """Return the stratum and the mode in words."""
    stratum = _stratum(flip)
    return stratum if flip.mode == "first" else f"{stratum}, {mode_words(flip.mode)}"


def _stratum(flip: Flip) -> str:
    return STRATA.get(flip.stratum, flip.stratum)


def scale_of(field: str) -> int:
    """Return 100 for a rate, which is shown in percent, and 1 for another metric."""
    return 100 if field in RATES else 1
