"""Images in prompts. An agent shows most of them again and again: each is cut out, named and encoded once."""

import base64
import hashlib
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.memory.views import Box, StoredView, jpeg_size, pixels_of, thumbnail

MARGIN_PX = 20
"""Margin around crops, as in 3D-Mem."""
MAX_PICTURES = 32
"""Largest number of pictures, and of crops, that a process keeps: a question has about ten."""


@dataclass(frozen=True, eq=False)
class Picture:
    """An image in a prompt."""

    source: NDArray[np.uint8] | bytes = field(repr=False)
    """`(H, W, 3)` RGB, or a JPEG file, which is not decoded before it is needed."""

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """`(H, W, 3)` RGB; `InvalidArgumentError` if the file is no JPEG."""
        return pixels_of(self.source) if isinstance(self.source, bytes) else self.source

    @cached_property
    def size_px(self) -> tuple[int, int]:
        """Width and height; `InvalidArgumentError` if the file is no JPEG."""
        if isinstance(self.source, bytes):
            return jpeg_size(self.source)
        height, width = self.source.shape[:2]
        return width, height

    @property
    def name(self) -> str:
        """Name of the image where a request is stored: `sha256:` and the hash of its shape and values.

        It is not the hash of its file, whose bytes depend on the compression.
        """
        return self._name_and_url[0]

    @property
    def data_url(self) -> str:
        """The whole image as PNG in a `data:` URL."""
        return self._name_and_url[1]

    @cached_property
    def _name_and_url(self) -> tuple[str, str]:
        """Both at once: a file is decoded once, and its pixels are not kept."""
        pixels = np.ascontiguousarray(self.pixels)
        height, width = pixels.shape[:2]
        values = f"{width}x{height} RGB\n".encode() + pixels.tobytes()
        png = base64.b64encode(_core.encode_png(pixels)).decode()
        return f"sha256:{hashlib.sha256(values).hexdigest()}", f"data:image/png;base64,{png}"


def picture_of(view: StoredView, size_px: int) -> Picture | None:
    """Return the image of a view, its longer edge at most `size_px`; `None` if the view had no colours."""
    return None if view.jpeg is None else _picture(view.jpeg, size_px)


def crop_of(view: StoredView, box_px: Box) -> Picture | None:
    """Return a part of a view with `MARGIN_PX` around it; `None` if the view had no colours."""
    return None if view.jpeg is None else _crop(view.jpeg, box_px)


@lru_cache(MAX_PICTURES)
def _picture(jpeg: bytes, size_px: int) -> Picture:
    whole = Picture(jpeg)
    return whole if max(whole.size_px) <= size_px else Picture(thumbnail(whole.pixels, size_px))


@lru_cache(MAX_PICTURES)
def _crop(jpeg: bytes, box_px: Box) -> Picture:
    left, top, right, bottom = box_px
    rows = slice(max(0, top - MARGIN_PX), bottom + MARGIN_PX)
    cols = slice(max(0, left - MARGIN_PX), right + MARGIN_PX)
    return Picture(np.ascontiguousarray(pixels_of(jpeg)[rows, cols]))
