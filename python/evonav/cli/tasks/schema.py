"""`evonav tasks schema`: print the JSON Schemas of task files."""

from pathlib import Path
from typing import Annotated

import typer


def schema(
    name: Annotated[
        str | None, typer.Argument(help="File to describe: dataset, oracle_stage, public_stage or task. Default: all.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write NAME.schema.json files to. Default: print them.")
    ] = None,
) -> None:
    """Print or write the JSON Schemas (draft 2020-12) of task files."""
    from evonav.tasks.schema import MODELS, schema_text, write_schemas

    if out is not None:
        for path in write_schemas(out):
            typer.echo(str(path))
        return
    for each in MODELS if name is None else (name,):
        typer.echo(schema_text(each), nl=False)
