"""Write an episode as a recording for rerun's viewer (extra `rerun`): views, map, memory, house and way in one scene.

The scene's axes are x, z and y of the records: right-handed, z up, where AI2-THOR's are left-handed, y up.
"""

import math
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from evonav.component import optional_module
from evonav.drawing.files import check_suffix
from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.parallel.folders import replacing
from evonav.replay.page_data import describe_truth
from evonav.replay.types import BLOCKED, ReplayedMap, ReplayedRound, ReplayedStage, ReplayedView
from evonav.report.maps.moments import Moment, moments
from evonav.report.maps.text import describe_change, describe_choice, describe_outcome
from evonav.report.tables.causes import sentence
from evonav.tasks.language import noun_of

SUFFIX = ".rrd"
_ENTRY, _CANDIDATE, _CHOSEN, _STALE = (15, 118, 110), (20, 184, 166), (194, 65, 12), (209, 26, 42)
_MOVED, _ITEM, _WALL, _GOLD, _WAY = (217, 102, 11), (152, 160, 174, 70), (59, 66, 82), (255, 201, 25), (47, 102, 203)
_CELLS = np.array([(138, 147, 163), (207, 219, 243), (39, 48, 67), (173, 209, 246)], np.uint8)
"""Colours of unknown, free, blocked and explored cells."""


def check_recording(path: Path) -> None:
    """Check that a recording could be written there, before the work is done.

    Raises:
        InvalidArgumentError: The file's suffix is another one.
        StoreError: rerun is not installed.
    """
    check_suffix(path, SUFFIX)
    _rerun()


def write_recording(
    stages: Sequence[ReplayedStage], maps: Mapping[int, FloorPlan], path: Path, *, success_radius_m: float
) -> Path:
    """Write an episode as a recording, with the timelines `step`, `stage` and `round`.

    Raises:
        InvalidArgumentError: The file's suffix is another one, or there is no stage.
        StoreError: rerun is not installed, or the file cannot be written.
    """
    check_recording(path)
    if not stages:
        raise InvalidArgumentError("argument `stages` is empty, expected a stage or more")
    rr = _rerun()
    first = stages[0].record
    with replacing(path) as beside:
        stream = rr.RecordingStream("evonav", recording_id=f"{first.agent} in {first.task_id}")
        try:
            stream.save(beside)
            stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            step = 0
            for stage in stages:
                step = _Recorder(rr, stream, stage, maps, success_radius_m).record(step)
            stream.flush()
        except RuntimeError as error:
            raise StoreError(f"{path}: {error}") from error
        finally:
            stream.disconnect()
    return path


