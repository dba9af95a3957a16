"""`evonav check-agent`: check that an agent keeps the contract."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import print_checks, status
from evonav.cli.options.decisions import decision_component
from evonav.cli.options.settings import with_settings
from evonav.cli.options.shared import Seed

if TYPE_CHECKING:  # the command must start fast
    from evonav.evaluation.run.decision_resources import SpendingSettings
    from evonav.evaluation.run.settings import DecisionSettings, PerceptionSettings

EXIT_BROKEN = 1
_STYLES = {"pass": "green", "warn": "yellow", "fail": "bold red", "skip": "dim"}


@with_settings("perception", "decisions", "spending")
def check_agent(
    agent: Annotated[
        str, typer.Argument(metavar="AGENT", help="Agent: ./file.py:Class, module:Class or a name (`evonav agents`).")
    ],
    perception: "PerceptionSettings",
    decisions: "DecisionSettings",
    spending: "SpendingSettings",
    seed: Seed = 0,
    agent_timeout: Annotated[
        float, typer.Option(min=0.1, metavar="X", help="Seconds to wait for an agent's answer.")
    ] = 60.0,
) -> None:
    """Check in seconds that an agent works, also where many crash.

    It runs in bundled houses: with a target that moved, one that is never found, and more. The exit code is 1 if a
    check fails.
    """
    from evonav.evaluation.contract.check import check_agent
    from evonav.evaluation.run.components import Backend

    perceived = perception.component()
    with TemporaryDirectory() as folder, status(f"Running {agent}"):  # a model's exchanges are kept between episodes
        backend = Backend(
            perception=perceived,
            decision=decision_component(decisions, spending, Path(folder), seed, 1),
        )
        report = check_agent(agent, backend=backend, seed=seed, timeout_s=agent_timeout)
    print_checks(
        report.conclusion,
        ((check.name, check.verdict, _STYLES[check.verdict], check.finding) for check in report.checks),
    )
    if not report.is_ok:
        raise typer.Exit(EXIT_BROKEN)
