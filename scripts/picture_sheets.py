"""Draws sheets of pictures for `measure_pictures.py`."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from picture_views import PictureView
from PIL import Image, ImageDraw

FOUND, MISSED = (60, 190, 90), (225, 70, 50)
GAP_PX = 6


def contact_sheet(views: Sequence[PictureView], found: Sequence[Sequence[float]] | None = None) -> Image.Image:
    """Return views in rows.

    Args:
        views: What is shown.
        found: With which confidence the detector found each object of each view, 0 for those that it missed: if given,
            boxes around the objects say so, in green and in red.
    """
    pictures = [Image.fromarray(view.rgb) for view in views]
    for picture, view, results in zip(pictures, views, found or (), strict=False):
        drawing = ImageDraw.Draw(picture)
        for truth, confidence in zip(view.truths, results, strict=True):
            left, top, right, bottom = truth.box_px
            colour = FOUND if confidence > 0.0 else MISSED
            drawing.rectangle((left, top, right - 1, bottom - 1), outline=colour, width=2)
            drawing.text((left + 4, top + 2), f"{truth.type} {confidence:.2f}", fill=colour)
    return grid(pictures, max(1, math.ceil(math.sqrt(1.5 * len(pictures)))))


def paired_sheet(recorded: Sequence[NDArray[np.uint8]], ours: Sequence[NDArray[np.uint8]]) -> Image.Image:
    """Return recorded frames, each with one of ours on its right, two pairs in a row.

    Args:
        recorded: Recorded frames; those that are shown are spread over all of them.
        ours: Our pictures, all of which are shown, while there are recorded ones.
    """
    side_px = ours[0].shape[0]
    chosen = np.linspace(0, len(recorded) - 1, min(len(ours), len(recorded))).astype(int).tolist()
    pictures = []
    for index, picture in zip(chosen, ours, strict=False):
        theirs = Image.fromarray(recorded[index]).resize((side_px, side_px), Image.Resampling.BOX)
        pictures += [theirs, Image.fromarray(picture)]
    return grid(pictures, 4)


def grid(pictures: Sequence[Image.Image], num_cols: int) -> Image.Image:
    """Return pictures of one size in rows."""
    width, height = pictures[0].width + GAP_PX, pictures[0].height + GAP_PX
    num_rows = math.ceil(len(pictures) / num_cols)
    sheet = Image.new("RGB", (num_cols * width + GAP_PX, num_rows * height + GAP_PX), "white")
    for index, picture in enumerate(pictures):
        sheet.paste(picture, (GAP_PX + index % num_cols * width, GAP_PX + index // num_cols * height))
    return sheet
