"""Draw a view as it is and as it was perceived, side by side."""

import base64
from collections.abc import Sequence
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from evonav.perception_benchmark.matching import IGNORED, NONE, TrueObjects
from evonav.perception_benchmark.rows import Matched
from evonav.sensors.observation import Detections

RIGHT, MISLABELLED, ALONE = (64, 132, 255), (255, 150, 30), (235, 60, 200)
"""Blue: found with its label; orange: at its place with another label; magenta: missed, or nothing there."""
_PLAIN = (150, 150, 150)
_SHARE = 0.42
"""Share of the colour in a mask."""
_FONT_PX = 11
_LEAST_LABELLED_PX = 200
"""Masks of fewer pixels have no room for their label."""
GAP_PX = 6
QUALITY = 82


def side_by_side(rgb: NDArray[np.uint8], truth: TrueObjects, found: Detections, matched: Matched) -> str:
    """Draw the objects of a view, `(H, W, 3)`, on the left and its detections on the right, as JPEG in base64."""
    is_found = matched.found.detection_of[: truth.num_wanted] != NONE
    is_located = matched.located.detection_of[: truth.num_wanted] != NONE
    left = [RIGHT if a else MISLABELLED if b else ALONE for a, b in zip(is_found, is_located, strict=True)]
    wanted = np.where(truth.masks < truth.num_wanted, truth.masks, -1)
    right = [
        _PLAIN if IGNORED in (a, b) else RIGHT if a != NONE else MISLABELLED if b != NONE else ALONE
        for a, b in zip(matched.found.object_of.tolist(), matched.located.object_of.tolist(), strict=True)
    ]
    height, width = wanted.shape
    picture = Image.new("RGB", (2 * width + GAP_PX, height), "white")
    picture.paste(_drawn(rgb, wanted, truth.labels[: truth.num_wanted], left), (0, 0))
    picture.paste(_drawn(rgb, found.masks, found.labels, right), (width + GAP_PX, 0))
    data = BytesIO()
    picture.save(data, "JPEG", quality=QUALITY)
    return base64.b64encode(data.getvalue()).decode()


def _drawn(
    rgb: NDArray[np.uint8], masks: NDArray[np.int32], labels: Sequence[str], colours: Sequence[tuple[int, int, int]]
) -> Image.Image:
    pixels = rgb.astype(np.float64) * 0.75 + 40.0
    if labels:
        inside = masks >= 0
        table = np.array(colours, np.float64)
        pixels[inside] = (1.0 - _SHARE) * pixels[inside] + _SHARE * table[masks[inside]]
        edge = np.zeros(masks.shape, np.bool_)
        edge[:, 1:] |= masks[:, 1:] != masks[:, :-1]
        edge[1:, :] |= masks[1:, :] != masks[:-1, :]
        edge &= inside
        pixels[edge] = table[masks[edge]]
    image = Image.fromarray(np.clip(pixels, 0, 255).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(_FONT_PX)
    for i, label in enumerate(labels):
        rows, columns = np.nonzero(masks == i)
        if rows.size < _LEAST_LABELLED_PX:
            continue
        length = draw.textlength(label, font=font)
        x = min(max(1.0, float(np.median(columns)) - length / 2), masks.shape[1] - length - 1)
        y = min(max(1.0, float(np.median(rows)) - _FONT_PX / 2), masks.shape[0] - _FONT_PX - 2.0)
        draw.text((x, y), label, font=font, fill="white", stroke_width=1, stroke_fill="black")
    return image
