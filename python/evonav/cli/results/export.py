"""`evonav export`: write a run's stages or rounds for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options.shared import RunAgents, RunFolder, files_option, listed


def export(
    run: RunFolder,
    agent: RunAgents = None,
    out: Annotated[list[Path] | None, files_option("csv", "jsonl", "parquet")] = None,
    rounds: Annotated[
        bool, typer.Option("--rounds", help="Write one row per decision round instead of one per stage.")
    ] = False,
) -> None:
    """Write every metric of a run as CSV, JSON lines or Parquet.

    There is one row per stage, or with --rounds one per decision round.
    """
    from evonav.report import export as made

    names = listed(agent) or None
    if not out:
        raise typer.BadParameter("name a file: --out stages.csv, .jsonl or .parquet")
    for path in out:
        columns = made.ROUND_COLUMNS if rounds else made.stage_columns()
        rows = made.round_table(run, names) if rounds else made.stage_table(run, names)
        typer.echo(f"written: {made.write_table(rows, columns, path)}")
