"""`evonav video`: write an episode as a video, or as a recording for the rerun viewer."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import status
from evonav.cli.options.shared import Exchanges, RunFolder, RunTask, RunTasks, Stages, listed, numbers_of
from evonav.counted import counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from PIL.Image import Image

    from evonav.replay.replay import RunReplay
    from evonav.replay.types import ReplayedStage

Agent = Annotated[
    str | None,
    typer.Option("--agent", metavar="NAME", help="Agent of the run. Default: the one that best shows differences."),
]

ACTIONS_FPS, ROUNDS_FPS = 12.0, 2.0
RECORDING = ".rrd"
"""End of the name of a recording."""
VIEW_PX = 396
"""Longer edge of the heading views, in pixels."""
MANY_ROUNDS = 100
"""Budget of rounds above which each round is a single action."""


def video(
    run: RunFolder,
    task: RunTask = None,
    agent: Agent = None,
    stage: Stages = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Video (.mp4), or recording for rerun (.rrd). Default: RUN/episode.mp4."),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(
            min=0.1, metavar="X", help="Rounds per second. Default: 2, or 12 where each round is a single action."
        ),
    ] = None,
    width: Annotated[int, typer.Option(min=1, metavar="N", help="Width of the video, in pixels.")] = 1280,
    tasks: RunTasks = None,
    exchanges: Exchanges = None,
) -> None:
    """Write an episode as a video, or as a recording for rerun.

    Both show the views, the agent's map and memory, and the truth.
    """
    from evonav.replay.rerun_export import check_recording, write_recording
    from evonav.replay.video import check_video, write_video
    from evonav.replay.video_frames import episode_frame, stage_frames

    out = out or run / "episode.mp4"
    is_recording = out.suffix == RECORDING
    if is_recording:
        check_recording(out)
    else:
        check_video(out, fps or ROUNDS_FPS, width)
    replay, every, shown, success_radius_m = _replayed(
        run, task, agent, stage, tasks, exchanges, keeps_depth=is_recording
    )
    maps = {one.record.stage: one.floor_plan for one in every if one.floor_plan is not None}
    what = f"{every[0].record.agent} in {every[0].record.task_id}"
    if is_recording:
        write_recording(shown, maps, out, success_radius_m=success_radius_m)
        typer.echo(f"recording: {out} ({what}); open it with: rerun {out}")
        return
    frame, budget = episode_frame(every, maps), replay.budget(every[0].record.agent)
    with status("Drawing") as tell:

        def pictures(one: "ReplayedStage") -> "Iterator[Image]":
            drawn = stage_frames(one, maps, frame, budget=budget, success_radius_m=success_radius_m)
            for number, picture in enumerate(drawn, 1):
                tell(f"stage {one.record.stage}, picture {number} of {len(one.rounds) + 1}")
                yield picture

        speed = fps or (ACTIONS_FPS if budget > MANY_ROUNDS else ROUNDS_FPS)
        num = write_video(map(pictures, shown), out, fps=speed, width_px=width)
    typer.echo(f"video: {out} ({what}, {counted(num, 'picture')})")


def _replayed(
    run: Path,
    task: str | None,
    agent: str | None,
    stage: "Sequence[str] | None",
    tasks: Path | None,
    exchanges: Path | None,
    *,
    keeps_depth: bool,
) -> "tuple[RunReplay, list[ReplayedStage], list[ReplayedStage], float]":
    """Replay an episode; return the replay, all stages, the chosen ones, and the success radius in metres."""
    from evonav.errors import InvalidArgumentError
    from evonav.replay.replay import RunReplay
    from evonav.replay.run_pages import task_path
    from evonav.report.pages.replays import highlights_first
    from evonav.report.run import load_run

    wanted = set(numbers_of("--stage", stage)) or None
    found = load_run(run)
    episodes = highlights_first(found)
    fitting = (one for one in episodes if one[0] == (agent or one[0]) and one[1] == (task or one[1]))
    name, task_id = next(fitting, (agent or "", task or ""))  # the replay raises if there is no record
    replay = RunReplay(run, task_path(run, tasks), exchanges, heading_px=VIEW_PX, keeps_depth=keeps_depth)
    with status("Replaying") as tell:
        last = None if wanted is None else max(wanted)

        def on_round(stage: int, number: int) -> None:
            tell(f"stage {stage}, round {number + 1}")

        stages = list(replay.episode(name, task_id, on_round, last_stage=last))
    shown = [one for one in stages if wanted is None or one.record.stage in wanted]
    if not shown:
        raise InvalidArgumentError(f"{run}: no stage {', '.join(listed(stage))} of task {task_id!r} by agent {name!r}")
    for one in shown:
        reason = one.why_not or "; ".join(one.differences)
        if reason:
            what = "is shown as recorded" if one.why_not else "differs from the record; the replay is shown"
            typer.echo(f"stage {one.record.stage} {what}: {reason}", err=True)
    return replay, stages, shown, found.success_radius_m
