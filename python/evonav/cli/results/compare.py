"""`evonav compare`: agents against each other on the same stages."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from evonav.report.compare.compare import Comparison


def compare(
    sides: Annotated[
        list[str], typer.Argument(help="Runs or sweeps (all agents), RUN:AGENT, or a run and then names of its agents.")
    ],
    measure: Annotated[
        list[str] | None, typer.Option(help="Another numeric field of a stage's row; repeat it for more.")
    ] = None,
    baseline: Annotated[str | None, typer.Option(help="Compare all with this one, not every pair.")] = None,
    allow_differences: Annotated[
        bool, typer.Option("--allow-differences", help="Runs of other tasks or protocol: what they have in common.")
    ] = False,
    md: Annotated[Path | None, typer.Option(help="Markdown file to write.")] = None,
    latex: Annotated[Path | None, typer.Option(help="LaTeX file to write (booktabs, graphicx).")] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file to write, unrounded.")] = None,
    json: Annotated[Path | None, typer.Option(help="JSON file to write, with the stages that flipped.")] = None,
    html: Annotated[Path | None, typer.Option(help="HTML page to write, with links to replays.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Plot to write: .svg, .png or .pdf file (extra `viz`).")] = None,
) -> None:
    """Compares agents stage by stage: differences with 95% interval and p, by stratum and mode, and what flipped."""
    from rich.console import Console

    from evonav.report.compare import wording as words
    from evonav.report.compare.compare import compare as compare_sides
    from evonav.report.compare.selection import read_compared_agents

    found = compare_sides(
        read_compared_agents(sides), measures=measure or [], baseline=baseline, allow_differences=allow_differences
    )
    console = Console()
    for table in words.terminal_tables(found):
        console.print(table.rich())
    for line in words.statements(found) if len(found) == 1 else words.warnings(found):
        console.print(line, markup=False, highlight=False)
    console.print(words.METHOD, style="dim", highlight=False)
    for path in _write(found, md=md, latex=latex, csv=csv, json=json, html=html, plot=plot):
        typer.echo(f"written: {path}")


def _write(
    found: "Sequence[Comparison]",
    *,
    md: Path | None,
    latex: Path | None,
    csv: Path | None,
    json: Path | None,
    html: Path | None,
    plot: Path | None,
) -> list[Path]:
    import json as json_text
    from collections.abc import Callable

    from evonav.parallel.folders import write_atomically
    from evonav.report.compare import wording as words
    from evonav.report.compare.compare import comparison_json
    from evonav.report.compare.page import comparison_page, comparison_plot
    from evonav.report.plots.render import write_plots

    written = []
    texts: list[tuple[Path | None, Callable[[], str]]] = [
        (md, lambda: words.comparison_markdown(found)),
        (latex, lambda: words.comparison_latex(found)),
        (csv, lambda: words.comparison_csv(found)),
        (json, lambda: json_text.dumps(comparison_json(found), indent=1) + "\n"),
        (html, lambda: comparison_page(found, None if html is None else html.parent)),
    ]
    for path, text in texts:
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, text())
            written.append(path)
    if plot is not None:
        written.append(write_plots([comparison_plot(found)], plot))
    return written
