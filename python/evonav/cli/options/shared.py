"""Declare the options that several commands share, each once."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evonav.cli.options import completion

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from evonav.house.files import HouseTexts
    from evonav.tasks.listing import TaskFile
    from evonav.world.house_options import HouseOptions

EXIT_INCOMPLETE = 3
HEURISTICS = "fu,stage-reset,ftu"
BUNDLED = "bundled"
_SEVERAL = "Repeat it, or separate by commas."

Agents = Annotated[
    list[str] | None,
    typer.Option(
        "--agent",
        metavar="NAME",
        help="Agent to run: a name (`evonav agents` lists them), with a rule of forgetting fu@bayes, "
        f"./file.py:Class or module:Class. {_SEVERAL} Default: {HEURISTICS}.",
        autocompletion=completion.agents,
    ),
]
RunAgents = Annotated[
    list[str] | None,
    typer.Option(
        "--agent",
        metavar="NAME",
        help=f"Agent of the run. {_SEVERAL} Default: all.",
        autocompletion=completion.run_agents,
    ),
]
RunFolder = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.", autocompletion=completion.runs)]
RunTasks = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER", help="Folder of the run's tasks. Default: where the run found them, or the bundled tasks."
    ),
]
RunTask = Annotated[
    str | None,
    typer.Option("--task", metavar="ID", help="Task of the run. Default: the one that best shows how agents differ."),
]
Stages = Annotated[
    list[str] | None, typer.Option("--stage", metavar="N", help=f"Stage of the task. {_SEVERAL} Default: all.")
]
Exchanges = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="SQLite file of a model's questions and answers. Default: the one in RUN."),
]
ComparedRuns = Annotated[
    list[str],
    typer.Argument(
        metavar="RUN",
        help="Runs or sweeps with all their agents, one agent as RUN:AGENT, or one run followed by some of its agents.",
        autocompletion=completion.runs,
    ),
]
PLOTS = ("svg", "png", "pdf")
"""Ends of names of plots, which need the extra `viz`."""


def files_option(*formats: str) -> Any:  # noqa: ANN401 - typer's
    """Return the option `--out` of a command that writes files in these formats, which names of files end with."""
    return typer.Option(
        "--out",
        metavar="FILE",
        callback=lambda files: _with_formats(files, formats),
        help=f"File to write; its name ends with .{', .'.join(formats)}. Repeat for more.",
    )


def _with_formats(files: list[Path] | None, formats: tuple[str, ...]) -> list[Path] | None:
    for path in files or ():
        if path.suffix.lstrip(".") not in formats:
            raise typer.BadParameter(f"{path}: expected a name that ends with .{', .'.join(formats)}")
    return files


HOUSES = "a file or folder of ProcTHOR houses, procthor-10k:SPLIT, evonav-10k:SPLIT, endless:SEED, or bundled"
Houses = Annotated[Path | None, typer.Option(metavar="HOUSES", help=f"Houses to generate tasks from: {HOUSES}.")]
SomeHouses = Annotated[Path, typer.Option("--houses", metavar="HOUSES", help=f"Houses: {HOUSES}.")]
AssetFile = Annotated[
    Path | None,
    typer.Option(
        "--assets",
        metavar="FILE",
        help="JSON file of sizes of assets that are missing from the catalogue, such as Objaverse's.",
    ),
]
StartOfHouses = Annotated[
    str,
    typer.Option(
        "--start", metavar="file|auto", help="Start where a house has none: none (file), a free place (auto)."
    ),
]
TASKS_HELP = "Folder of tasks, or bundled. Default: the bundled tasks."
Tasks = Annotated[Path | None, typer.Option(metavar="FOLDER", help=TASKS_HELP, autocompletion=completion.task_folders)]
TaskFolder = Annotated[
    Path | None, typer.Argument(metavar="FOLDER", help=TASKS_HELP, autocompletion=completion.task_folders)
]
Limit = Annotated[int | None, typer.Option(min=1, metavar="N", help="Take only the first N tasks or houses.")]
Subset = Annotated[
    str | None,
    typer.Option(
        metavar="SPLIT-N", help="Take only a named subset, such as test-90.", autocompletion=completion.subsets
    ),
]
Seed = Annotated[int, typer.Option(min=0, metavar="N", help="Seed of every random choice.")]
GeneratorFile = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="TOML file with parameters of the task generator. Default: the paper's."),
]
AnyAsset = Annotated[
    bool, typer.Option("--allow-unknown-assets", help="Give missing assets the usual size of their category.")
]
Workers = Annotated[
    int | None,
    typer.Option(min=0, metavar="N", help="Number of worker processes; 0 runs in this process. Default: one per core."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table, for other programs.")]
Against = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="JSON file of an earlier run: figures that became worse by more than chance explains are listed, and the "
        "exit code is 1.",
    ),
]
RetryErrored = Annotated[bool, typer.Option("--retry-errored", help="Run errored and skipped stages again.")]
Out = Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of the run; an unfinished run is resumed.")]


def read_houses(houses: "Path | str", assets: Path | None, start: str) -> "HouseTexts":
    """Return houses, with the sizes of `--assets` and the starts of `--start`; houses that evonav makes are made."""
    from evonav.cli.display import house_progress
    from evonav.house.evonav10k import SPLITS, made_split, split_to_make
    from evonav.house.files import HouseTexts

    if (split := split_to_make(str(houses))) is not None:
        with house_progress(SPLITS[split].num_houses) as show:
            made_split(split, on_progress=show)
    return HouseTexts(houses, house_options(assets, start))


def house_options(assets: Path | None, start: str) -> "HouseOptions | None":
    """Return what `--assets` and `--start` add to houses; `None` for nothing."""
    from evonav.world.house_options import HouseOptions

    if start not in ("file", "auto"):
        raise typer.BadParameter(f"--start {start}: expected file or auto")
    return HouseOptions.of(assets, "auto" if start == "auto" else "file")


def names_of(agents: "Sequence[str] | None") -> list[str]:
    """Return the agents that the option `--agent` names; the paper's heuristics if it is not given."""
    return listed(agents) or listed([HEURISTICS])


def did_you_mean(word: str, known: "Iterable[str]") -> str:
    """Return the question whether the nearest known word was meant; nothing if none is near."""
    from difflib import get_close_matches

    near = get_close_matches(word, list(known), 1)
    return f"; did you mean {near[0]}?" if near else ""


def num_workers_of(workers: int | None) -> int:
    """Return the number of workers: the given one, or one per core."""
    from evonav.parallel.local import num_cores

    return num_cores() if workers is None else workers


def listed(texts: "Sequence[str] | None") -> list[str]:
    """Return the names in the texts of an option, which may separate them by commas."""
    return [name for text in texts or () for part in text.split(",") if (name := part.strip())]


def numbers_of(option: str, texts: "Sequence[str] | None") -> list[int]:
    """Return the numbers in the texts of an option, which may separate them by commas."""
    try:
        return [int(number) for number in listed(texts)]
    except ValueError:
        raise typer.BadParameter(f"{option} {','.join(texts or ())}: expected numbers separated by commas") from None


def chosen_tasks(tasks: Path | None, limit: int | None, subset: str | None) -> "list[TaskFile]":
    """Return the tasks that `--tasks`, `--limit` and `--subset` choose."""
    from evonav.tasks.listing import task_files, task_folder

    if limit is not None and subset is not None:
        raise typer.BadParameter("give --limit or --subset, not both")
    return task_files(task_folder(tasks), limit, subset)
