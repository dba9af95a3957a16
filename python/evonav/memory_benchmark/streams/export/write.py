"""Write a stream as files that other programs read."""

import json
import lzma
from pathlib import Path

import numpy as np

from evonav.errors import InvalidArgumentError, StoreError
from evonav.memory_benchmark.protocol import MemoryFrame
from evonav.memory_benchmark.streams.digest import Digest
from evonav.memory_benchmark.streams.export import images
from evonav.memory_benchmark.streams.export.conversion import opencv_camera, quaternion_of, world_from_camera
from evonav.memory_benchmark.streams.export.layouts import (
    FEATURES,
    FRAMES_FILE,
    LAYOUTS,
    MASKS,
    ORACLE_FILE,
    STREAM_FILE,
    ChangeLine,
    FileLayout,
    FrameLine,
    LayoutCamera,
    LayoutName,
    ObjectLine,
    OracleHead,
    StreamFile,
    TruthLine,
)
from evonav.memory_benchmark.truth import FrameTruth, Stream


def export_stream(
    stream: Stream, folder: Path, layout: LayoutName = "tum", *, oracle: Path | None = None
) -> StreamFile:
    """Write all frames of a stream into a folder, and its truth into a file that can be kept from others.

    Colours are written if the stream has them (`make_stream(spec, rgb=True)`).

    Args:
        layout: `tum` or `replica`.
        oracle: File of the truth. Default: `oracle.jsonl.xz` in the folder.

    Returns:
        What `stream.json` holds.

    Raises:
        InvalidArgumentError: There is no such layout.
        StoreError: The folder holds files, or something cannot be written.
    """
    if layout not in LAYOUTS:
        raise InvalidArgumentError(f"layout = {layout!r}: expected {' or '.join(LAYOUTS)}")
    oracle = oracle or folder / ORACLE_FILE
    try:
        if folder.exists() and any(folder.iterdir()):
            raise StoreError(f"{folder}: the folder is not empty")
        folder.mkdir(parents=True, exist_ok=True)
        oracle.parent.mkdir(parents=True, exist_ok=True)
        return _Writer(stream, folder, layout, oracle).write()
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written: {error}") from error


class _Writer:
    """Writes one stream."""

    def __init__(self, stream: Stream, folder: Path, layout: LayoutName, oracle: Path) -> None:
        self.stream, self.folder, self.oracle = stream, folder, oracle
        self.layout_name: LayoutName = layout
        self.layout: FileLayout = LAYOUTS[layout]
        self.lines: list[FrameLine] = []
        self.truths: list[TruthLine] = []
        self.matrices: list[np.ndarray] = []

    def write(self) -> StreamFile:
        for name in (*self.layout.folders(), str(Path(FEATURES).parent)):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        hashed, objects = Digest(self.stream), None
        for frame, truth in self.stream.frames():
            hashed.add(frame, truth)
            self._frame(frame)
            self._truth(truth, is_new=truth.objects is not objects)
            objects = truth.objects
        if not any((self.folder / Path(FEATURES).parent).iterdir()):
            (self.folder / Path(FEATURES).parent).rmdir()
        info, digest = self.stream.info, hashed.hexdigest()
        camera = opencv_camera(info.intrinsics) | {"vertical_fov_rad": info.intrinsics.vertical_fov_rad}
        written = StreamFile(
            name=self.stream.name,
            kind=self.stream.kind,
            house=self.stream.house,
            digest=digest,
            layout=self.layout_name,
            num_frames=len(self.lines),
            has_rgb=bool(self.lines) and self.lines[0].rgb is not None,
            rate_hz=info.rate_hz,
            depth_scale=self.layout.depth_scale,
            camera=LayoutCamera.model_validate(camera),
            labels=info.labels,
        )
        changes = tuple(map(ChangeLine.of, self.stream.changes))
        head = OracleHead(name=self.stream.name, digest=digest, changes=changes)
        lines = [one.model_dump_json() for one in (head, *self.truths)]
        self.oracle.write_bytes(lzma.compress("".join(f"{line}\n" for line in lines).encode(), preset=1))
        self._text(FRAMES_FILE, [one.model_dump_json(exclude_none=True) for one in self.lines])
        self._trajectory(written)
        self._text(STREAM_FILE, [written.model_dump_json(indent=1)])
        return written

    def _frame(self, frame: MemoryFrame) -> None:
        view, index, pose = frame.view, frame.index, frame.view.pose
        names = {"depth": self.layout.depth.format(index), "masks": MASKS.format(index)}
        images.write_depth(self.folder / names["depth"], view.depth_m, self.layout.depth_scale)
        images.write_masks(self.folder / names["masks"], view.detections.masks)
        if view.rgb is not None:
            names["rgb"] = self.layout.rgb.format(index)
            images.write_rgb(self.folder / names["rgb"], view.rgb)
        if view.detections.features is not None:
            names["features"] = FEATURES.format(index)
            np.save(self.folder / names["features"], view.detections.features)
        self.lines.append(
            FrameLine(
                index=index,
                time_s=frame.time_s,
                visit=frame.visit,
                pose=(*pose.position_m, pose.yaw_rad, pose.horizon_rad),
                labels=view.detections.labels,
                confidences=tuple(view.detections.confidences.tolist()),
                **names,
            )
        )
        self.matrices.append(world_from_camera(pose))

    def _truth(self, truth: FrameTruth, *, is_new: bool) -> None:
        self.truths.append(
            TruthLine(
                objects=tuple(map(ObjectLine.of, truth.objects)) if is_new else None,
                visible_px=dict(truth.visible_px),
                empty_px=dict(truth.empty_px),
                detected_ids=tuple(truth.detected_ids),
            )
        )

    def _trajectory(self, written: StreamFile) -> None:
        """Write poses, lists of images and the camera as programs for the layout expect them."""
        camera = written.camera.model_dump(exclude={"vertical_fov_rad"})
        self._text("cam_params.json", [json.dumps({"camera": {**camera, "scale": written.depth_scale}}, indent=1)])
        if self.layout_name == "replica":
            self._text("traj.txt", [" ".join(f"{value:.9f}" for value in one.ravel()) for one in self.matrices])
            return
        comment = f"# {written.name}; world: {written.world}"
        for name in ("rgb", "depth"):
            listed = [f"{line.time_s:.6f} {getattr(line, name)}" for line in self.lines if getattr(line, name)]
            if listed:
                self._text(f"{name}.txt", [comment, "# timestamp filename", *listed])
        rows = []
        for line, matrix in zip(self.lines, self.matrices, strict=True):
            values = (*matrix[:3, 3].tolist(), *quaternion_of(matrix[:3, :3]))
            rows.append(f"{line.time_s:.6f} {' '.join(f'{value:.9f}' for value in values)}")
        self._text("groundtruth.txt", [comment, "# timestamp tx ty tz qx qy qz qw", *rows])

    def _text(self, name: str, lines: list[str]) -> None:
        (self.folder / name).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
