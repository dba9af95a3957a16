"""`evonav check-agent`: does an agent keep the contract?"""

from typing import Annotated

import typer

from evonav.cli.options import Seed

EXIT_BROKEN = 1
_STYLES = {"pass": "green", "warn": "yellow", "fail": "bold red", "skip": "dim"}


def check_agent(
    agent: Annotated[str, typer.Argument(help="A name, `module:Class` or `./file.py:Class`.")],
    seed: Seed = 0,
    timeout: Annotated[float, typer.Option(min=0.1, help="Seconds for an answer of the agent.")] = 60.0,
) -> None:
    """Runs an agent through the contract, on a bundled house that changes; exit code 1 if it breaks it."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from evonav.cli.display import status
    from evonav.evaluation.agent_check import check_agent

    with status(f"Running {agent}"):
        report = check_agent(agent, seed=seed, timeout_s=timeout)
    table = Table(title=f"{agent}: {'keeps the contract' if report.is_ok else 'breaks the contract'}")
    for column in ("check", "", "what was found"):
        table.add_column(column, no_wrap=column != "what was found")
    for check in report.checks:
        table.add_row(check.name, Text(check.verdict, style=_STYLES[check.verdict]), Text(check.said))
    Console().print(table)
    if not report.is_ok:
        raise typer.Exit(EXIT_BROKEN)
