"""`evonav check-agent`: check that an agent keeps the contract."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from evonav.cli.display import print_checks, status
from evonav.cli.options.decisions import decision_component
from evonav.cli.options.settings import BaseUrl, Decision, Model, Perception, set_option, settings_from
from evonav.cli.options.shared import Seed

EXIT_BROKEN = 1
KEYS = ("perception.", "decision.", "prices", "max_cost", "agent_timeout_s")
"""Beginnings of the keys that `--set` takes."""
TIMEOUT_S = 60.0
"""Time to wait for an agent's answer by default."""
_STYLES = {"pass": "green", "warn": "yellow", "fail": "bold red", "skip": "dim"}


def check_agent(
    agent: Annotated[
        str, typer.Argument(metavar="AGENT", help="Agent: ./file.py:Class, module:Class or a name (`evonav agents`).")
    ],
    seed: Seed = 0,
    set_: Annotated[list[str] | None, set_option(*KEYS)] = None,
    perception: Perception = "gt",
    decision: Decision = "text",
    model: Model = None,
    base_url: BaseUrl = None,
) -> None:
    """Check in seconds that an agent works, also where many crash.

    It runs in bundled houses: with a target that moved, one that is never found, and more. The exit code is 1 if a
    check fails.
    """
    from evonav.evaluation.contract.check import check_agent
    from evonav.evaluation.run.components import Backend

    given = {"perception.make": perception, "decision.kind": decision, "decision.model": model}
    run = settings_from({**given, "decision.base_url": base_url}, set_, KEYS)
    perceived = run.perception.component()
    with TemporaryDirectory() as folder, status(f"Running {agent}"):  # a model's exchanges are kept between episodes
        backend = Backend(
            perception=perceived,
            decision=decision_component(run.decision, run, Path(folder), seed, 1),
        )
        report = check_agent(agent, backend=backend, seed=seed, timeout_s=run.agent_timeout_s or TIMEOUT_S)
    print_checks(
        report.conclusion,
        ((check.name, check.verdict, _STYLES[check.verdict], check.finding) for check in report.checks),
    )
    if not report.is_ok:
        raise typer.Exit(EXIT_BROKEN)
