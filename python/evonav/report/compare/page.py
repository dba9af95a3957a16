"""Write a comparison as one self-contained page: sentences, tables, plots, and the stages that differ."""

import os
from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from evonav.report.compare import wording
from evonav.report.compare.compare import Comparison, Flip
from evonav.report.pages.template import page_text, text_of
from evonav.report.plots.render import plot_elements
from evonav.report.plots.specs import Gap, GapPlot
from evonav.report.plots.style import plot_css
from evonav.report.tables.verdicts import p_words
from evonav.statistics import PairedEffect


def comparison_plot(comparisons: Sequence[Comparison], field: str = "success") -> GapPlot:
    """Plot differences of SR, or of `spl`: of one pair by parts, or of several pairs on all stages."""
    name = wording.metric_name(field)
    if len(comparisons) == 1:
        (one,) = comparisons
        gaps = tuple(_gap(part.effects[field], part.label) for part in one.parts if field in part.effects)
        return GapPlot(f"{name} of {one.b} minus {one.a}, points", gaps, f"{one.a} is better", f"{one.b} is better")
    pairs = [one for one in comparisons if field in one.all.effects]
    gaps = tuple(_gap(one.all.effects[field], f"{one.b} minus {one.a}", "p (Holm)") for one in pairs)
    return GapPlot(f"{name} differences, points", gaps, "the second is better", "the first is better")


def _plots(comparisons: Sequence[Comparison]) -> list[Markup]:
    """Return the plots of SR and SPL, side by side."""
    found = [comparison_plot(comparisons, field) for field in ("success", "spl")]
    return plot_elements([plot for plot in found if plot.gaps], are_even=True)


def comparison_page(comparisons: Sequence[Comparison], out_dir: Path | None = None) -> str:
    """Render the comparison as one HTML page.

    Args:
        comparisons: Comparisons to show, at least one.
        out_dir: Folder of the page, to which links to replays are relative.
    """
    sections = [
        {
            "title": f"{one.b} minus {one.a}",
            "plots": _plots([one]),
            "tables": wording.part_tables(one),
            "winners": [
                (winner, [_shown(flip, out_dir) for flip in one.flips if flip.winner == winner])
                for winner in (one.b, one.a)
            ],
        }
        for one in comparisons
    ]
    return page_text(
        "compare.html.j2",
        text_of("report.css") + plot_css(),
        has_drawings=True,
        title=f"{comparisons[0].b} and {comparisons[0].a}" if len(comparisons) == 1 else "agents",
        statements=wording.findings(comparisons),
        warnings=wording.warnings(comparisons),
        pairs=wording.pair_table(comparisons),
        overview=_plots(comparisons) if len(comparisons) > 1 else [],
        sections=sections,
    )


def _gap(effect: PairedEffect, name: str, p_name: str = "p") -> Gap:
    return Gap.of(name, f"n = {effect.n}, {p_name} = {p_words(effect.adjusted_p)}".replace("= <", "< "), effect)


def _shown(flip: Flip, out_dir: Path | None) -> dict[str, object]:
    links = [
        (name, None if page is None else _relative(page, out_dir))
        for name, page in zip((flip.winner, flip.loser), flip.pages, strict=True)
    ]
    return {"flip": flip, "where": wording.where(flip), "links": links}


def _relative(page: str, out_dir: Path | None) -> str:
    path, _, fragment = page.partition("#")
    return f"{Path(os.path.relpath(path, out_dir or Path())).as_posix()}#{fragment}"
