"""Draw a stage from above for `render`: the house, the target, and the agent with the path that it has taken.

The house is rendered once a stage. A frame adds the new part of the path and the agent, at their places alone.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from evonav._core import House
from evonav.drawing.floor_plan import PlanFrame, frame_of
from evonav.drawing.plan import HousePlan, plan_of
from evonav.gym.config import NavConfig
from evonav.gym.worlds import StageWorld
from evonav.points import Point2
from evonav.world.camera import CameraView
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]

PAPER: Colour = (255, 255, 255)
OUTSIDE: Colour = (236, 238, 242)
INK: Colour = (31, 37, 48)
WALL: Colour = (59, 66, 82)
DOOR: Colour = (253, 253, 252)
WINDOW: Colour = (124, 192, 245)
GOLD: Colour = (255, 201, 25)
RING: Colour = (181, 137, 0)
BLUE: Colour = (47, 127, 220)
"""Colours of `evonav/drawing/map.css` on a light page."""

SUPERSAMPLING = 2
"""Number of pixels, along each axis, that are averaged into one pixel of the house."""
CAMERA_HEIGHT_M = 50.0
"""Height above the ground from which the house is rendered. Ceilings are not seen from above."""
WALL_PX, RING_PX, STAR_PX = 3.0, 1.5, 9.0
PATH_PX, AGENT_PX, AGENT_EDGE_PX, SIGHT_PX = 3.0, 5.5, 1.5, 44.0
"""Widths of lines, radii of the star and the agent, and reach of the sector, in a picture of 400 pixels."""
SIGHT_OPACITY = 0.6


@dataclass(frozen=True, slots=True)
class _Scale:
    """The pixels of a picture from above, x to the right and z up."""

    side_px: int
    centre_m: Point2
    half_m: float
    """Half of the side in metres."""

    @classmethod
    def of(cls, frame: PlanFrame, side_px: int) -> "_Scale":
        centre_m = ((frame.left + frame.width / 2) / 100, -(frame.top + frame.height / 2) / 100)
        return cls(side_px, centre_m, max(frame.width, frame.height) / 200)

    @property
    def unit(self) -> float:
        """Factor of the sizes above."""
        return self.side_px / 400

    @property
    def px_per_m(self) -> float:
        return self.side_px / (2 * self.half_m)

    def pixel(self, point_m: Point2) -> Point2:
        """Return the place of a point: column and row, where the first pixel reaches from 0 to 1."""
        half_px = self.side_px / 2
        x_m, z_m = (value - centre for value, centre in zip(point_m, self.centre_m, strict=True))
        return (half_px + x_m * self.px_per_m, half_px - z_m * self.px_per_m)


class MapView:
    """A stage from above, and the agent's path in it. The target is oracle data, which only pictures may show."""

    def __init__(self, config: NavConfig, at: StageWorld, start: Pose) -> None:
        """Begin a path; nothing is drawn yet.

        Args:
            config: Settings of the environment.
        """
        self._config, self._at = config, at
        self._path_m: list[Point2] = [(start.x_m, start.z_m)]
        self._drawn: tuple[_Scale, Picture] | None = None
        """The house with the path so far, and its scale."""
        self._num_drawn = 1
        """Number of points of the path that are in the picture."""

    def walk(self, points_m: Iterable[Point2]) -> None:
        """Extend the path by `(x, z)` points."""
        for point_m in points_m:
            if point_m != self._path_m[-1]:
                self._path_m.append(point_m)

    def draw(self, pose: Pose) -> Picture:
        """Return the picture with the agent at `pose`, `(S, S, 3)` uint8."""
        if self._drawn is None:
            self._drawn = _stage_picture(self._at, self._config)
        scale, ground = self._drawn
        new = [scale.pixel(point_m) for point_m in self._path_m[self._num_drawn - 1 :]]
        for a, b in pairwise(new):
            _paint_line(ground, a, b, PATH_PX * scale.unit, BLUE)
        self._num_drawn = len(self._path_m)
        picture = ground.copy()
        here = scale.pixel((pose.x_m, pose.z_m))
        _paint_sector(picture, here, pose.yaw_rad, math.radians(self._config.hfov_deg), SIGHT_PX * scale.unit)
        _paint_line(picture, here, here, 2 * (AGENT_PX + AGENT_EDGE_PX) * scale.unit, PAPER)
        _paint_line(picture, here, here, 2 * AGENT_PX * scale.unit, BLUE)
        return picture


def _stage_picture(at: StageWorld, config: NavConfig) -> tuple[_Scale, Picture]:
    """Draw the house and the target; return the scale, too."""
    plan = plan_of(House(at.task.house_json(at.stage), name=at.task.task_id))
    large = _Scale.of(frame_of([plan]), config.map_px * SUPERSAMPLING)
    image = Image.fromarray(_rendered(at.world.simulator, large))
    pen = ImageDraw.Draw(image, "RGBA")
    _draw_structure(pen, plan, large)
    _draw_target(pen, at.target_m, config.success_radius_m, large)
    scale = _Scale(config.map_px, large.centre_m, large.half_m)
    return scale, np.array(image.reduce(SUPERSAMPLING))


