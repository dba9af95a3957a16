"""`evonav bench memory`: how fast scene memories update, and what they still believe after things have moved."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import interruptible, progress_bar, show_tables, status
from evonav.cli.group import Command, new_app
from evonav.cli.options.shared import EXIT_INCOMPLETE, HOUSES, Against, listed, numbers_of
from evonav.counted import counted

if TYPE_CHECKING:  # the command must start fast
    from evonav.memory_benchmark.benchmark import AnyStream
    from evonav.memory_benchmark.records import BenchmarkResult
    from evonav.memory_benchmark.streams.spec import StreamSpec
    from evonav.statistics import BeforeAfter

EXIT_WORSE = 1
"""Exit code where `--against` finds something worse."""
SEVERAL = "Repeat the option for more, or separate them by commas."

memory_app = new_app(help="Measure how fast scene memories update, and what they still believe.")

Kinds = Annotated[
    list[str] | None,
    typer.Option("--streams", metavar="KIND", help=f"Kinds of streams, S0 to S9. {SEVERAL} Default: all."),
]
StreamHouses = Annotated[
    str, typer.Option("--houses", metavar="HOUSES", help=f"Houses, of which five are chosen: {HOUSES}.")
]
Seeds = Annotated[
    list[str] | None,
    typer.Option("--seeds", metavar="N", help=f"Seeds of the streams. {SEVERAL} Default: 0,1,2, and 0 for S7."),
]
Size = Annotated[str, typer.Option(metavar="WxH", help="Width and height of the images.")]
Perception = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Perception of the streams, gt or noisy:PRESET. S8 has its own three. Default: gt.",
    ),
]
Quick = Annotated[bool, typer.Option("--quick", help="Take one house and one seed.")]
Oracle = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Folder of the truth, to keep it from the system that is measured. Default: that of the frames.",
    ),
]
ResultOut = Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Folder of the records and the report.")]


@memory_app.callback(
    invoke_without_command=True,
    no_args_is_help=False,
    epilog="Examples:\n\n  evonav bench memory --quick\n\n  evonav bench memory --memory ./mine.py:Mine --memory never "
    "--streams S1,S7 --out out/mine",
)
def memory(
    context: typer.Context,
    memories: Annotated[
        list[str] | None,
        typer.Option(
            "--memory",
            metavar="NAME",
            help=f"Memory to measure: a reference, open3d-faiss, ./file.py:Class or module:Class. {SEVERAL} Default: "
            "all references.",
        ),
    ] = None,
    streams: Kinds = None,
    houses: StreamHouses = "bundled",
    seeds: Seeds = None,
    size: Size = "300x300",
    perception: Perception = None,
    quick: Quick = False,
    recordings: Annotated[
        list[Path] | None,
        typer.Option(
            "--recording",
            metavar="FOLDER",
            help="Recording of your own in TUM's layout, instead of streams. It has no truth, so only speed and size "
            "are measured. Repeat the option for more.",
        ),
    ] = None,
    up: Annotated[
        str, typer.Option(metavar="z|y|-y", help="Axis of the recordings' right-handed world that points up.")
    ] = "z",
    every: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Ask for the entries after every N frames and at the ends of visits. Default: 1, and 10 in streams "
            "without changes.",
        ),
    ] = None,
    timeout: Annotated[
        float, typer.Option(min=0.1, metavar="S", help="Seconds to wait for a call of a memory before it has failed.")
    ] = 60.0,
    in_process: Annotated[
        bool | None,
        typer.Option(
            "--in-process/--own-process",
            help="Run memories in the workers, for debuggers, or each in a process of its own. Default: references in "
            "the workers, others in their own.",
        ),
    ] = None,
    twice: Annotated[
        bool, typer.Option("--twice", help="Run every stream twice, and say whether the answers are the same bits.")
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(
            min=0, metavar="N", help="Number of worker processes; 0 runs in this process. Default: one per core."
        ),
    ] = None,
    out: ResultOut = Path("out/memory"),
    against: Against = None,
) -> None:
    """Measure how fast scene memories update, and what they still believe.

    Every memory sees the same streams. Run again to resume. Writes report.html, plot.svg, result.json and summary.md.
    """
    if context.invoked_subcommand is not None:
        return
    from evonav.memory_benchmark.aggregate import against as compare
    from evonav.memory_benchmark.benchmark import benchmark, named_memories
    from evonav.memory_benchmark.records import read_result
    from evonav.memory_benchmark.run import MeasureSettings
    from evonav.memory_benchmark.streams.export.conversion import EVONAV_FROM_WORLD
    from evonav.memory_benchmark.streams.export.recording import Recording
    from evonav.parallel.local import num_cores

    earlier = None if against is None else read_result(against)
    chosen = named_memories(listed(memories))
    axis = next((known for known in EVONAV_FROM_WORLD if known == up), None)
    if axis is None:
        raise typer.BadParameter(f"--up {up}: expected {', '.join(EVONAV_FROM_WORLD)}")
    specs: list[AnyStream] = []
    for folder in recordings or ():
        specs.append(recording := Recording(folder, axis))
        labels = recording.info.labels
        has = f"detections of {counted(len(labels), 'label')}" if labels else "no detections"
        typer.echo(f"{folder}: {counted(recording.num_frames, 'frame')}, {has}, no truth: only speed and size")
    if streams or not recordings:
        specs += chosen_streams(streams, houses, seeds, size, perception, is_quick=quick)
    own_process = None if in_process is None else not in_process
    settings = MeasureSettings(own_process=own_process, timeout_s=timeout, every=every, runs_twice=twice)
    with interruptible(out), progress_bar("streams") as on_progress:
        result, failures = benchmark(
            chosen,
            specs,
            out,
            settings=settings,
            num_workers=num_cores() if workers is None else workers,
            on_progress=on_progress,
        )
    failed: dict[tuple[str, str], list[str]] = {}
    for name, stream, why in failures:
        failed.setdefault((stream, why), []).append(name)
    for (stream, why), names in failed.items():
        typer.echo(f"failed: {', '.join(names)} {stream}: {why}", err=True)
    _show(result, out, len(failures))
    if failures:
        typer.echo("incomplete: run the same command again to resume", err=True)
        raise typer.Exit(EXIT_INCOMPLETE)
    if earlier is not None and against is not None:
        tell_worse(against, compare(result, earlier))


@memory_app.command(cls=Command)
def export(
    out: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder to write a folder of each stream to.")],
    layout: Annotated[str, typer.Option(metavar="tum|replica", help="Layout of the files, tum or replica.")] = "tum",
    streams: Kinds = None,
    houses: StreamHouses = "bundled",
    seeds: Seeds = None,
    size: Size = "300x300",
    perception: Perception = None,
    quick: Quick = False,
    colours: Annotated[bool, typer.Option(help="Write colour images too.")] = True,
    oracle: Oracle = None,
) -> None:
    """Write streams as files, for systems in C++, in ROS or on another machine."""
    from evonav.memory_benchmark.streams import make_stream
    from evonav.memory_benchmark.streams.export.layouts import LAYOUTS
    from evonav.memory_benchmark.streams.export.write import export_stream

    layout_name = next((known for known in LAYOUTS if known == layout), None)
    if layout_name is None:
        raise typer.BadParameter(f"--layout {layout}: expected {' or '.join(LAYOUTS)}")
    specs = chosen_streams(streams, houses, seeds, size, perception, is_quick=quick)
    with status("Writing streams") as show:
        for spec in specs:
            name = spec.name.replace("/", "_")
            show(name)
            truth = None if oracle is None else oracle / f"{name}.jsonl.xz"
            written = export_stream(make_stream(spec, rgb=colours), out / name, layout_name, oracle=truth)
            typer.echo(f"{out / name}: {counted(written.num_frames, 'frame')}")


@memory_app.command(cls=Command)
def score(
    streams: Annotated[
        Path,
        typer.Argument(metavar="STREAMS", help="Folder of a stream from `evonav bench memory export`, or of many."),
    ],
    entries: Annotated[
        Path,
        typer.Argument(
            metavar="ENTRIES",
            help="File with the answers of a system, a line of JSON a frame; for a folder of many streams, the name of "
            "the file in the folder of each.",
        ),
    ] = Path("entries.jsonl"),
    system: Annotated[str, typer.Option(metavar="NAME", help="Name of the system in the tables.")] = "offline",
    oracle: Oracle = None,
    out: ResultOut = Path("out/memory-score"),
    against: Against = None,
) -> None:
    """Score the answers that a system wrote to files."""
    from evonav.errors import StoreError
    from evonav.memory_benchmark.aggregate import against as compare
    from evonav.memory_benchmark.offline import score as score_stream
    from evonav.memory_benchmark.records import BenchmarkResult, read_result
    from evonav.memory_benchmark.streams.export.read import ExportedStream
    from evonav.report.machine import machine_name

    earlier = None if against is None else read_result(against)
    is_one = (streams / "stream.json").is_file()
    folders = [streams] if is_one else sorted(path.parent for path in streams.glob("*/stream.json"))
    if not folders:
        raise StoreError(f"{streams}: holds no stream of `evonav bench memory export`")
    records = []
    with status("Scoring") as show:
        for folder in folders:
            show(folder.name)
            truth = None if oracle is None else oracle / f"{folder.name}.jsonl.xz"
            file = entries if is_one and entries.is_file() else folder / entries
            records.append(score_stream(ExportedStream(folder, truth), file))
    result = BenchmarkResult(machine=machine_name(), memories={system: records})
    _show(result, out, 0)
    if earlier is not None and against is not None:
        tell_worse(against, compare(result, earlier))


def chosen_streams(
    kinds: "Sequence[str] | None",
    houses: str,
    seeds: "Sequence[str] | None",
    size: str,
    perception: str | None,
    *,
    is_quick: bool,
) -> "list[StreamSpec]":
    """Return the streams that the options choose."""
    from evonav.memory_benchmark.streams.spec import KINDS, reference_specs
    from evonav.perception.shorthand import parse_perception

    names = [name.upper() for name in listed(kinds)]
    if unknown := [name for name in names if name not in KINDS]:
        raise typer.BadParameter(f"--streams {unknown[0]}: expected some of {', '.join(KINDS)}")
    width, _, height = size.partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise typer.BadParameter(f"--size {size}: expected width and height in pixels, such as 640x480")
    chosen = [kind for kind in KINDS if kind in names] if names else KINDS
    specs = reference_specs(houses, quick=is_quick, kinds=chosen, width_px=int(width), height_px=int(height))
    if wanted := numbers_of("--seeds", seeds):
        first = [spec for spec in specs if spec.seed == 0]
        specs = [replace(spec, seed=seed) for spec in first for seed in wanted]
    if perception is not None:
        parse_perception(perception)
        specs = [spec if spec.kind == "S8" else replace(spec, perception=perception) for spec in specs]
    return specs


def _show(result: "BenchmarkResult", out: Path, num_missing: int) -> None:
    from evonav.memory_benchmark.report import FAILURES, REMARKS, memory_tables, write_memory_report

    if not result.memories:
        return
    page = write_memory_report(result, out, num_missing=num_missing)
    tables = memory_tables(result)
    show_tables([tables[0], *(table for table in tables if table.title in (FAILURES, REMARKS))])
    typer.echo(f"page: {page}; figures: {out / 'result.json'}, {out / 'summary.md'}")


def tell_worse(file: Path, found: "Sequence[BeforeAfter]", other_machine: str | None = None) -> None:
    """Print what became worse than in an earlier file, and exit with 1 if anything did."""
    if other_machine is not None:
        typer.echo(f"{file} is of another machine ({other_machine}): ratios are compared, times are not")
    worse = [one for one in found if one.is_worse]
    for one in worse:
        typer.echo(f"worse: {one}")
    typer.echo(f"{len(worse)} of {len(found)} figures are worse than in {file}")
    if worse:
        raise typer.Exit(EXIT_WORSE)
