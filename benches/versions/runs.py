"""Whole commands of two versions in turn: evaluations, generation, reports, and runs that ask a slow model."""

import json
import shutil
import sqlite3
import statistics
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benches import waiting
from benches.versions.lines import NONE, Line, pairwise
from benches.versions.version import Used, Version
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.decision.vlm.mock_server import MockServer, serving

HEURISTICS = "fu,ftu,stage-reset"
TASKS_A_TURN, TURNS_APART = 8, 4
Stage = tuple[str, str, int]
"""Agent, task and number."""


@dataclass
class Stages:
    """What a version's runs took, by stage."""

    cpu_s: dict[Stage, float] = field(default_factory=dict)
    num_rounds: dict[Stage, int] = field(default_factory=dict)

    def add(self, run: Path) -> None:
        """Read a run; of a stage that was run before, the least time stays."""
        with closing(sqlite3.connect(f"file:{run / 'records.sqlite'}?mode=ro", uri=True)) as store:
            for agent, task_id, stage, cpu_s in store.execute("SELECT agent, task_id, stage, cpu_s FROM timings"):
                stored = self.cpu_s.setdefault((agent, task_id, stage), cpu_s)
                self.cpu_s[agent, task_id, stage] = min(stored, cpu_s)
            for agent, task_id, stage, text in store.execute("SELECT agent, task_id, stage, record FROM stages"):
                self.num_rounds[agent, task_id, stage] = json.loads(text)["num_rounds"]

    @property
    def per_cpu_s(self) -> float:
        """Stages a CPU second of worker and agent."""
        return len(self.cpu_s) / sum(self.cpu_s.values())


def lines(
    before: Version, after: Version, houses: Path | None, folder: Path, limit: int | None = None
) -> Iterator[Line]:
    """The rows of evaluations, generation, the report, and a slow model; `limit` is a number of tasks."""
    tasks = _tasks(before.folder / "python" / "evonav" / "data" / "tasks")[:limit]
    hard = tasks
    if houses is not None:
        line, hard = _generated(before, after, houses, folder, limit)
        yield line
        yield from _evaluated(before, after, "`fu` on hard houses", "fu", hard, folder, "10")
    yield from _evaluated(before, after, "three heuristics on bundled tasks", HEURISTICS, tasks, folder, "15")
    yield _isolated(before, after, tasks, folder)
    yield from _first(before, after, tasks, folder)
    yield from _two_workers(before, after, tasks, folder)
    yield from _asking(before, after)
    yield _exchanges(before, after, folder)


def _tasks(folder: Path) -> list[Path]:
    return sorted(one.parent for one in folder.glob("*/task.json"))


def _generated(
    before: Version, after: Version, houses: Path, folder: Path, limit: int | None
) -> tuple[Line, list[Path]]:
    options = [] if limit is None else ["--limit", str(limit)]
    rates: dict[str, list[float]] = {"before": [], "after": []}
    for turn in range(2):
        for name, version in (("before", before), ("after", after)):
            out = folder / f"tasks-{name}-{turn}"
            used = version.run("generate", "--houses", houses, "--out", out, "--workers", "1", *options)
            rates[name].append(len(_tasks(out)) / used.cpu_s)
    tasks = _tasks(folder / "tasks-before-0")
    work = f"generation of {len(tasks)} tasks of hard houses, everything written, tasks a CPU second"
    return _rates(work, rates, "60"), tasks


