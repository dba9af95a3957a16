"""Write videos of episodes as mp4 (extra `video`)."""

import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from evonav.component import optional_module
from evonav.drawing.files import check_suffix, resvg
from evonav.errors import InvalidArgumentError
from evonav.parallel.folders import replacing

SUFFIX = ".mp4"
MIN_WIDTH_PX = 320
END_S = 2.0
"""Time for which the end of a stage is shown."""


def check_video(path: Path, fps: float, width_px: int) -> None:
    """Check that a video could be written there, before the work is done.

    Raises:
        InvalidArgumentError: The file is no `.mp4`, or a number is out of range.
        StoreError: A library is not installed.
    """
    check_suffix(path, SUFFIX)
    if not 0.1 <= fps <= 60:
        raise InvalidArgumentError(f"argument `fps` is {fps}, expected 0.1 to 60 rounds a second")
    if width_px < MIN_WIDTH_PX or width_px % 2:
        raise InvalidArgumentError(f"argument `width_px` is {width_px}, expected an even number from {MIN_WIDTH_PX}")
    _imageio()
    resvg()


def write_video(stages: Iterable[Iterable[Image.Image]], path: Path, *, fps: float = 2.0, width_px: int = 1280) -> int:
    """Write a video.

    Args:
        stages: Pictures of each stage, all of the same size; the last of each is shown for `END_S`.
        width_px: Width of the video; its height follows, both even.

    Returns:
        The number of pictures.

    Raises:
        InvalidArgumentError: There is no picture, or as `check_video`.
        StoreError: A library is not installed, or the file cannot be written.
    """
    check_video(path, fps, width_px)
    with replacing(path) as beside:
        return _write(_with_ends(stages), beside, fps, width_px)


def _with_ends(stages: Iterable[Iterable[Image.Image]]) -> Iterator[tuple[Image.Image, bool]]:
    """Yield pictures, and whether each is the last of its stage."""
    for stage in stages:
        pictures = iter(stage)
        last = next(pictures, None)
        for picture in pictures:
            assert last is not None
            yield last, False
            last = picture
        if last is not None:
            yield last, True


def _write(pictures: Iterator[tuple[Image.Image, bool]], path: Path, fps: float, width_px: int) -> int:
    first = next(pictures, None)
    if first is None:
        raise InvalidArgumentError("argument `stages` is empty, expected a picture or more")
    num = 0
    with _imageio().imopen(path, "w", plugin="pyav") as video:
        video.init_video_stream("libx264", fps=fps, pixel_format="yuv420p")
        for picture, is_end in itertools.chain([first], pictures):
            pixels = np.asarray(_resized(picture, width_px))
            for _ in range(max(1, round(END_S * fps)) if is_end else 1):
                video.write_frame(pixels)
            num += 1
    return num


def _resized(picture: Image.Image, width_px: int) -> Image.Image:
    height_px = 2 * round(picture.height * width_px / picture.width / 2)
    if picture.size == (width_px, height_px):
        return picture
    return picture.resize((width_px, height_px), Image.Resampling.LANCZOS)


def _imageio() -> Any:  # noqa: ANN401 - a module
    optional_module("av", "videos need imageio and PyAV", "'evonav[video]'")
    return optional_module("imageio.v3", "videos need imageio and PyAV", "'evonav[video]'")
