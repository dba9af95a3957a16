"""Show where the CPU time of a run went: by component, by function, and as a flame graph."""

import json
import os
import shutil
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import evonav
from evonav._core import __version__
from evonav.evaluation.records.store import RunStore
from evonav.parallel.folders import write_atomically
from evonav.parallel.profiling import VARIABLE, Samples, StackFrame, read_samples, sampled
from evonav.report.tables.numbers import NONE
from evonav.report.tables.table import Table, markdown_tables

FOLDER, SAMPLES_NAME = "profile", "samples"
FLAME_GRAPH_NAME, TABLES_NAME = "profile.speedscope.json", "profile.md"
COMPONENTS = ("agent", "decision", "simulation", "perception", "evaluator")
"""Components of a stage's CPU time; the decision model's is a part of the agent's."""
NUM_FUNCTIONS = 12
"""Functions in a table."""


@contextmanager
def profiling(run_dir: Path) -> Iterator[None]:
    """Sample this process and all that are started inside; `write_profile` reads the samples.

    Samples of an earlier call are deleted.
    """
    folder = run_dir / FOLDER / SAMPLES_NAME
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    os.environ[VARIABLE] = str(folder.absolute())
    try:
        with sampled("driver"):
            yield
    finally:
        del os.environ[VARIABLE]


def write_profile(run_dir: Path) -> tuple[list[Table], Path]:
    """Write the profile of a run that `profiling` sampled; return its tables, and its flame graph's path."""
    folder = run_dir / FOLDER
    samples = read_samples(folder / SAMPLES_NAME)
    tables = [component_table(run_dir), *map(function_table, samples)]
    flame_graph = write_atomically(folder / FLAME_GRAPH_NAME, json.dumps(speedscope(samples, run_dir.name)))
    write_atomically(folder / TABLES_NAME, markdown_tables(tables))
    return tables, flame_graph


def component_table(run_dir: Path) -> Table:
    """Build the table of CPU time by component: means over all stages that the run has recorded."""
    with RunStore(run_dir) as store:
        costs, timings = store.costs(), store.timings()
    by_agent: defaultdict[str, list[dict[str, float | None]]] = defaultdict(list)
    for key, (_, cpu_s) in timings.items():
        its = costs.get(key, {})
        by_agent[key[0]].append({"total": cpu_s, **{part: its.get(f"{part}_cpu_s") for part in COMPONENTS}})
    rows = tuple(
        (agent, str(len(stages)), *(_mean_ms([stage[part] for stage in stages]) for part in ("total", *COMPONENTS)))
        for agent, stages in sorted(by_agent.items())
    )
    notes = (
        "Means over the stages of all calls; of all processes. The decision model's time is a part of the agent's.",
    )
    return Table("CPU ms a stage by component", ("agent", "stages", "total", *COMPONENTS), rows, notes)


def _mean_ms(seconds: Sequence[float | None]) -> str:
    known = [value for value in seconds if value is not None]
    return f"{1e3 * sum(known) / len(known):.1f}" if known else NONE


def function_table(samples: Samples) -> Table:
    """Build the table of the functions with the largest CPU time of their own."""
    total_s = samples.total_s
    own = sorted(samples.own_s().items(), key=lambda item: (-item[1], item[0].file, item[0].line))
    rows = tuple(
        (frame.name, _place(frame), f"{seconds:.2f}", f"{seconds / total_s:.1%}")
        for frame, seconds in own[:NUM_FUNCTIONS]
    )
    title = f"CPU time by function: {samples.name}, {total_s:.1f} s"
    notes = ("Without the functions that it calls, but with compiled code.",)
    return Table(title, ("function", "place", "seconds", "share"), rows, notes)


def _place(frame: StackFrame) -> str:
    """Return a function's file and line; the file from the folder of its package on."""
    if not frame.file:
        return NONE
    file = Path(frame.file)
    packages = [one for one in file.parents if one.name == "site-packages" or one.name.startswith("python3.")]
    for folder in (Path(evonav.__file__).parent.parent, *packages):
        if file.is_relative_to(folder):
            return f"{file.relative_to(folder)}:{frame.line}"
    return f"{file.name}:{frame.line}"


def speedscope(samples: Sequence[Samples], name: str) -> dict[str, object]:
    """Return a flame graph with a profile for each kind of process.

    Source: https://www.speedscope.app/file-format-schema.json.
    """
    frames: dict[StackFrame, int] = {}
    profiles = [
        {
            "type": "sampled",
            "name": one.name,
            "unit": "seconds",
            "startValue": 0.0,
            "endValue": one.total_s,
            "samples": [[frames.setdefault(frame, len(frames)) for frame in stack] for stack in one.cpu_s],
            "weights": list(one.cpu_s.values()),
        }
        for one in samples
    ]
    return {
        "$schema": "https://www.speedscope.app/file-format-schema.json",
        "name": name,
        "exporter": f"evonav {__version__}",
        "activeProfileIndex": 0,
        "shared": {"frames": [{"name": one.name, "file": one.file, "line": one.line} for one in frames]},
        "profiles": profiles,
    }