def _rendered(simulator: EmbeddedSimulator, scale: _Scale) -> Picture:
    """Render floors and furniture from straight above."""
    x_m, z_m = scale.centre_m
    view = CameraView(
        Pose(x_m, CAMERA_HEIGHT_M, z_m, 0.0, math.pi / 2),
        scale.side_px,
        scale.side_px,
        far_m=2 * CAMERA_HEIGHT_M,
        orthographic_half_height_m=scale.half_m,
    )
    images = simulator.render_camera(view, instances=False)
    assert images.rgb is not None  # requested
    images.rgb[np.isinf(images.depth_m)] = OUTSIDE
    return images.rgb


def _draw_structure(pen: ImageDraw.ImageDraw, plan: HousePlan, scale: _Scale) -> None:
    """Draw walls, doors and windows, which are thinner than a pixel in the rendering."""
    width = WALL_PX * scale.unit
    lines = [(*wall, WALL, width) for wall in plan.walls]
    lines += [
        (
            hole.from_m,
            hole.to_m,
            DOOR if hole.kind == "door" else WINDOW,
            width * (1.15 if hole.kind == "door" else 0.5),
        )
        for hole in plan.openings
    ]
    for from_m, to_m, colour, width_px in lines:
        pen.line((scale.pixel(from_m), scale.pixel(to_m)), colour, round(width_px))
    for wall in plan.walls:
        for x, y in map(scale.pixel, wall):
            pen.rectangle((x - width / 2, y - width / 2, x + width / 2, y + width / 2), WALL)


def _draw_target(pen: ImageDraw.ImageDraw, target_m: Point2, radius_m: float, scale: _Scale) -> None:
    """Draw a star at the target, in a ring with the success radius."""
    x, y = scale.pixel(target_m)
    reach = radius_m * scale.px_per_m
    box = (x - reach, y - reach, x + reach, y + reach)
    pen.ellipse(box, (*GOLD, 40), RING, round(RING_PX * scale.unit))
    for radius, colour in ((STAR_PX + 1.5, INK), (STAR_PX, GOLD)):
        size = radius * scale.unit
        turns = [(k, math.radians(36 * k), size if k % 2 == 0 else 0.45 * size) for k in range(10)]
        pen.polygon([(x + r * math.sin(turn), y - r * math.cos(turn)) for _, turn, r in turns], colour)


def _paint_line(picture: Picture, a: Point2, b: Point2, width: float, colour: Colour) -> None:
    """Paint a straight line with round ends, or a disc where both ends are the same."""
    rows, cols, x, y = _patch(picture, (a, b), width / 2 + 1)
    along_x, along_y = b[0] - a[0], b[1] - a[1]
    squared = along_x * along_x + along_y * along_y
    share = np.clip(((x - a[0]) * along_x + (y - a[1]) * along_y) / (squared or 1.0), 0.0, 1.0)
    inside = width / 2 - np.hypot(x - a[0] - share * along_x, y - a[1] - share * along_y)
    _blend(picture[rows, cols], np.clip(inside + 0.5, 0.0, 1.0), colour)


def _paint_sector(picture: Picture, at: Point2, yaw_rad: float, fov_rad: float, reach: float) -> None:
    """Paint the sector in which the camera looks, fainter towards its end."""
    rows, cols, x, y = _patch(picture, (at,), reach + 1)
    right, ahead = x - at[0], at[1] - y
    across = right * math.cos(yaw_rad) - ahead * math.sin(yaw_rad)
    forward = right * math.sin(yaw_rad) + ahead * math.cos(yaw_rad)
    distance = np.hypot(right, ahead)
    within = forward * math.sin(fov_rad / 2) - np.abs(across) * math.cos(fov_rad / 2)
    inside = np.minimum(within, reach - distance)
    opacity = SIGHT_OPACITY * (1.0 - 0.7 * np.minimum(distance / reach, 1.0))
    _blend(picture[rows, cols], np.clip(inside + 0.5, 0.0, 1.0) * opacity, GOLD)


_Grid = NDArray[np.float64]


def _patch(picture: Picture, points: tuple[Point2, ...], margin: float) -> tuple[slice, slice, _Grid, _Grid]:
    """Return the part of a picture around points, and the centres of its columns and rows."""
    spans = []
    for axis, num in ((1, picture.shape[0]), (0, picture.shape[1])):
        values = [point[axis] for point in points]
        low, high = math.floor(min(values) - margin), math.ceil(max(values) + margin)
        spans.append(slice(min(num, max(0, low)), min(num, max(0, high))))
    rows, cols = spans
    return rows, cols, np.arange(cols.start, cols.stop)[None, :] + 0.5, np.arange(rows.start, rows.stop)[:, None] + 0.5


def _blend(part: Picture, opacity: _Grid, colour: Colour) -> None:
    part[:] = np.rint(part + opacity[..., None] * (np.array(colour, np.float64) - part))
