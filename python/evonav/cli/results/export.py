"""`evonav export`: write a run's stages or rounds for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options.shared import CsvFile, RunAgents, RunFolder, listed


def export(
    run: RunFolder,
    agent: RunAgents = None,
    csv: CsvFile = None,
    jsonl: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a file of JSON lines.")] = None,
    parquet: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a Parquet file. It needs the extra `data`.")
    ] = None,
    rounds: Annotated[
        bool, typer.Option("--rounds", help="Write one row per decision round instead of one per stage.")
    ] = False,
) -> None:
    """Write every metric of a run as CSV, JSON lines or Parquet.

    There is one row per stage, or with --rounds one per decision round.
    """
    from evonav.report import export as made

    names = listed(agent) or None
    files = {".csv": csv, ".jsonl": jsonl, ".parquet": parquet}
    if not any(files.values()):
        raise typer.BadParameter("name a file: --csv, --jsonl or --parquet")
    for suffix, path in files.items():
        if path is None:
            continue
        if path.suffix != suffix:
            raise typer.BadParameter(f"--{suffix[1:]} {path}: expected a file {suffix}")
        columns = made.ROUND_COLUMNS if rounds else made.stage_columns()
        rows = made.round_table(run, names) if rounds else made.stage_table(run, names)
        typer.echo(f"written: {made.write_table(rows, columns, path)}")
