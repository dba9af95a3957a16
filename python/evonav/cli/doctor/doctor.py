"""`evonav doctor`: check the installation."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options.shared import AsJson

EXIT_BROKEN = 1
_STYLES = {"ok": "green", "missing": "yellow", "failed": "bold red"}


def doctor(
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder in which runs will be written.")] = Path("out"),
    network: Annotated[bool, typer.Option(help="Contact the model server, if one is configured.")] = True,
    base_url: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="VLM: address of an OpenAI-compatible API, with its /v1. Default: OPENAI_BASE_URL, else OpenAI's.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check what works on this machine, and how to install the rest.

    The exit code is 1 if an essential part does not work.
    """
    import json
    from dataclasses import asdict

    from evonav.cli.display import status
    from evonav.cli.doctor.checks import Where, all_checks

    checks = []
    with status("Checking") as tell:
        for check in all_checks(Where(out, network, base_url)):
            checks.append(check)
            tell(check.name)
    is_broken = any(check.is_essential and check.state != "ok" for check in checks)
    if as_json:
        typer.echo(json.dumps({"is_ok": not is_broken, "checks": [asdict(check) for check in checks]}, indent=2))
    else:
        from rich.console import Console
        from rich.text import Text

        console = Console()
        width = max(len(check.name) for check in checks)
        for check in checks:
            line = Text.assemble(
                (f"{check.state:8}", _STYLES[check.state]), f"{check.name:{width}}  ", (check.finding, "")
            )
            if check.remedy:
                line.append(f" -> {check.remedy}", style="bold")
            console.print(line, soft_wrap=True)
    if is_broken:
        raise typer.Exit(EXIT_BROKEN)