class _Recorder:
    """Write one stage."""

    def __init__(
        self,
        rr: Any,  # noqa: ANN401 - rerun is not there for the type checker
        stream: Any,  # noqa: ANN401
        stage: ReplayedStage,
        maps: Mapping[int, FloorPlan],
        radius_m: float,
    ) -> None:
        self._rr, self._stream, self._stage = rr, stream, stage
        self._maps, self._radius_m = maps, radius_m
        self._way: list[tuple[float, float, float]] = []

    def record(self, step: int) -> int:
        """Write the stage from this step on; return the step after it."""
        record = self._stage.record
        parts = moments(record, self._maps)
        for index, replayed in enumerate(self._stage.rounds):
            self._stream.set_time("step", sequence=step)
            self._stream.set_time("stage", sequence=record.stage)
            self._stream.set_time("round", sequence=index + 1)
            if index == 0:
                goal = f"stage {record.stage}: {record.goal.instruction}"
                self._stream.log("words", self._rr.TextLog(goal, level="INFO"))
            for moment in parts:
                if moment.first_round == index:
                    self._house(moment)
            self._round(replayed)
            step += 1
        text = f"stage {record.stage}: {describe_outcome(record)}. {sentence(record)}"
        self._stream.log("words", self._rr.TextLog(text, level="INFO"))
        return step

    def _house(self, moment: Moment) -> None:
        """Write where everything is: as the stage begins, and after a change during it."""
        rr, log, record = self._rr, self._stream.log, moment.record
        if moment.first_round > 0:
            log("words", rr.TextLog(f"the house changes: {describe_change(record, moment.maps)}", level="INFO"))
        x_m, y_m, z_m = record.target.position_m
        log("world/target", rr.Points3D([(x_m, z_m, y_m)], colors=[_GOLD], radii=[0.12], labels=["target"]))
        turns = np.linspace(0, math.tau, 61)
        ring = [(x_m + self._radius_m * math.cos(t), z_m + self._radius_m * math.sin(t), 0.02) for t in turns]
        log("world/target/success_radius", rr.LineStrips3D([ring], colors=[_GOLD]))
        house = moment.maps.get(record.stage)
        if house is None:
            return
        floors = [[(x, z, 0.0) for x, z in (*room.polygon_m, room.polygon_m[0])] for room in house.rooms]
        names = [noun_of(room.room_type) for room in house.rooms]
        log("world/house/rooms", rr.LineStrips3D(floors, colors=[_ITEM] * len(floors), labels=names))
        walls = [[(ax, az, h), (bx, bz, h)] for (ax, az), (bx, bz) in house.walls for h in (0.0, 2.5)]
        log("world/house/walls", rr.LineStrips3D(walls, colors=[_WALL] * len(walls)))
        moved = {relocation.object_id for relocation in record.transition.relocations}
        items = house.objects
        log(
            "world/house/objects",
            rr.Boxes3D(
                centers=[(item.centre_m[0], item.centre_m[2], item.centre_m[1]) for item in items],
                half_sizes=[(item.size_m[0] / 2, item.size_m[2] / 2, item.size_m[1] / 2) for item in items],
                labels=[noun_of(item.category) for item in items],
                colors=[_MOVED if item.object_id in moved else _ITEM for item in items],
                show_labels=False,
            ),
        )

    def _round(self, replayed: ReplayedRound) -> None:
        rr, log, record = self._rr, self._stream.log, replayed.record
        pose = replayed.pose
        for number, view in enumerate(reversed(replayed.views)):
            self._view("heading" if number == 0 else f"side_{number}", view)
        at = (pose.x_m, pose.z_m, 0.05)
        log("world/agent", rr.Points3D([at], colors=[_WALL], radii=[0.15]))
        if replayed.map is not None:
            self._map(replayed.map)
            self._memory(replayed)
        if record is None:
            return
        path = [(x, z, 0.05) for x, z in record.path_m]
        self._way += path
        log("world/agent/way", rr.LineStrips3D([self._way], colors=[_WAY], radii=[0.02]))
        log("world/agent/step", rr.LineStrips3D([path], colors=[_CHOSEN], radii=[0.03]))
        log("words", rr.TextLog(describe_choice(record), level="INFO"))
        for question in replayed.questions:
            log("words/answers", rr.TextLog(f"{question.kind}, {question.outcome}: {question.answer}", level="DEBUG"))
        if text := describe_truth(self._stage.record, replayed):
            log("words/evaluator", rr.TextLog(text, level="WARN"))

    def _view(self, name: str, view: ReplayedView) -> None:
        rr, path, pose = self._rr, f"world/agent/{name}", view.pose
        sin, cos = math.sin(pose.yaw_rad), math.cos(pose.yaw_rad)
        down, ahead = math.sin(pose.horizon_rad), math.cos(pose.horizon_rad)
        # Columns: the camera's right, down and forward in the scene.
        axes = [[cos, -down * sin, ahead * sin], [-sin, -down * cos, ahead * cos], [0.0, -ahead, -down]]
        self._stream.log(path, rr.Transform3D(translation=(pose.x_m, pose.z_m, pose.y_m), mat3x3=axes))
        width, height = Image.open(BytesIO(view.jpeg)).size
        focal = width / 2 / math.tan(self._stage.fov_rad / 2)
        camera = rr.Pinhole(focal_length=focal, width=width, height=height, image_plane_distance=0.6)
        self._stream.log(path, camera)
        self._stream.log(f"{path}/rgb", rr.EncodedImage(contents=view.jpeg, media_type="image/jpeg"))
        if view.depth_png is not None:
            # As large as the camera's picture: rerun projects both by the same camera.
            depth_mm = np.asarray(Image.open(BytesIO(view.depth_png)).resize((width, height), Image.Resampling.NEAREST))
            self._stream.log(f"{path}/depth", rr.DepthImage(depth_mm.astype(np.uint16), meter=1000.0))

    def _map(self, belief: ReplayedMap) -> None:
        rr, log = self._rr, self._stream.log
        log("map", rr.Image(_CELLS[belief.cells[::-1]]))
        rows, cols = np.nonzero(belief.cells == BLOCKED)
        x_m = belief.corner_m[0] + (cols + 0.5) * belief.cell_m
        z_m = belief.corner_m[1] + (rows + 0.5) * belief.cell_m
        points = np.stack([x_m, z_m, np.zeros_like(x_m)], axis=1)
        log("world/map/blocked", rr.Points3D(points, colors=[(39, 48, 67)], radii=[belief.cell_m / 2]))

    def _memory(self, replayed: ReplayedRound) -> None:
        rr, log = self._rr, self._stream.log
        chosen = None if replayed.record is None else replayed.record.chosen_entry
        entries = [entry.record for entry in replayed.entries]
        colours = [
            _STALE
            if entry.is_stale
            else _CHOSEN
            if chosen is not None and entry.entry_id == chosen.entry_id
            else _CANDIDATE
            if entry.entry_id in replayed.candidate_ids
            else _ENTRY
            for entry in entries
        ]
        log(
            "world/memory/entries",
            rr.Boxes3D(
                centers=[(entry.centre_m[0], entry.centre_m[2], entry.centre_m[1]) for entry in entries],
                half_sizes=[tuple(abs(entry.size_m[axis]) / 2 for axis in (0, 2, 1)) for entry in entries],
                labels=[f"{noun_of(e.label)} #{e.entry_id}{' (stale)' if e.is_stale else ''}" for e in entries],
                colors=colours,
            ),
        )
        frontiers = [(*frontier.position_m, 0.05) for frontier in replayed.frontiers]
        log("world/memory/frontiers", rr.Points3D(frontiers, colors=[(111, 195, 255)], radii=[0.1]))


def _rerun() -> Any:  # noqa: ANN401 - rerun is not there for the type checker
    return optional_module("rerun", "recordings need rerun", "'evonav[rerun]'")
