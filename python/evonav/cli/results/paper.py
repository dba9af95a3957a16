"""`evonav paper`: show a run beside the paper's tables."""

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import show_tables, write_files
from evonav.cli.options.shared import RunFolder, files_option

if TYPE_CHECKING:
    from evonav.report.paper.tables import Perception
    from evonav.report.run import RecordedRun


class Half(str, Enum):
    """A half of the paper's tables."""

    GT = "gt"
    PREDICTION = "prediction"


def paper(
    run: RunFolder,
    perception: Annotated[
        Half, typer.Option(help="Half of the paper's tables to compare with: ground-truth or predicted perception.")
    ] = Half.GT,
    out: Annotated[list[Path] | None, files_option("md", "tex")] = None,
    prediction: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN", help="Run with predicted perception, which fills the lower half of the LaTeX tables."
        ),
    ] = None,
    reweight: Annotated[
        str | None,
        typer.Option(
            metavar="DATASET",
            help="Also weight tasks so that their houses have the room counts of a dataset: procthor-10k.",
        ),
    ] = None,
) -> None:
    """Show a run beside the paper's Tables 1 and 2.

    Also shows the order of the agents in both, and how large a difference the run could detect. A LaTeX file has the
    paper's layout.
    """
    from evonav.errors import StoreError
    from evonav.report.paper.latex import paper_latex
    from evonav.report.paper.reweighted import reweighted_table
    from evonav.report.paper.tables import paper_tables, power_table
    from evonav.report.run import load_run
    from evonav.report.tables.table import markdown_tables

    loaded = load_run(run)
    if not any(summary.n for summary in loaded.summaries):
        raise StoreError(f"{run}: no stage is scored yet; `evonav evaluate` with the same options resumes the run")
    tables = [*paper_tables(loaded, perception.value), power_table(loaded.pairs, perception.value)]
    if reweight is not None:
        tables.append(reweighted_table([loaded], reweight, perception.value))
    show_tables(tables)
    runs: dict[Perception, RecordedRun] = {perception.value: loaded}
    if prediction is not None:
        runs["prediction"] = load_run(prediction)
    write_files(
        out,
        {
            ".md": lambda _: markdown_tables(table for table in tables if table.rows),
            ".tex": lambda _: paper_latex(runs),
        },
    )
