"""Write a stream as files that other programs read."""

import json
import lzma
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from evonav.errors import InvalidArgumentError, StoreError
from evonav.memory_benchmark.protocol import MemoryFrame
from evonav.memory_benchmark.streams.export.conversion import quaternion_of, world_from_camera
from evonav.memory_benchmark.streams.export.layouts import (
    CAMERA_FILE,
    FEATURES,
    FRAMES_FILE,
    LAYOUTS,
    MASKS,
    ORACLE_FILE,
    STREAM_FILE,
    Camera,
    FileLayout,
    FrameLine,
    LayoutName,
    OracleHead,
    StreamFile,
    TruthLine,
)
from evonav.memory_benchmark.truth import Digest, Stream
from evonav.world.pose import Pose


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
        for path in (*(folder / name for name in (LAYOUTS[layout].rgb, LAYOUTS[layout].depth, MASKS)), oracle):
            path.parent.mkdir(parents=True, exist_ok=True)
        return _written(stream, folder, layout, oracle)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written: {error}") from error


def _written(stream: Stream, folder: Path, name: LayoutName, oracle: Path) -> StreamFile:
    layout, info = LAYOUTS[name], stream.info
    hashed, objects = Digest(stream), None
    lines: list[FrameLine] = []
    truths: list[TruthLine] = []
    for frame, truth in stream.frames():
        hashed.add(frame, truth)
        lines.append(_write_frame(frame, folder, layout))
        truths.append(
            TruthLine(
                objects=None if truth.objects is objects else tuple(truth.objects),
                visible_px=dict(truth.visible_px),
                empty_px=dict(truth.empty_px),
                detected_ids=tuple(truth.detected_ids),
            )
        )
        objects = truth.objects
    digest = hashed.hexdigest()
    written = StreamFile(
        name=stream.name,
        kind=stream.kind,
        house=stream.house,
        digest=digest,
        layout=name,
        num_frames=len(lines),
        depth_scale=layout.depth_scale,
        info=info,
    )
    head = OracleHead(name=stream.name, digest=digest, changes=tuple(stream.changes))
    text = "".join(f"{one.model_dump_json()}\n" for one in (head, *truths))
    oracle.write_bytes(lzma.compress(text.encode(), preset=1))
    _write_lines(folder / FRAMES_FILE, (one.model_dump_json(exclude_none=True) for one in lines))
    camera = Camera.of(info.intrinsics, layout.depth_scale).model_dump()
    _write_lines(folder / CAMERA_FILE, [json.dumps({"camera": camera}, indent=1)])
    _write_trajectory(folder, written, lines)
    _write_lines(folder / STREAM_FILE, [written.model_dump_json(indent=1)])
    return written


def _write_frame(frame: MemoryFrame, folder: Path, layout: FileLayout) -> FrameLine:
    """Write the images of a frame, and return its line."""
    view, index, found = frame.view, frame.index, frame.view.detections
    names = {"depth": layout.depth.format(index), "masks": MASKS.format(index)}
    # 16 bits; 0 where nothing is, or too far for them.
    depth = np.where(np.isfinite(view.depth_m), np.rint(view.depth_m.astype(np.float64) * layout.depth_scale), 0.0)
    depth[depth > np.iinfo(np.uint16).max] = 0.0
    for name, image in (("depth", depth), ("masks", found.masks + 1)):
        Image.fromarray(image.astype(np.uint16)).save(folder / names[name], compress_level=1)
    if view.rgb is not None:
        names["rgb"] = layout.rgb.format(index)
        Image.fromarray(view.rgb).save(folder / names["rgb"], quality=95)
    if found.features is not None:
        names["features"] = FEATURES.format(index)
        (folder / names["features"]).parent.mkdir(exist_ok=True)
        np.save(folder / names["features"], found.features)
    return FrameLine(
        index=index,
        time_s=frame.time_s,
        visit=frame.visit,
        pose=(*view.pose.position_m, view.pose.yaw_rad, view.pose.horizon_rad),
        labels=found.labels,
        confidences=tuple(found.confidences.tolist()),
        **names,
    )


def _write_trajectory(folder: Path, written: StreamFile, lines: Sequence[FrameLine]) -> None:
    """Write poses and lists of images as programs for the layout expect them."""
    matrices = [world_from_camera(Pose(*line.pose)) for line in lines if line.pose is not None]
    if written.layout == "replica":
        _write_lines(folder / "traj.txt", (_decimals(matrix.ravel()) for matrix in matrices))
        return
    comment = f"# {written.name}; world: {written.world}"
    for name in ("rgb", "depth"):
        listed = [f"{line.time_s:.6f} {getattr(line, name)}" for line in lines if getattr(line, name)]
        if listed:
            _write_lines(folder / f"{name}.txt", [comment, "# timestamp filename", *listed])
    rows = [
        f"{line.time_s:.6f} {_decimals((*matrix[:3, 3], *quaternion_of(matrix[:3, :3])))}"
        for line, matrix in zip(lines, matrices, strict=True)
    ]
    _write_lines(folder / "groundtruth.txt", [comment, "# timestamp tx ty tz qx qy qz qw", *rows])


def _decimals(values: Iterable[float]) -> str:
    return " ".join(f"{value:.9f}" for value in values)


def _write_lines(path: Path, lines: Iterable[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
