"""The `evonav` command. Exit codes: 0 done, 1 an error, 2 wrong usage, 3 incomplete, 130 interrupted."""

import gc
import os
import sys
from typing import Annotated

import typer

from evonav.cli.bench.app import bench_app
from evonav.cli.doctor import doctor
from evonav.cli.examples import add_examples
from evonav.cli.group import HELP_NAMES, Group, add_commands
from evonav.cli.results.leaderboard import leaderboard
from evonav.cli.results.paper import paper
from evonav.cli.results.perception import perception
from evonav.cli.results.report import report
from evonav.cli.results.submission import pack, verify
from evonav.cli.results.tables import breakdown, compare, export
from evonav.cli.results.video import video
from evonav.cli.results.view import view
from evonav.cli.run.agents import agents, check_agent, new_agent
from evonav.cli.run.controlled import controlled_app
from evonav.cli.run.demo import demo
from evonav.cli.run.evaluate import evaluate
from evonav.cli.run.failures import failures
from evonav.cli.run.sweep import sweep
from evonav.cli.tasks.app import tasks_app
from evonav.cli.tasks.houses import houses_app

EXIT_ERROR = 1
DEBUG_VARIABLE = "EVONAV_DEBUG"
PANELS = {
    "Start": (demo, doctor, new_agent),
    "Run": (evaluate, sweep, check_agent, agents),
    "Results": (report, view, compare, breakdown, failures, export),
    "Data": (houses_app, tasks_app),
    "Study": (paper, controlled_app, perception, bench_app),
    "Submit": (pack, verify, leaderboard),
    "Tools": (video,),
}
"""Commands and groups of commands under their headings in the help."""
GROUP_NAMES = {houses_app: "houses", tasks_app: "tasks", controlled_app: "controlled", bench_app: "bench"}


class _Panels(Group):
    """The command `evonav`, whose help has the panels in order."""

    order = tuple(
        GROUP_NAMES[command] if isinstance(command, typer.Typer) else command.__name__.replace("_", "-")
        for panel in PANELS.values()
        for command in panel
    )


app = typer.Typer(
    name="evonav",
    cls=_Panels,
    help="EvoNav-Bench: lifelong navigation in homes that change. Begin with `evonav demo`.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings=HELP_NAMES,
)


def _print_version(is_asked: bool) -> None:
    if is_asked:
        from evonav import __version__

        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def options(
    print_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help=f"Show the traceback of an error, as the variable {DEBUG_VARIABLE}=1 does.")
    ] = False,
) -> None:
    """EvoNav-Bench: lifelong navigation in homes that change. Begin with `evonav demo`."""
    del print_version  # its callback has printed it
    if debug:
        os.environ[DEBUG_VARIABLE] = "1"


for heading, members in PANELS.items():
    for member in members:
        if isinstance(member, typer.Typer):
            app.add_typer(member, name=GROUP_NAMES[member], rich_help_panel=heading)
        else:
            add_commands(app, member, panel=heading)
add_examples(app)


def main() -> None:
    """Run the command; an error of evonav or of a file is printed as one line, without a traceback."""
    gc.set_threshold(50_000, 20, 20)  # looking for garbage takes a tenth of the time of imports, which leave none
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # NumPy would start threads that nothing here uses
    try:
        app()
    except Exception as error:
        from evonav.errors import EvonavError  # the command must start fast

        is_expected = isinstance(error, EvonavError | OSError)
        if not is_expected or os.environ.get(DEBUG_VARIABLE, "0") not in ("", "0"):
            raise
        typer.echo(f"error: {error}", err=True)
        sys.exit(EXIT_ERROR)
    finally:
        gc.freeze()  # as it ends, the interpreter would look for garbage once more, for 50 ms
