"""Declare options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options import completion

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
    return [*(name for text in lists for part in text.split(",") if (name := part.strip())), *(agent or ())]
