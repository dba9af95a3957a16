"""`evonav doctor`: check the installation."""

from pathlib import Path
from typing import Annotated

import typer

EXIT_BROKEN = 1
_STYLES = {"ok": "green", "missing": "yellow", "failed": "bold red"}


def doctor(
    out: Annotated[Path, typer.Option(help="Folder for runs.")] = Path("out"),
    network: Annotated[bool, typer.Option(help="Ask the model's endpoint, if one is configured.")] = True,
    base_url: Annotated[
        str | None, typer.Option(help="Address of the endpoint. Default: OPENAI_BASE_URL, else OpenAI's.")
    ] = (None),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for programs and bug reports.")] = False,
) -> None:
    """Check what works on this machine and how to install the rest; exit code 1 if an essential part does not work."""
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
