"""Declare options that several commands share."""

import os
from enum import Enum
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
InProcess = Annotated[
    bool,
    typer.Option(
        "--in-process",
        help="Run agents in the evaluator's process, for debuggers; a crash of an agent then ends the worker.",
    ),
]
AgentTimeout = Annotated[
    float | None,
    typer.Option(
        min=0.1,
        help="Seconds to wait for an agent's answer before its stage is errored. Default: 600, with a VLM 3600.",
    ),
]
AgentMemory = Annotated[
    int | None, typer.Option(min=256, help="Largest address space of an agent's process, in MB. Default: no limit.")
]
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
Workers = Annotated[
    int | None, typer.Option(min=0, help="Number of worker processes; 0 runs in this process. Default: one per core.")
]
Retries = Annotated[
    int,
    typer.Option(min=0, help="Number of retries of a stage that lost its worker, simulator or agent process."),
]


class EngineOption(str, Enum):
    """The kind of workers."""

    LOCAL = "local"
    RAY = "ray"


Engine = Annotated[EngineOption, typer.Option(help="Run workers as local processes or as Ray actors.")]
RayAddress = Annotated[
    str | None,
    typer.Option(help="Ray: address of a cluster that shares this file system. Default: start Ray on this machine."),
]
WorkerGpus = Annotated[
    float,
    typer.Option(min=0.0, help="Ray: GPUs reserved for each worker, such as 0.5, for perception that needs one."),
]


def check_engine(engine: EngineOption, ray_address: str | None, worker_gpus: float = 0.0) -> None:
    """Reject options of Ray that are given without `--engine ray`."""
    if engine is not EngineOption.RAY:
        for name, is_given in (("--ray-address", ray_address is not None), ("--worker-gpus", worker_gpus > 0.0)):
            if is_given:
                raise typer.BadParameter(f"{name} is for --engine ray")


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


def count_of(workers: int | None) -> int:
    """Return the number of worker processes: the given one, or one per core."""
    if workers is not None:
        return workers
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
