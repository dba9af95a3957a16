"""Videos: as many pictures as rounds, in the asked size, showing what the round holds."""

import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import command
from PIL import Image
from typer.testing import CliRunner

from evonav.cli import app
from evonav.drawing.style import light_css
from evonav.errors import InvalidArgumentError, StoreError
from evonav.replay.replay import RunReplay
from evonav.replay.types import ReplayedStage
from evonav.replay.video import write_video
from evonav.replay.video_frames import LEFTS, MAP_PX, SIZE, TOP, episode_frame, stage_frames
from evonav.tasks.listing import BUNDLED_TASKS

pytest.importorskip("resvg_py", reason="resvg is not installed")


@pytest.fixture(scope="module")
def stages(viewed_run: Path) -> list[ReplayedStage]:
    task_id = sorted(path.name for path in BUNDLED_TASKS.iterdir() if path.is_dir())[1]
    return list(RunReplay(viewed_run, lambda name: BUNDLED_TASKS / name, heading_px=396).episode("fu", task_id))


def pictures(stages: list[ReplayedStage], number: int) -> list[Image.Image]:
    maps = {stage.record.stage: stage.floor_plan for stage in stages if stage.floor_plan is not None}
    frame = episode_frame(stages, maps)
    return list(stage_frames(stages[number - 1], maps, frame, budget=9, success_radius_m=2.0))


def panel(picture: Image.Image, left: int) -> np.ndarray:
    return np.asarray(picture)[TOP : TOP + MAP_PX, left : left + MAP_PX].astype(int)


def colour(name: str) -> tuple[int, int, int]:
    """A colour of maps on a light page."""
    value = light_css(f".x{{fill:var(--{name})}}").rpartition("fill:#")[2]
    return (int(value[:2], 16), int(value[2:4], 16), int(value[4:6], 16))


def num_like(pixels: np.ndarray, wanted: tuple[int, int, int], tolerance: int = 40) -> int:
    return int((np.abs(pixels - np.array(wanted)).sum(axis=2) < tolerance).sum())


def test_there_is_a_picture_a_round_and_one_for_the_end(stages: list[ReplayedStage]) -> None:
    for stage in stages:
        drawn = pictures(stages, stage.record.stage)
        assert len(drawn) == len(stage.rounds) + 1
        assert {picture.size for picture in drawn} == {SIZE}
        # Every round is another picture: the agent has moved, or has seen more.
        assert len({picture.tobytes() for picture in drawn}) == len(drawn)


def test_a_picture_holds_view_belief_and_truth(stages: list[ReplayedStage]) -> None:
    drawn = pictures(stages, 2)[-2]
    view, belief, truth = (panel(drawn, left) for left in LEFTS)
    assert len(np.unique(view.reshape(-1, 3), axis=0)) > 1000  # a rendered view, not a plain field
    assert num_like(truth, colour("gold")) > 30  # the target
    assert num_like(belief, colour("gold")) < num_like(truth, colour("gold"))  # which no agent sees
    assert num_like(truth, colour("orange"), 60) > 0  # what moved before stage 2
    assert num_like(belief, (15, 118, 110), 60) > 30  # entries


def test_stale_entries_are_red_in_the_agents_map_alone_where_there_are_any(stages: list[ReplayedStage]) -> None:
    found = 0
    for stage in stages:
        for step, picture in zip(stage.rounds, pictures(stages, stage.record.stage), strict=False):
            has_stale = any(entry.record.is_stale for entry in step.entries)
            assert (num_like(panel(picture, LEFTS[1]), colour("red"), 60) > 0) == has_stale
            found += has_stale
    assert found > 0


def test_a_video_has_the_pictures_size_and_speed(stages: list[ReplayedStage], tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    path = tmp_path / "x.mp4"
    drawn = [pictures(stages, 1), pictures(stages, 2)]
    assert write_video(drawn, path, fps=4.0, width_px=640) == sum(map(len, drawn))
    assert [item.name for item in tmp_path.iterdir()] == [path.name]
    with av.open(path) as video:
        (stream,) = video.streams
        assert (stream.width, stream.height, stream.average_rate) == (640, 360, 4)
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(stream)]
    # The end of a stage is shown for two seconds.
    assert len(frames) == sum(map(len, drawn)) + 2 * (8 - 1)
    wanted = np.asarray(drawn[0][0].resize((640, 360), Image.Resampling.LANCZOS)).astype(int)
    assert np.abs(frames[0] - wanted).mean() < 6


def test_what_cannot_be_written_is_told_before_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("av")
    for name in ("x.avi", "x.gif", "x.webp"):
        with pytest.raises(InvalidArgumentError, match=r"expected a file \.mp4"):
            write_video([], tmp_path / name)
    with pytest.raises(InvalidArgumentError, match="even number"):
        write_video([], tmp_path / "x.mp4", width_px=641)
    with pytest.raises(InvalidArgumentError, match="fps"):
        write_video([], tmp_path / "x.mp4", fps=float("nan"))
    with pytest.raises(InvalidArgumentError, match="`stages` is empty"):
        write_video([], tmp_path / "x.mp4")
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(StoreError, match=r"pip install 'evonav\[video\]'"):
        write_video([], tmp_path / "x.mp4")
    assert list(tmp_path.iterdir()) == []


def test_the_command_films_the_stages_asked_for(viewed_run: Path, tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    path = tmp_path / "x.mp4"
    arguments = [
        "video",
        str(viewed_run),
        "--agent",
        "random-walk",
        "--stage",
        "2",
        "--out",
        str(path),
        "--width",
        "320",
    ]
    result = command(*arguments)
    assert "random-walk in bundled-" in result
    with av.open(path) as video:
        assert sum(1 for _ in video.decode(video=0)) == 10 + 4 - 1  # two rounds a second, the end for two seconds
    missing = CliRunner().invoke(app, [*arguments[:3], "nobody", "--out", str(path)])
    assert missing.exit_code == 1
    assert "no record of task" in str(missing.exception)