def _evaluated(
    before: Version, after: Version, what: str, agents: str, tasks: Sequence[Path], folder: Path, aim: str
) -> Iterator[Line]:
    found = {"before": Stages(), "after": Stages()}
    for turn, some in enumerate(_portions(tasks, folder)):
        versions = [("before", before), ("after", after)]
        for name, version in versions[:: 1 if turn % 2 else -1]:
            found[name].add(_run(version, agents, some, folder / "run"))
    old, new = found["before"], found["after"]
    both = sorted(old.cpu_s.keys() & new.cpu_s.keys())
    same = statistics.fmean(old.num_rounds[key] == new.num_rounds[key] for key in both)
    rounds = [statistics.fmean(one.num_rounds.values()) for one in (old, new)]
    work = f"{what}: {len(both)} stages of {rounds[0]:.1f} and {rounds[1]:.1f} rounds ({same:.0%} of the same length)"
    gain = sum(old.cpu_s[key] for key in both) / sum(new.cpu_s[key] for key in both)
    yield Line(f"{work}, stages a CPU second", f"{old.per_cpu_s:.2f}", f"{new.per_cpu_s:.2f}", gain, aim)
    alike = [key for key in both if old.num_rounds[key] == new.num_rounds[key]]
    ms = [[1e3 * one.cpu_s[key] for key in alike] for one in (old, new)]
    medians = [f"{statistics.median(times):.0f} ms" for times in ms]
    yield Line("the same, a stage of the same length in both, CPU (median)", *medians, gain=pairwise(*ms))


def _isolated(before: Version, after: Version, tasks: Sequence[Path], folder: Path) -> Line:
    costs: dict[str, list[float]] = {"before": [], "after": []}
    for some in _portions(tasks, folder):
        for name, version in (("before", before), ("after", after)):
            apart, within = Stages(), Stages()
            for _ in range(TURNS_APART):
                apart.add(_run(version, "fu", some, folder / "run"))
                within.add(_run(version, "fu", some, folder / "run", "--in-process"))
            costs[name].append(sum(apart.cpu_s.values()) / sum(within.cpu_s.values()) - 1)
    medians = [f"{statistics.median(costs[name]):+.0%}" for name in costs]
    return Line("an agent's own process: CPU of a stage of `fu` over that in one process", *medians, aim="below 5%")


def _first(before: Version, after: Version, tasks: Sequence[Path], folder: Path) -> Iterator[Line]:
    one_task = _linked(tasks[:1], folder / "one")
    used: dict[str, list[Used]] = {"before": [], "after": []}
    for _ in range(5):
        for name, version in (("before", before), ("after", after)):
            used[name].append(_command(version, "fu", one_task, folder / "run"))
    work = "a first evaluation of one bundled task by `fu`, least of 5:"
    wall_s = [min(one.wall_s for one in used[name]) for name in used]
    cpu_s = [min(one.cpu_s for one in used[name]) for name in used]
    yield Line(f"{work} wall clock", *(f"{s:.2f} s" for s in wall_s), gain=wall_s[0] / wall_s[1], aim="1.0 s")
    yield Line(f"{work} CPU, starting included", *(f"{s:.2f} s" for s in cpu_s), gain=cpu_s[0] / cpu_s[1])


def _two_workers(before: Version, after: Version, tasks: Sequence[Path], folder: Path) -> Iterator[Line]:
    used: dict[str, Used] = {}
    report: dict[str, Used] = {}
    share: dict[str, float] = {}
    page_mb: dict[str, float] = {}
    everything = _linked(tasks, folder / "all")
    for name, version in (("before", before), ("after", after)):
        run, stages = folder / f"run-{name}", Stages()
        used[name] = _command(version, HEURISTICS, everything, run, num_workers=2)
        stages.add(run)
        share[name] = sum(stages.cpu_s.values()) / (2 * used[name].wall_s)
        report[name] = version.run("report", run)
        page_mb[name] = sum(one.stat().st_size for one in run.glob("*.html")) / 1e6
    walls = [used[name].wall_s for name in used]
    work = f"two workers, {len(stages.cpu_s)} stages of three heuristics, wall clock"
    yield Line(work, *(f"{wall_s:.1f} s" for wall_s in walls), gain=walls[0] / walls[1])
    in_use = [used[name].cpu_s / (2 * used[name].wall_s) for name in used]
    yield Line("share of both cores in use meanwhile", *(f"{one:.0%}" for one in in_use), aim="95%")
    yield Line("share of both cores that stages use", *(f"{share[name]:.0%}" for name in used))
    cpus = [report[name].cpu_s for name in report]
    work = f"report of those {len(stages.cpu_s)} stages, CPU"
    yield Line(work, *(f"{cpu_s:.1f} s" for cpu_s in cpus), gain=cpus[0] / cpus[1], aim="15 s for 13,311")
    peaks = [report[name].peak_mb for name in report]
    yield Line("its memory", *(f"{mb:.0f} MB" for mb in peaks), gain=peaks[0] / peaks[1], aim="300 MB for 13,311")
    yield Line("its page", *(f"{mb:.1f} MB" for mb in page_mb.values()), gain=page_mb["before"] / page_mb["after"])


