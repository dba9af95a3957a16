"""Commands about agents: `evonav agents` lists them, `new-agent` writes one to begin with, `check-agent` checks one."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from evonav.cli.display import print_checks, status
from evonav.cli.options.decisions import refuse_costs_of_rules
from evonav.cli.options.settings import BaseUrl, Decision, Model, Perception, set_option, settings_from
from evonav.cli.options.shared import Seed

OWN = {
    "./file.py:Class": "a class of yours, by its file (`evonav new-agent` writes one)",
    "module:Class": "a class of yours, in an installed package",
}


def agents() -> None:
    """List the agents and oracle baselines by name."""
    from evonav.agents.registry import agent_descriptions
    from evonav.evaluation.episode.oracle_baselines import ORACLE_BASELINES

    baselines = {name: f"oracle baseline: {kind.description}" for name, kind in ORACLE_BASELINES.items()}
    for name, description in {**agent_descriptions(), **baselines, **OWN}.items():
        typer.echo(f"{name:18}{description}")


CLASS = "MyAgent"
"""The agent's class in the template."""


def new_agent(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Python file to write, such as my_agent.py.")] = Path(
        "my_agent.py"
    ),
) -> None:
    """Write a Python file with an agent to begin with.

    The agent maps the house, remembers objects and explores. The commands that check and evaluate it are printed.
    """
    from importlib.resources import files

    from evonav.errors import InvalidArgumentError
    from evonav.parallel.folders import write_atomically

    if file.suffix != ".py" or not file.stem.isidentifier():
        raise InvalidArgumentError(f"{file}: name a Python file, such as my_agent.py")
    if file.exists():
        raise InvalidArgumentError(f"{file} exists already: name another file")
    text = (files("evonav.cli.run") / "agent_template.py").read_text(encoding="utf-8")
    name = file.as_posix() if file.is_absolute() else f"./{file.as_posix()}"
    write_atomically(file, text.replace("./my_agent.py", name))
    typer.echo(f"written: {file}")
    typer.echo(f"check it:    evonav check-agent {name}:{CLASS}")
    typer.echo(f"evaluate it: evonav evaluate --agent {name}:{CLASS} --agent fu --limit 4 --out out/mine")


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

    given = {"perception.make": perception, "decision.kind": decision, "decision.model": model, "workers": 0}
    run = settings_from({**given, "decision.base_url": base_url}, set_, KEYS)
    refuse_costs_of_rules(run)
    with TemporaryDirectory() as folder, status(f"Running {agent}"):  # a model's exchanges are kept between episodes
        backend = run.run_config(seed, Path(folder)).backend
        report = check_agent(agent, backend=backend, seed=seed, timeout_s=run.agent_timeout_s or TIMEOUT_S)
    print_checks(
        report.conclusion,
        ((check.name, check.verdict, _STYLES[check.verdict], check.finding) for check in report.checks),
    )
    if not report.is_ok:
        raise typer.Exit(EXIT_BROKEN)
