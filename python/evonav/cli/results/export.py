"""`evonav export`: a run's stages and rounds for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options.shared import RunFolder


def export(
    run: RunFolder,
    csv: Annotated[Path | None, typer.Option(help="CSV file to write.")] = None,
    jsonl: Annotated[Path | None, typer.Option(help="File of JSON lines to write.")] = None,
    parquet: Annotated[Path | None, typer.Option(help="Parquet file to write (extra `data`).")] = None,
    rounds: Annotated[bool, typer.Option("--rounds", help="One row a decision round, not a stage.")] = False,
    agent: Annotated[list[str] | None, typer.Option(help="Only this agent; repeat it for more.")] = None,
) -> None:
    """Writes one row a stage, or a decision round, with every measure (docs/measures.md)."""
    from evonav.report import export as made

    asked = {".csv": csv, ".jsonl": jsonl, ".parquet": parquet}
    if not any(asked.values()):
        raise typer.BadParameter("name a file: --csv, --jsonl or --parquet")
    for suffix, path in asked.items():
        if path is None:
            continue
        if path.suffix != suffix:
            raise typer.BadParameter(f"--{suffix[1:]} {path}: expected a file {suffix}")
        columns = made.ROUND_COLUMNS if rounds else made.stage_columns()
        rows = made.round_table(run, agent) if rounds else made.stage_table(run, agent)
        typer.echo(f"written: {made.write_table(rows, columns, path)}")