def _asking(before: Version, after: Version) -> Iterator[Line]:
    """The model answers after a second; the earlier version has one episode a worker."""
    ways = {
        "24 at once, before": (before, 24, ["--workers", "24"]),
        "24 at once": (after, 24, ["--workers", "2", "--episodes-at-once", "12"]),
        "100 at once": (after, 100, ["--workers", "2", "--episodes-at-once", "50"]),
    }
    found = {
        name: waiting.measured(
            lambda url, out, by=version, more=options: by.command(*waiting.asking(url, out), *more),  # type: ignore[misc]
            num,
            version.environment,
        )
        for name, (version, num, options) in ways.items()
    }
    old, new, many = found.values()
    work = "24 episodes at once, a model of 1 s latency:"
    yield Line(f"{work} memory", f"{old[2]:.0f} MB", f"{new[2]:.0f} MB", old[2] / new[2])
    yield Line(f"{work} questions/s", f"{old[0]:.1f}", f"{new[0]:.1f}", new[0] / old[0])
    cpu_ms = [1e3 * one[1] / one[0] for one in (old, new)]
    yield Line(f"{work} CPU a question", *(f"{ms:.0f} ms" for ms in cpu_ms), gain=cpu_ms[0] / cpu_ms[1])
    yield Line("100 episodes at once: memory", NONE, f"{many[2]:.0f} MB", aim="4 GB")
    yield Line("100 episodes at once: questions/s", NONE, f"{many[0]:.1f}", aim="50")


def _exchanges(before: Version, after: Version, folder: Path) -> Line:
    """Sizes of the files of questions and answers, with their images."""
    sizes_mb = []

    def reply(request: dict[str, Any]) -> Mapping[str, Any]:
        return {"text": mock_answer(request)}

    for version in (before, after):
        with serving(MockServer(reply)) as server:
            stages, out = Stages(), folder / "asked"
            version.run(*waiting.asking(server.url, out, "fu"), "--limit", "6", "--workers", "2")
            stages.add(out)
            kept = sum(one.stat().st_size for one in out.rglob("exchanges*") if one.is_file())
            sizes_mb.append(kept / 1e6 / len(stages.cpu_s))
            shutil.rmtree(out)
    said = [f"{mb:.2f} MB" for mb in sizes_mb]
    return Line("questions and answers of `fu` kept, a stage", *said, gain=sizes_mb[0] / sizes_mb[1], aim="0.5 MB")


def _rates(work: str, rates: Mapping[str, Sequence[float]], aim: str) -> Line:
    medians = [f"{statistics.median(rates[name]):.1f}" for name in ("before", "after")]
    return Line(work, *medians, gain=pairwise(rates["after"], rates["before"]), aim=aim)


def _command(version: Version, agents: str, tasks: Path, out: Path, *options: str, num_workers: int = 1) -> Used:
    """Evaluate into a folder that is made anew."""
    shutil.rmtree(out, ignore_errors=True)
    workers = ["--workers", str(num_workers)]
    return version.run("evaluate", "--agents", agents, "--tasks", tasks, *workers, "--out", out, *options)


def _run(version: Version, agents: str, tasks: Path, out: Path, *options: str) -> Path:
    _command(version, agents, tasks, out, *options)
    return out


def _portions(tasks: Sequence[Path], folder: Path) -> Iterator[Path]:
    """Folders of some of the tasks each."""
    for number, first in enumerate(range(0, len(tasks), TASKS_A_TURN)):
        yield _linked(tasks[first : first + TASKS_A_TURN], folder / f"portion-{number}")


def _linked(tasks: Sequence[Path], folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for task in tasks:
        (folder / task.name).symlink_to(task, target_is_directory=True)
    return folder
