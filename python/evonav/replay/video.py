"""Videos of episodes: mp4 (extra `video`), gif and webp (Pillow alone)."""

import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from PIL import Image

from evonav.errors import InvalidArgumentError, StoreError

SUFFIXES = (".mp4", ".gif", ".webp")
MAX_ANIMATION_FRAMES = 400
"""Of gif and webp, which are held in memory."""
MIN_WIDTH_PX = 320
HOLD_S = 2.0
"""How long the end of a stage is shown."""


def check_video(path: Path, fps: float, width_px: int) -> None:
    """Whether a video could be written there, before the work is done.

    Raises:
        InvalidArgumentError: The file's suffix is of no format, or a number is out of range.
        StoreError: A library is not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InvalidArgumentError(f"argument `path` is {str(path)!r}, expected a file {', '.join(SUFFIXES)}")
    if not 0.1 <= fps <= 60:
        raise InvalidArgumentError(f"argument `fps` is {fps}, expected 0.1 to 60 rounds a second")
    if width_px < MIN_WIDTH_PX or width_px % 2:
        raise InvalidArgumentError(f"argument `width_px` is {width_px}, expected an even number from {MIN_WIDTH_PX}")
    if path.suffix.lower() == ".mp4":
        _imageio()


def write_video(stages: Iterable[Iterable[Image.Image]], path: Path, *, fps: float = 2.0, width_px: int = 1280) -> int:
    """Writes a video.

    Args:
        stages: Pictures of each stage, all of the same size; the last of each is held for `HOLD_S`.
        path: `.mp4`, `.gif` or `.webp` file.
        fps: Pictures a second.
        width_px: Of the video; its height follows, both even.

    Returns:
        The number of pictures.

    Raises:
        InvalidArgumentError: As `check_video`; there is no picture; or a gif or webp would have more than
            `MAX_ANIMATION_FRAMES`.
        StoreError: A library is not installed, or the file cannot be written.
    """
    check_video(path, fps, width_px)
    pictures = _held(stages, width_px)
    part = path.with_name(f".{path.stem}.part{path.suffix.lower()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            num = _write_mp4(pictures, part, fps) if part.suffix == ".mp4" else _write_animation(pictures, part, fps)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise StoreError(f"{path}: {error}") from error
    return num


def _held(stages: Iterable[Iterable[Image.Image]], width_px: int) -> Iterator[tuple[Image.Image, bool]]:
    """Pictures in their size, and whether one is held."""
    for stage in stages:
        pictures = iter(stage)
        last = next(pictures, None)
        for picture in pictures:
            assert last is not None
            yield _resized(last, width_px), False
            last = picture
        if last is not None:
            yield _resized(last, width_px), True


def _resized(picture: Image.Image, width_px: int) -> Image.Image:
    height_px = 2 * round(picture.height * width_px / picture.width / 2)
    if picture.size == (width_px, height_px):
        return picture
    return picture.resize((width_px, height_px), Image.Resampling.LANCZOS)


def _write_mp4(pictures: Iterator[tuple[Image.Image, bool]], path: Path, fps: float) -> int:
    import numpy as np

    first = _first(pictures)
    num = 0
    with _imageio().imopen(path, "w", plugin="pyav") as video:
        video.init_video_stream("libx264", fps=fps, pixel_format="yuv420p")
        for picture, is_held in itertools.chain([first], pictures):
            pixels = np.asarray(picture)
            for _ in range(max(1, round(HOLD_S * fps)) if is_held else 1):
                video.write_frame(pixels)
            num += 1
    return num


def _write_animation(pictures: Iterator[tuple[Image.Image, bool]], path: Path, fps: float) -> int:
    is_gif = path.suffix == ".gif"
    frames: list[Image.Image] = []
    durations_ms: list[int] = []
    for picture, is_held in itertools.chain([_first(pictures)], pictures):
        if len(frames) == MAX_ANIMATION_FRAMES:
            raise InvalidArgumentError(
                f"argument `path` is {str(path.name)!r}: more than {MAX_ANIMATION_FRAMES} pictures; name fewer stages, "
                "or an .mp4 file"
            )
        frames.append(picture.quantize(128, dither=Image.Dither.NONE) if is_gif else picture)
        durations_ms.append(round(1000 * max(1 / fps, HOLD_S if is_held else 0)))
    options: dict[str, Any] = {} if is_gif else {"quality": 80, "method": 4}
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=durations_ms, loop=0, **options)
    return len(frames)


def _first(pictures: Iterator[tuple[Image.Image, bool]]) -> tuple[Image.Image, bool]:
    first = next(pictures, None)
    if first is None:
        raise InvalidArgumentError("argument `stages` is empty, expected a picture or more")
    return first


def _imageio() -> Any:  # noqa: ANN401 - imageio is not there for the type checker
    try:
        import av  # noqa: F401
        import imageio.v3
    except ImportError as error:
        raise StoreError(f"mp4 videos need imageio and PyAV ({error}): pip install 'evonav[video]'") from error
    return imageio.v3
