"""Read and write depth, masks and colours as image files."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from evonav.errors import StoreError

_LARGEST = 65535


def write_depth(path: Path, depth_m: NDArray[np.float32], scale: float) -> None:
    """Write depth as a 16-bit PNG: metres times `scale`; 0 where nothing is, or too far for 16 bits."""
    scaled = np.where(np.isfinite(depth_m), np.rint(depth_m.astype(np.float64) * scale), 0.0)
    _write_16_bits(path, np.where(scaled > _LARGEST, 0.0, scaled).astype(np.uint16))


def read_depth(path: Path, scale: float) -> NDArray[np.float32]:
    """Return what `write_depth` wrote, in metres; `inf` where the file has 0.

    Raises:
        StoreError: The file cannot be read, or is no image of one channel.
    """
    values = _read(path)
    if values.ndim != 2:
        raise StoreError(f"{path}: a depth image of {values.shape[-1]} channels, expected 1")
    metres = values.astype(np.float64) / scale
    return np.where(metres == 0.0, np.inf, metres).astype(np.float32)


def write_masks(path: Path, masks: NDArray[np.int32]) -> None:
    """Write the masks of detections as a 16-bit PNG: 0 where none is, else the detection's index plus one."""
    _write_16_bits(path, (masks + 1).astype(np.uint16))


def read_masks(path: Path) -> NDArray[np.int32]:
    """Return what `write_masks` wrote: -1 where no detection is.

    Raises:
        StoreError: The file cannot be read.
    """
    return np.ascontiguousarray(_read(path).astype(np.int32) - 1)


def write_rgb(path: Path, rgb: NDArray[np.uint8]) -> None:
    """Write colours; the suffix tells the format."""
    Image.fromarray(rgb).save(path, quality=95)


def read_rgb(path: Path) -> NDArray[np.uint8]:
    """Return the colours of an image file, `(H, W, 3)`.

    Raises:
        StoreError: The file cannot be read.
    """
    return np.ascontiguousarray(_read(path, "RGB").astype(np.uint8))


def _write_16_bits(path: Path, values: NDArray[np.uint16]) -> None:
    Image.fromarray(values).save(path, compress_level=1)


def _read(path: Path, mode: str | None = None) -> NDArray[np.generic]:
    try:
        with Image.open(path) as image:
            return np.asarray(image if mode is None else image.convert(mode))
    except (OSError, UnidentifiedImageError) as error:
        raise StoreError(f"{path}: cannot be read as an image: {error}") from error
