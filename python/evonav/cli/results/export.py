"""`evonav export`: write a run's stages or rounds for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options.shared import RunFolder


def export(
    run: RunFolder,
    csv: Annotated[Path | None, typer.Option(help="Write a CSV file.")] = None,
    jsonl: Annotated[Path | None, typer.Option(help="Write a file of JSON lines.")] = None,
    parquet: Annotated[Path | None, typer.Option(help="Write a Parquet file (extra `data`).")] = None,
    rounds: Annotated[
        bool, typer.Option("--rounds", help="Write one row per decision round instead of one per stage.")
    ] = False,
    agent: Annotated[
        list[str] | None, typer.Option(help="Write only this agent. Repeat the option for more agents.")
    ] = None,
) -> None:
    """Write one row per stage or decision round, with every metric (docs/measures.md)."""
    from evonav.report import export as made

    files = {".csv": csv, ".jsonl": jsonl, ".parquet": parquet}
    if not any(files.values()):
        raise typer.BadParameter("name a file: --csv, --jsonl or --parquet")
    for suffix, path in files.items():
        if path is None:
            continue
        if path.suffix != suffix:
            raise typer.BadParameter(f"--{suffix[1:]} {path}: expected a file {suffix}")
        columns = made.ROUND_COLUMNS if rounds else made.stage_columns()
        rows = made.round_table(run, agent) if rounds else made.stage_table(run, agent)
        typer.echo(f"written: {made.write_table(rows, columns, path)}")
