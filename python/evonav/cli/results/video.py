"""`evonav video` and `evonav rerun`: an episode as a film, or as a recording for rerun's viewer."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import status
from evonav.cli.options.shared import RunFolder
from evonav.cli.results.view import task_path

if TYPE_CHECKING:
    from collections.abc import Callable

    from evonav.replay.replay import RunReplay
    from evonav.replay.types import ReplayedStage

Task = Annotated[str | None, typer.Argument(help="Id of a task of the run; default: the most telling one.")]
Agent = Annotated[str | None, typer.Option(help="Agent of the run; default: of the most telling episode.")]
Stages = Annotated[str, typer.Option("--stage", help="Stages, comma-separated; default: all.")]
Tasks = Annotated[Path | None, typer.Option(help="Folder of the run's tasks; default: where the run had them.")]
Exchanges = Annotated[Path | None, typer.Option(help="File of a model's answers; default: the one in RUN.")]
Out = Annotated[Path, typer.Option(help="File to write.")]

ACTIONS_FPS, ROUNDS_FPS = 12.0, 2.0
VIEW_PX = 396
"""Longer edge of the heading views."""
MANY_ROUNDS = 100
"""Rounds of a stage's budget from which on rounds are single actions."""


def video(
    run: RunFolder,
    out: Out,
    task: Task = None,
    agent: Agent = None,
    stage: Stages = "",
    fps: Annotated[float | None, typer.Option(help="Rounds a second; default: 2, or 12 of single actions.")] = None,
    width: Annotated[int, typer.Option(help="Of the video, pixels.")] = 1280,
    tasks: Tasks = None,
    exchanges: Exchanges = None,
) -> None:
    """Films an episode: views, the agent's map and memory, and the truth side by side (docs/video.md)."""
    from evonav.replay.video import check_video, write_video
    from evonav.replay.video_frames import episode_frame, stage_frames

    check_video(out, fps or ROUNDS_FPS, width)
    replay, agent, stages, success_radius_m = _replayed(run, task, agent, stage, tasks, exchanges, VIEW_PX)
    maps = {one.record.stage: one.stage_map for one in stages[0] if one.stage_map is not None}
    frame, budget = episode_frame(stages[0], maps), replay.budget(agent)
    with status("Drawing") as tell:

        def pictures(one: "ReplayedStage"):  # type: ignore[no-untyped-def] # noqa: ANN202 - a generator of pictures
            for number, picture in enumerate(
                stage_frames(one, maps, frame, budget=budget, success_radius_m=success_radius_m), 1
            ):
                tell(f"stage {one.record.stage}, picture {number} of {len(one.rounds) + 1}")
                yield picture

        speed = fps or (ACTIONS_FPS if budget > MANY_ROUNDS else ROUNDS_FPS)
        num = write_video((pictures(one) for one in stages[1]), out, fps=speed, width_px=width)
    typer.echo(f"video: {out} ({agent} in {stages[0][0].record.task_id}, {num} pictures)")


def rerun(
    run: RunFolder,
    out: Out,
    task: Task = None,
    agent: Agent = None,
    stage: Stages = "",
    tasks: Tasks = None,
    exchanges: Exchanges = None,
) -> None:
    """Writes an episode as a recording for rerun's viewer: one scene with views, map, memory and truth (.rrd)."""
    from evonav.replay.rerun_export import check_recording, write_recording

    check_recording(out)
    _, agent, (stages, shown), radius_m = _replayed(
        run, task, agent, stage, tasks, exchanges, VIEW_PX, keeps_depth=True
    )
    maps = {one.record.stage: one.stage_map for one in stages if one.stage_map is not None}
    write_recording(shown, maps, out, success_radius_m=radius_m)
    typer.echo(f"recording: {out} ({agent} in {stages[0].record.task_id}); open it with: rerun {out}")


def _replayed(
    run: Path,
    task: str | None,
    agent: str | None,
    stage: str,
    tasks: Path | None,
    exchanges: Path | None,
    heading_px: int,
    *,
    keeps_depth: bool = False,
) -> "tuple[RunReplay, str, tuple[list[ReplayedStage], list[ReplayedStage]], float]":
    """An episode, run again: its replay, agent, stages up to the last one asked for and those asked for, radius."""
    from evonav.errors import InvalidArgumentError
    from evonav.replay.replay import RunReplay
    from evonav.report.pages.highlights import highlights_first
    from evonav.report.run import load_run

    try:
        wanted = {int(number) for number in stage.split(",")} if stage else None
    except ValueError:
        raise typer.BadParameter(f"--stage {stage}: numbers, comma-separated") from None
    found = load_run(run)
    episodes = highlights_first(found)
    fitting = (one for one in episodes if one[0] == (agent or one[0]) and one[1] == (task or one[1]))
    name, task_id = next(fitting, (agent or "", task or ""))  # what there is no record of is told by the replay
    replay = RunReplay(run, task_path(run, tasks), exchanges, heading_px=heading_px, keeps_depth=keeps_depth)
    with status("Replaying") as tell:
        last = None if wanted is None else max(wanted)
        stages = list(replay.episode(name, task_id, _teller(tell), last_stage=last))
    shown = [one for one in stages if wanted is None or one.record.stage in wanted]
    if not shown:
        raise InvalidArgumentError(f"{run}: no stage {stage} of task {task_id!r} by agent {name!r}")
    for one in shown:
        told = one.why_not or "; ".join(one.differences)
        if told:
            what = "is shown as recorded" if one.why_not else "went otherwise than recorded, the new run is shown"
            typer.echo(f"stage {one.record.stage} {what}: {told}", err=True)
    return replay, name, (stages, shown), found.success_radius_m


def _teller(tell: "Callable[[str], None]") -> "Callable[[int, int], None]":
    return lambda stage, round_: tell(f"stage {stage}, round {round_ + 1}")
