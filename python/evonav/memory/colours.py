"""Name the colours of what an agent saw: the share of each of the describer's words in a detection's pixels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError
from evonav.sensors.observation import View
from evonav.tasks.colours import colour_word
from evonav.tasks.language import COLOURS

LIGHT_GAIN = 1.3
"""White paper in the light of a home shows about 196 of 255; pixels are brightened by this before they are named."""
SOFTNESS = 4.0
"""Standard deviation, in CIELAB, of the names of neighbouring colours that a colour takes part in."""
LIGHTNESS_WEIGHT = 0.5
"""Weight of lightness in that distance: light and shade change it more than the hue."""
STRIDE_PX = 2
"""Every second pixel of every second row is read."""

NEAR = 1 / 12
"""Standard deviation of the weights of pixels by a place, as a share of the image's height."""

_LEVELS = 16
"""Levels of a channel in the table of names."""

Shares = NDArray[np.float32]


def colour_shares(view: View) -> Shares:
    """Return the share of each colour word in each detection of a view.

    Returns:
        `(N, len(COLOURS))`; rows add up to 1, or to 0 for a detection without pixels.

    Raises:
        InvalidArgumentError: The view has no colours.
    """
    if view.rgb is None:
        raise InvalidArgumentError("view.rgb is None: ask for colours with `SensorConfig(needs_rgb=True)`")
    num = len(view.detections.labels)
    masks = view.detections.masks[::STRIDE_PX, ::STRIDE_PX]
    is_seen = masks >= 0
    cells = _cells(view.rgb[::STRIDE_PX, ::STRIDE_PX][is_seen])
    counts = np.bincount(masks[is_seen] * _LEVELS**3 + cells, minlength=num * _LEVELS**3)
    shares = counts.reshape(num, _LEVELS**3).astype(np.float32) @ _names()
    total = shares.sum(axis=1, keepdims=True)
    named: Shares = shares / np.maximum(total, np.float32(1.0))
    return named


@dataclass(frozen=True, slots=True)
class Layout:
    """The colours around a place in an image: what is there, and what surrounds it."""

    near: tuple[float, ...]
    """Share of each colour word by the place, pixels weighted by a Gaussian of `NEAR` of the image's height."""
    whole: tuple[float, ...]
    """Share of each colour word in the whole image."""


def layouts(rgb: NDArray[np.uint8], places_px: Sequence[tuple[float, float]]) -> list[Layout]:
    """Return the layout of an image around each of some places.

    Args:
        rgb: `(H, W, 3)` image.
        places_px: Column and row of each place.
    """
    if not places_px:
        return []
    named = _names()[_cells(rgb[::STRIDE_PX, ::STRIDE_PX])]
    rows, cols = named.shape[:2]
    whole = tuple(named.mean(axis=(0, 1), dtype=np.float64).tolist())
    spread_px = NEAR * rgb.shape[0]
    cols_px, rows_px = np.array(places_px, np.float64).T[:, :, None]
    by_row = np.exp(-0.5 * ((np.arange(rows) * STRIDE_PX - rows_px) / spread_px) ** 2)
    by_col = np.exp(-0.5 * ((np.arange(cols) * STRIDE_PX - cols_px) / spread_px) ** 2)
    of_rows = (by_row @ named.reshape(rows, -1)).reshape(len(places_px), cols, len(COLOURS))
    near = np.einsum("nx,nxc->nc", by_col, of_rows) / (by_row.sum(axis=1) * by_col.sum(axis=1))[:, None]
    return [Layout(tuple(row), whole) for row in near.tolist()]


def distance(one: Sequence[float], other: Sequence[float]) -> float:
    """Return Hellinger's distance of two lists of shares: 0 for equal ones, 1 for those that share no colour."""
    overlap = math.fsum(math.sqrt(a * b) for a, b in zip(one, other, strict=True))
    return math.sqrt(max(0.0, 1.0 - overlap))


def _cells(rgb: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the row of `_names` of each of `(..., 3)` pixels, brightened."""
    bright = np.minimum(rgb * np.float32(LIGHT_GAIN), 255.0)
    levels = bright.astype(np.int64) * _LEVELS // 256
    cells: NDArray[np.int64] = (levels[..., 0] * _LEVELS + levels[..., 1]) * _LEVELS + levels[..., 2]
    return cells


@cache
def _names() -> Shares:
    """Return the share of each word at each colour of the table: the names of all colours, the nearer the more."""
    levels = (np.arange(_LEVELS) * 256 + 128) // _LEVELS
    colours = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), axis=-1).reshape(-1, 3)
    names = np.zeros((len(colours), len(COLOURS)), dtype=np.float32)
    names[np.arange(len(colours)), [COLOURS.index(colour_word((r, g, b))) for r, g, b in colours.tolist()]] = 1.0
    lab = (_cielab(colours) * (LIGHTNESS_WEIGHT, 1.0, 1.0)).astype(np.float32)
    square = (lab * lab).sum(axis=1)
    soft = np.empty_like(names)
    for start in range(0, len(lab), 512):
        part = slice(start, start + 512)
        apart = square[part, None] + square[None] - 2.0 * lab[part] @ lab.T
        soft[part] = np.exp(apart / np.float32(-2.0 * SOFTNESS**2)) @ names
    named: Shares = soft / soft.sum(axis=1, keepdims=True)
    named.setflags(write=False)
    return named


def _cielab(colours: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return sRGB colours, `(N, 3)` of 0 to 255, in CIELAB under D65."""
    srgb = colours / 255.0
    linear = np.where(srgb > 0.04045, ((srgb + 0.055) / 1.055) ** 2.4, srgb / 12.92)
    to_xyz = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    )
    xyz = linear @ to_xyz.T / (0.95047, 1.0, 1.08883)
    x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0).T
    return np.stack((116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)), axis=-1)
