"""Run memories through streams on many workers; called again on the same folder, run what is missing.

One job is one stream with all memories that have no record of it: they receive each frame in turn, so that it is
rendered once. Records do not depend on other jobs or memories; times do, where the machine is shared.
"""

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from evonav._core import __version__
from evonav.component import Component
from evonav.drawing.svg import slug
from evonav.errors import InvalidArgumentError
from evonav.memory.forgetting import RULES
from evonav.memory_benchmark.protocol import Memory
from evonav.memory_benchmark.records import BenchmarkResult, MemoryHeader, StreamResult
from evonav.memory_benchmark.run import MeasureSettings, MemorySource, measure_all
from evonav.memory_benchmark.streams import make_stream
from evonav.memory_benchmark.streams.export.recording import Recording
from evonav.memory_benchmark.streams.spec import StreamSpec
from evonav.memory_benchmark.truth import Stream
from evonav.parallel.folders import check_same_run, write_atomically, writing
from evonav.report.machine import machine_name
from evonav.report.measurements import finished, read_model

WORK = "evonav.memory_benchmark.benchmark:make_worker"
SILENCE_S = 600.0
"""Time without a frame after which a job is given up; the time limit of a call of a memory ends earlier."""
HEADER_NAME, RECORD_DIR = "memory.json", "records"

AnyStream = StreamSpec | Recording


@dataclass(frozen=True, slots=True)
class NamedMemory:
    """A memory with the name under which it is measured."""

    name: str
    component: Component[Memory]
    runs_here: bool = False
    """Run it in the worker, not in a process of its own, unless the settings say where memories run."""

    @property
    def digest(self) -> str | None:
        """SHA-256 of the file that it is written in; `None` for a module."""
        path = Path(self.component.path.rpartition(":")[0])
        with suppress(OSError):
            if path.suffix == ".py":
                return hashlib.sha256(path.read_bytes()).hexdigest()
        return None


def benchmark(
    memories: Sequence[NamedMemory],
    streams: Sequence[AnyStream],
    out: Path,
    *,
    settings: MeasureSettings | None = None,
    num_workers: int = 1,
    on_progress: Callable[[int, int, str], None] = lambda *_: None,
) -> tuple[BenchmarkResult, list[tuple[str, str, str]]]:
    """Run every memory through every stream, and keep a record of each in a folder.

    Args:
        memories: Memories; those of earlier commands stay in the folder.
        out: Holds `memory.json` and `records/`.
        settings: Must be the folder's own if it holds records.
        num_workers: Number of processes; 0 runs everything in this one.
        on_progress: Called with the number of records there are, of those asked for, and the name of the latest
            stream.

    Returns:
        All memories of the folder in these streams; and memory, stream and last line of what went wrong with a job: the
        same command tries it again. The failure of a memory is no failure of its job, but part of the result.

    Raises:
        InvalidArgumentError: There is no memory or stream, or one is named twice.
        StoreError: The folder holds other settings or a damaged record, or cannot be written.
        EngineError: Workers cannot be had.
    """
    settings = settings or MeasureSettings()
    names = [memory.name for memory in memories]
    if not memories or not streams:
        raise InvalidArgumentError(f"no {'stream' if memories else 'memory'} to measure")
    for kind, all_names in (("memory", names), ("stream", [stream.name for stream in streams])):
        if len(set(all_names)) != len(all_names):
            raise InvalidArgumentError(f"a {kind} is named twice: {', '.join(all_names)}")
    with writing(out):
        known = _begun(memories, out, settings)
        missing = {
            stream: [memory for memory in memories if not record_path(out, memory.name, stream.name).exists()]
            for stream in streams
        }
        jobs = [(stream, left) for stream, left in missing.items() if left]
        num_all = len(memories) * len(streams)
        num_done = num_all - sum(len(left) for _, left in jobs)
        failures: list[tuple[str, str, str]] = []
        on_progress(num_done, num_all, "")

        def text_of(job: tuple[AnyStream, list[NamedMemory]]) -> str:
            stream, left = job
            source = (
                {"folder": str(stream.folder), "up": stream.up} if isinstance(stream, Recording) else asdict(stream)
            )
            return json.dumps({"stream": source, "memories": list(map(asdict, left))})

        config = json.dumps(asdict(settings))
        ended = finished(WORK, config, jobs, text_of, num_workers=num_workers, timeout_s=SILENCE_S)
        for (stream, left), text, why in ended:
            if text is None:
                failures.extend((memory.name, stream.name, why) for memory in left)
            else:
                for one, record in zip(left, json.loads(text), strict=True):
                    write_atomically(record_path(out, one.name, stream.name), record + "\n")
            num_done += len(left)
            on_progress(num_done, num_all, stream.name)
        found = {}
        for memory in known:
            paths = [record_path(out, memory, stream.name) for stream in streams]
            there = [path for path in paths if path.exists()]
            if there:
                found[memory] = [read_model(StreamResult, path, "delete it to measure it again") for path in there]
        return BenchmarkResult(machine=machine_name(), memories=found), sorted(failures)


