"""The `evonav` command. Exit codes: 0 done, 1 an error, 2 wrong usage, 3 incomplete, 130 interrupted."""

import os
import sys
from typing import Annotated

import typer

from evonav.cli.doctor.doctor import doctor
from evonav.cli.examples import add_examples
from evonav.cli.mock_vlm import mock_vlm
from evonav.cli.options.settings import SettingsGroup
from evonav.cli.results.breakdown import breakdown
from evonav.cli.results.compare import compare
from evonav.cli.results.export import export
from evonav.cli.results.measures import measures
from evonav.cli.results.paper import paper
from evonav.cli.results.perception import perception
from evonav.cli.results.report import report, strip
from evonav.cli.results.submission import pack, verify
from evonav.cli.results.video import rerun, video
from evonav.cli.results.view import view
from evonav.cli.run.check_agent import check_agent
from evonav.cli.run.controlled import controlled_app
from evonav.cli.run.demo import demo
from evonav.cli.run.evaluate import evaluate
from evonav.cli.run.failures import failures
from evonav.cli.run.sweep import sweep
from evonav.cli.tasks.app import tasks_app
from evonav.cli.tasks.generate import generate
from evonav.cli.tasks.houses import houses_app

EXIT_ERROR = 1
DEBUG_VARIABLE = "EVONAV_DEBUG"

app = typer.Typer(
    name="evonav",
    cls=SettingsGroup,
    help="EvoNav-Bench: lifelong navigation in homes that change.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
COMMANDS = (
    evaluate,
    sweep,
    demo,
    failures,
    report,
    compare,
    breakdown,
    export,
    measures,
    paper,
    perception,
    strip,
    view,
    video,
    rerun,
    generate,
    check_agent,
    pack,
    verify,
    mock_vlm,
    doctor,
)
for command in COMMANDS:
    app.command()(command)
app.add_typer(houses_app, name="houses")
app.add_typer(tasks_app, name="tasks")
app.add_typer(controlled_app, name="controlled")


@app.callback()
def options(
    debug: Annotated[
        bool, typer.Option("--debug", help=f"Show the traceback of an error; as {DEBUG_VARIABLE}=1 does.")
    ] = False,
) -> None:
    """EvoNav-Bench: lifelong navigation in homes that change."""
    if debug:
        os.environ[DEBUG_VARIABLE] = "1"


@app.command(name="agents")
def list_agents() -> None:
    """List agents and baselines by name."""
    from evonav.agents.registry import agent_descriptions
    from evonav.evaluation.episode.oracle_baselines import ORACLE_BASELINES

    baselines = {name: f"oracle baseline: {kind.description}" for name, kind in ORACLE_BASELINES.items()}
    for name, description in {**agent_descriptions(), **baselines}.items():
        typer.echo(f"{name:18}{description}")
    typer.echo(f"{'./file.py:Class':18}any class of yours, by its file")
    typer.echo(f"{'module:Class':18}any class of yours with the methods of evonav.agents.agent.Agent")


@app.command()
def version() -> None:
    """Print the version."""
    from evonav import __version__

    typer.echo(__version__)


add_examples(app)


def main() -> None:
    """Run the command; an error of evonav or of a file is printed as one line, without a traceback."""
    from evonav.errors import EvonavError

    try:
        app()
    except (EvonavError, OSError) as error:
        if os.environ.get(DEBUG_VARIABLE, "0") not in ("", "0"):
            raise
        typer.echo(f"error: {error}", err=True)
        sys.exit(EXIT_ERROR)
