"""Options that commands share."""

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
        help=f"Names, comma-separated; see `evonav agents`. Default: {HEURISTICS}.",
        autocompletion=completion.agents,
    ),
]
OneAgent = Annotated[
    list[str] | None,
    typer.Option(
        "--agent",
        help="A name, `module:Class` or `./file.py:Class`; repeat it for more.",
        autocompletion=completion.agents,
    ),
]
RunFolder = Annotated[Path, typer.Argument(help="Folder of a run.", autocompletion=completion.runs)]
InProcess = Annotated[
    bool,
    typer.Option("--in-process", help="Agents in the evaluator's process, for debuggers: only exceptions are held."),
]
AgentTimeout = Annotated[
    float | None,
    typer.Option(min=0.1, help="Seconds for an agent's answer, then its stage is errored. Default: 600, vlm 3600."),
]
AgentMemory = Annotated[int | None, typer.Option(min=256, help="MB of address space for an agent's process.")]
HOUSES = "ProcTHOR JSON, JSONL, JSONL.gz, or procthor-10k:SPLIT"
Houses = Annotated[Path | None, typer.Option(help=f"{HOUSES} to generate tasks from.")]
Tasks = Annotated[
    Path | None,
    typer.Option(help="Folder of tasks; default: the bundled ones.", autocompletion=completion.task_folders),
]
Limit = Annotated[int | None, typer.Option(min=1, help="Take the first N (multi-room) houses or tasks.")]
Subset = Annotated[
    str | None,
    typer.Option(help="Named subset, SPLIT-N, such as test-90 (docs/tasks.md).", autocompletion=completion.subsets),
]
Seed = Annotated[int, typer.Option(min=0, help="Decides everything random.")]
Workers = Annotated[int | None, typer.Option(min=0, help="Processes; default: one a core. 0: in this process.")]
Retries = Annotated[
    int,
    typer.Option(min=0, help="How often a stage is tried again that lost its worker, simulator or agent's process."),
]


class EngineOption(str, Enum):
    """What the workers are."""

    LOCAL = "local"
    RAY = "ray"


Engine = Annotated[EngineOption, typer.Option(help="Processes here, or Ray.")]
RayAddress = Annotated[str | None, typer.Option(help="Of a Ray cluster that shares this file system.")]
WorkerGpus = Annotated[
    float,
    typer.Option(min=0.0, help="Ray: GPUs set aside for each worker, such as 0.5; for perception that needs one."),
]


def check_engine(engine: EngineOption, ray_address: str | None, worker_gpus: float = 0.0) -> None:
    """Refuses options of Ray without it."""
    if engine is not EngineOption.RAY:
        for name, is_given in (("--ray-address", ray_address is not None), ("--worker-gpus", worker_gpus > 0.0)):
            if is_given:
                raise typer.BadParameter(f"{name} is for --engine ray")


AnyAsset = Annotated[
    bool,
    typer.Option("--allow-unknown-assets", help="Objaverse houses: unknown assets get their category's usual size."),
]


RetryErrored = Annotated[bool, typer.Option("--retry-errored", help="Run errored stages again.")]
Out = Annotated[Path, typer.Option(help="Folder of the run; an unfinished one is resumed.")]


def names_of(agents: list[str] | None, agent: list[str] | None = None) -> list[str]:
    """What `--agents` and `--agent` name, in that order; the heuristics where neither was given."""
    lists = agents if agents is not None else [] if agent else [HEURISTICS]
    return [*(name for text in lists for part in text.split(",") if (name := part.strip())), *(agent or ())]


def count_of(workers: int | None) -> int:
    """Processes to start: as told, or one a core."""
    if workers is not None:
        return workers
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