def record_path(folder: Path, memory: str, stream: str) -> Path:
    """Return the path of the record of a memory in a stream."""
    return folder / RECORD_DIR / slug(memory) / f"{stream.replace('/', '_')}.json"


def make_worker(settings: str, alive: Callable[[], None]) -> Callable[[str], str]:
    """Return the function from a job to its records, as `evonav.parallel.pool` calls it."""
    run_settings = MeasureSettings(**json.loads(settings))

    def work(text: str) -> str:
        given = json.loads(text)
        memories = [NamedMemory(**{**one, "component": Component(**one["component"])}) for one in given["memories"]]
        sources: list[MemorySource] = [
            memory.component.create if memory.runs_here and not run_settings.own_process else memory.component
            for memory in memories
        ]
        source = given["stream"]
        stream: Stream = (
            Recording(Path(source["folder"]), source["up"]) if "folder" in source else make_stream(StreamSpec(**source))
        )
        results = measure_all(sources, stream, run_settings, alive=alive)
        return json.dumps([result.model_dump_json() for result in results])

    return work


def _begun(memories: Sequence[NamedMemory], out: Path, settings: MeasureSettings) -> list[str]:
    """Claim the folder, delete the records of memories that have changed, and return the names of all memories."""
    identity = {"evonav": __version__, "settings": asdict(settings)}
    path, known = out / HEADER_NAME, dict[str, Any]()
    if path.exists():
        there = read_model(MemoryHeader, path, "expected a header of `evonav bench memory`")
        check_same_run(there.identity, identity, out)
        known.update(there.memories)
    for memory in memories:
        its = {"path": memory.component.path, "options": dict(memory.component.options), "sha256": memory.digest}
        if known.get(memory.name, its) != its:
            for record in (out / RECORD_DIR / slug(memory.name)).glob("*.json"):
                record.unlink(missing_ok=True)
        known[memory.name] = its
    write_atomically(path, MemoryHeader(identity=identity, memories=known).model_dump_json(indent=2) + "\n")
    return list(known)


_REFERENCES = "evonav.memory_benchmark.references"
MEMORIES: dict[str, Component[Memory]] = {
    **{rule: Component(f"{_REFERENCES}:ObjectMapMemory", {"rule": rule}) for rule in RULES},
    "clean-up": Component(f"{_REFERENCES}:ObjectMapMemory", {"rule": "never", "min_detections": 2}),
    "numpy-list": Component(f"{_REFERENCES}:NumpyList"),
}
"""The reference memories: an object map with each forgetting rule, one with a clean-up, and a list in NumPy.

`clean-up` never forgets but by the clean-up of agents' maps, which drops entries with one detection.
"""
PEERS: dict[str, Component[Memory]] = {
    "open3d-faiss": Component("evonav.memory_benchmark.open3d_faiss:Open3DFaissMemory"),
}
"""Memories of other libraries, which need the extra `bench`."""


def named_memories(names: Sequence[str]) -> list[NamedMemory]:
    """Return memories by their names.

    Args:
        names: References, which run in the workers; peers, `./file.py:Class` or `package.module:Class`, which run in
            processes of their own; none for all references.

    Raises:
        InvalidArgumentError: A name is none of these.
    """
    known = {**MEMORIES, **PEERS}
    found = []
    for name in names or MEMORIES:
        if name not in known and ":" not in name:
            raise InvalidArgumentError(
                f"no memory {name!r}: expected one of {', '.join(known)}, or ./file.py:Class or package.module:Class"
            )
        found.append(NamedMemory(name, known.get(name) or Component(name), runs_here=name in MEMORIES))
    return found
