"""Make pictures that a notebook shows and a file keeps: houses, occupancy maps and object maps from above."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evonav._core import House
from evonav.drawing.files import write_picture
from evonav.drawing.floor_plan import PlanFrame, frame_of, ground, item_labels, labels
from evonav.drawing.layers import Box, boxes_layer, cells_layer, path_layer, points_layer, pose_layer
from evonav.drawing.plan import plan_of
from evonav.drawing.style import map_file
from evonav.drawing.svg import Point
from evonav.sensors.observation import MapFrame
from evonav.world.pose import Pose

WIDTH_PX, MAX_HEIGHT_PX = 900, 700
_RULES = (
    ".map .entry rect{fill:var(--t5);fill-opacity:.15;stroke:var(--t5)}"
    ".map .tag text{fill:var(--ink);stroke:var(--paper);stroke-opacity:.8;paint-order:stroke;text-anchor:middle}"
    ".map .frontier{fill:var(--orange);stroke:var(--paper)}"
    ".map .below{opacity:.35}"
)


class Picture:
    """A picture as SVG: notebooks show it, and `save` writes it."""

    def __init__(self, drawing: str, frame: PlanFrame, title: str) -> None:
        """Put a drawing on a page.

        Args:
            drawing: Elements of SVG.
            frame: The part of the plan that they fill.
            title: Read out by screen readers.
        """
        width = min(float(WIDTH_PX), MAX_HEIGHT_PX * frame.width / frame.height)
        self.size_px = (round(width), round(width * frame.height / frame.width))
        self._title = title
        page = f'<rect class="page" x="{frame.left}" y="{frame.top}" width="100%" height="100%"/>'
        self.svg = map_file(title, self.size_px, page + drawing, view_box=frame.view_box, more_css=_RULES)

    def save(self, path: str | Path) -> Path:
        """Write the picture.

        Args:
            path: A `.svg`, `.png` or `.pdf` file (the last two need the extra `viz`).

        Raises:
            InvalidArgumentError: The file's suffix is of no format.
            StoreError: The library for its format is not installed, or the file cannot be written.
        """
        return write_picture(self.svg, Path(path))

    def __repr__(self) -> str:
        """Return the title and the size, and how to keep the picture."""
        width, height = self.size_px
        return f"Picture({self._title!r}, {width} x {height} px; save('picture.svg') writes it)"

    def _repr_svg_(self) -> str:
        return self.svg

    def _repr_html_(self) -> str:
        return self.svg


def house_picture(
    house: House, *, path_m: Sequence[Point] = (), pose: Pose | None = None, fov_rad: float = math.pi / 2
) -> Picture:
    """Draw a house with the names of its rooms and furniture.

    Args:
        path_m: A path, `(x, z)` points.
        pose: Pose of an agent to draw.
        fov_rad: Horizontal field of view of the agent.
    """
    plan = plan_of(house)
    frame = frame_of([plan])
    drawing = ground(plan, frame) + item_labels(plan.objects, frame) + labels(plan, frame)
    if pose is not None:
        drawing += pose_layer((pose.x_m, pose.z_m), pose.yaw_rad, fov_rad, frame)
    return Picture(drawing + path_layer(path_m, frame), frame, house.name)


def boxes_picture(boxes: Iterable[Box], title: str, house: House | None = None) -> Picture:
    """Draw labelled boxes from above, over a house if it is given."""
    boxes = list(boxes)
    if house is None:
        frame = PlanFrame.around(
            (centre_m[0] + sign * size_m[0] / 2, centre_m[2] + sign * size_m[2] / 2)
            for _, centre_m, size_m in boxes
            for sign in (-1, 1)
        )
        return Picture(boxes_layer(boxes, frame), frame, title)
    plan = plan_of(house)
    frame = frame_of([plan])
    below = f'<g class="below">{ground(plan, frame)}</g>'
    return Picture(below + boxes_layer(boxes, frame), frame, title)


def cells_picture(
    cells: NDArray[np.uint8], map_frame: MapFrame, points: Iterable[tuple[str, Point]], title: str
) -> Picture:
    """Draw a map's cells (`cells_layer`) and named points over them."""
    x_m, z_m = map_frame.corner_m
    far_m = (x_m + map_frame.cols * map_frame.cell_m, z_m + map_frame.rows * map_frame.cell_m)
    frame = PlanFrame.around([(x_m, z_m), far_m])
    drawing = cells_layer(cells, map_frame.cell_m, (x_m, z_m)) + points_layer(points, frame)
    return Picture(drawing, frame, title)
