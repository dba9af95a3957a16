"""Declare options that several commands share."""

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.options import completion

if TYPE_CHECKING:
    from collections.abc import Iterator

    from evonav.tasks.listing import TaskFile

EXIT_INCOMPLETE = 3
HEURISTICS = "fu,stage-reset,ftu"

AgentNames = Annotated[
    list[str] | None,
    typer.Option(
        "--agents",
        help=f"Agents, separated by commas (see `evonav agents`). Default: {HEURISTICS}.",
        autocompletion=completion.agents,
    ),
]
OneAgent = Annotated[
    list[str] | None,
    typer.Option(
        "--agent",
        help="One agent: a name, `module:Class` or `./file.py:Class`. Repeat the option for more agents.",
        autocompletion=completion.agents,
    ),
]
RunFolder = Annotated[Path, typer.Argument(help="Folder of a run.", autocompletion=completion.runs)]
RunTasks = Annotated[Path | None, typer.Option(help="Folder of the run's tasks. Default: where the run found them.")]
Exchanges = Annotated[Path | None, typer.Option(help="File of a model's answers. Default: the one in RUN.")]
ComparedRuns = Annotated[
    list[str],
    typer.Argument(help="Runs or sweeps (all agents), RUN:AGENT, or a run followed by names of its agents."),
]
MarkdownFile = Annotated[Path | None, typer.Option(help="Write a Markdown file.")]
LatexFile = Annotated[Path | None, typer.Option(help="Write a LaTeX file (booktabs, graphicx).")]
CsvFile = Annotated[Path | None, typer.Option(help="Write a CSV file with unrounded numbers.")]
HOUSES = "ProcTHOR JSON, JSONL, JSONL.gz, or procthor-10k:SPLIT"
Houses = Annotated[Path | None, typer.Option(help=f"Houses to generate tasks from: {HOUSES}.")]
Tasks = Annotated[
    Path | None,
    typer.Option(help="Folder of tasks. Default: the bundled tasks.", autocompletion=completion.task_folders),
]
Limit = Annotated[
    int | None, typer.Option(min=1, help="Take only the first N multi-room houses or tasks. Default: all.")
]
Subset = Annotated[
    str | None,
    typer.Option(
        help="Take a named subset, SPLIT-N, such as test-90 (docs/tasks.md). Default: all.",
        autocompletion=completion.subsets,
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of every random choice.")]
AnyAsset = Annotated[
    bool,
    typer.Option(
        "--allow-unknown-assets",
        help="Give assets missing from the catalogue the usual size of their category; Objaverse houses need it.",
    ),
]
RetryErrored = Annotated[
    bool, typer.Option("--retry-errored", help="Run errored stages again, and those not run because of them.")
]
Out = Annotated[Path, typer.Option(help="Folder of the run; an unfinished run is resumed.")]


def names_of(agents: list[str] | None, agent: list[str] | None = None) -> list[str]:
    """Return the agents of `--agents`, then those of `--agent`; the paper's heuristics if neither is given."""
    lists = agents if agents is not None else [] if agent else [HEURISTICS]
    return [*(name for text in lists for name in listed(text)), *(agent or ())]


def listed(text: str | None) -> list[str]:
    """Return the names in a text that separates them by commas."""
    return [name for part in (text or "").split(",") if (name := part.strip())]


def numbers_of(option: str, text: str) -> list[int]:
    """Return the numbers in an option that separates them by commas."""
    try:
        return [int(number) for number in text.split(",")] if text else []
    except ValueError:
        raise typer.BadParameter(f"{option} {text}: numbers, comma-separated") from None


@contextmanager
def chosen_tasks(tasks: Path | None, limit: int | None, subset: str | None) -> "Iterator[list[TaskFile]]":
    """Lend the tasks that `--tasks`, `--limit` and `--subset` choose; by default the bundled tasks."""
    from evonav.tasks.bundled import bundled_tasks
    from evonav.tasks.listing import task_files

    if limit is not None and subset is not None:
        raise typer.BadParameter("give --limit or --subset, not both")
    with bundled_tasks() as bundled:
        yield task_files(tasks or bundled, limit, subset)
