"""A house from above: floors, walls, openings, furniture, labels, as SVG groups that many pictures share."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from evonav.evaluation.records import ObjectFootprint, RoomFootprint, StageMap
from evonav.report.svg import Point, cm, escape, join, polyline, title
from evonav.tasks.language import noun_of

MARGIN_CM = 40
SMALL_M = 0.35
"""Footprints with no edge this long are drawn without outline."""
ROUND_CATEGORIES = frozenset(
    {
        "Basketball",
        "Bowl",
        "Candle",
        "Cup",
        "DeskLamp",
        "FloorLamp",
        "GarbageCan",
        "HousePlant",
        "Kettle",
        "Mug",
        "Pan",
        "Plate",
        "Pot",
        "Stool",
        "TeddyBear",
        "Toilet",
        "Vase",
    }
)
FLAT_CATEGORIES = frozenset(["Painting", "Window", "Doorway"])
"""On walls: drawn without a label."""
FLOORS = {"Kitchen": "kitchen", "LivingRoom": "living", "Bedroom": "bedroom", "Bathroom": "bathroom"}
LABEL_MIN_M2 = 0.25
"""Footprint from which on furniture is named on the map."""
ROOM_LETTERS = 3.0
"""Height of letters, in units of a frame."""
ITEM_LETTERS = 1.75


@dataclass(frozen=True, slots=True)
class Frame:
    """The part of the page that a map fills, in centimetres."""

    left: int
    top: int
    width: int
    height: int

    @property
    def unit(self) -> float:
        """One hundredth of a map's size: what markers and letters scale with, so that all maps look alike."""
        return max(4.0, max(self.width, self.height) / 100)

    @property
    def view_box(self) -> str:
        """For the `viewBox` attribute."""
        return f"{self.left} {self.top} {self.width} {self.height}"

    @staticmethod
    def around(points_m: Iterable[Point]) -> "Frame":
        """The frame that holds all points with a margin; 10 m wide if there are none."""
        points = [cm(point) for point in points_m] or [(-500, -500), (500, 500)]
        xs, ys = [x for x, _ in points], [y for _, y in points]
        left, top = min(xs) - MARGIN_CM, min(ys) - MARGIN_CM
        return Frame(left, top, max(xs) + MARGIN_CM - left, max(ys) + MARGIN_CM - top)


def frame_of(maps: Iterable[StageMap]) -> Frame:
    """The frame that all stages of a task share."""
    maps = list(maps)
    points: list[Point] = [point for m in maps for room in m.rooms for point in room.polygon_m]
    points += [point for m in maps for wall in m.walls for point in wall]
    return Frame.around(points)


def moving_ids(maps: Sequence[StageMap]) -> frozenset[str]:
    """Objects that do not stand in the same place in all of the stages."""
    places: dict[str, set[tuple[tuple[int, int], ...]]] = {}
    seen: dict[str, int] = {}
    for m in maps:
        for item in m.objects:
            places.setdefault(item.object_id, set()).add(tuple(cm(point) for point in item.polygon_m))
            seen[item.object_id] = seen.get(item.object_id, 0) + 1
    return frozenset(name for name, found in places.items() if len(found) > 1 or seen[name] != len(maps))


def ground(stage_map: StageMap, frame: Frame, without: frozenset[str] = frozenset()) -> str:
    """Floors, furniture, walls and openings; `without` names objects to leave out."""
    items = furniture([item for item in stage_map.objects if item.object_id not in without], frame)
    return floors(stage_map) + items + structure(stage_map, frame)


def floors(stage_map: StageMap) -> str:
    """Rooms, coloured by type."""
    return join(
        f'<path class="floor {FLOORS.get(room.room_type, "other")}" d="{outline(room.polygon_m)}"/>'
        for room in stage_map.rooms
    )


def structure(stage_map: StageMap, frame: Frame) -> str:
    """Walls, doors and windows."""
    u = frame.unit
    walls = join(f'<path d="{polyline([cm(a), cm(b)])}"/>' for a, b in _distinct(stage_map.walls))
    doors = [(o.from_m, o.to_m) for o in stage_map.openings if o.kind == "door"]
    windows = [(o.from_m, o.to_m) for o in stage_map.openings if o.kind == "window"]
    wall_cm = max(9.0, 1.1 * u)
    return (
        f'<g class="walls" stroke-width="{wall_cm:.0f}">{walls}</g>'
        f'<g class="doors" stroke-width="{wall_cm * 1.15:.0f}">{_lines(doors)}</g>'
        f'<g class="windows" stroke-width="{wall_cm * 0.45:.0f}">{_lines(windows)}</g>'
    )


def furniture(items: Iterable[ObjectFootprint], frame: Frame, css: str = "items") -> str:
    """Footprints, lower ones first, each with its category as tooltip."""
    ordered = sorted(items, key=lambda item: (item.centre_m[1] + item.size_m[1] / 2, item.object_id))
    return f'<g class="{css}" stroke-width="{max(1.0, 0.2 * frame.unit):.1f}">{join(map(_footprint, ordered))}</g>'


def labels(stage_map: StageMap, frame: Frame) -> str:
    """Names of rooms."""
    u = frame.unit
    rooms = join(_room_label(room, u) for room in stage_map.rooms)
    return f'<g class="rooms" font-size="{ROOM_LETTERS * u:.0f}" stroke-width="{0.9 * u:.1f}">{rooms}</g>'


def item_labels(items: Iterable[ObjectFootprint], frame: Frame) -> str:
    """Names of the furniture large enough to hold them."""
    size = ITEM_LETTERS * frame.unit
    named = join(_item_label(item, size) for item in items)
    return f'<g class="names" font-size="{size:.0f}">{named}</g>'


def label_point(polygon_m: Sequence[Point], num: int = 24) -> Point:
    """The point inside a polygon that is farthest from its edges, to about a `num`-th of its size."""
    corners = np.asarray(polygon_m, dtype=np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    steps = (np.arange(num) + 0.5) / num
    x, z = np.meshgrid(low[0] + steps * (high[0] - low[0]), low[1] + steps * (high[1] - low[1]))
    points = np.stack([x.ravel(), z.ravel()], axis=1)
    a, b = corners, np.roll(corners, -1, axis=0)
    edge = b - a
    length2 = np.maximum((edge**2).sum(axis=1), 1e-12)
    t = np.clip(((points[:, None] - a) * edge).sum(axis=2) / length2, 0.0, 1.0)
    gap_m = np.linalg.norm(points[:, None] - (a + t[..., None] * edge), axis=2).min(axis=1)
    crosses = (a[:, 1] > points[:, None, 1]) != (b[:, 1] > points[:, None, 1])
    slope = np.where(edge[:, 1] == 0.0, 1.0, edge[:, 1])
    at_x = a[:, 0] + (points[:, None, 1] - a[:, 1]) / slope * edge[:, 0]
    inside = (crosses & (points[:, None, 0] < at_x)).sum(axis=1) % 2 == 1
    # Among points that are about as good, the one nearest to the middle of the room looks right.
    middle_m = np.linalg.norm(points - corners.mean(axis=0), axis=1)
    best = int(np.argmax(np.where(inside, gap_m - 0.15 * middle_m, -np.inf)))
    return (float(points[best, 0]), float(points[best, 1]))


def _footprint(item: ObjectFootprint) -> str:
    css = "item flat" if item.category in FLAT_CATEGORIES else "item"
    if max(item.size_m[0], item.size_m[2]) < SMALL_M:
        css = "item small"
    hint = title(noun_of(item.category))
    if item.outlines_m:
        return _shape(item, css, hint)
    if item.category in ROUND_CATEGORIES:
        x, y = cm((item.centre_m[0], item.centre_m[2]))
        rx, ry = round(50 * item.size_m[0]), round(50 * item.size_m[2])
        return f'<ellipse class="{css}" cx="{x}" cy="{y}" rx="{rx}" ry="{ry}">{hint}</ellipse>'
    return f'<path class="{css}" d="{outline(item.polygon_m)}">{hint}</path>'


def _shape(item: ObjectFootprint, css: str, hint: str) -> str:
    """All parts as one outline, and in what is large the parts themselves, higher ones over lower ones."""
    parts = [outline(part) for part in item.outlines_m]
    # The fill hides the inner half of every stroke (`paint-order`): what is left is the outline of the union.
    union = f'<path class="{css}" d="{join(parts)}">{hint}</path>'
    if css != "item" or len(parts) == 1:
        return union
    return union + join(f'<path class="part" d="{part}"/>' for part in dict.fromkeys(parts))


def _room_label(room: RoomFootprint, unit: float) -> str:
    if len(room.polygon_m) < 3:
        return ""
    x, y = cm(label_point(room.polygon_m))
    name = noun_of(room.room_type)
    return f'<text x="{x}" y="{y + 0.9 * unit:.0f}">{escape(name)}</text>'


def _item_label(item: ObjectFootprint, font_cm: float) -> str:
    if item.size_m[0] * item.size_m[2] < LABEL_MIN_M2 or item.category in FLAT_CATEGORIES:
        return ""
    name = noun_of(item.category)
    x, y = cm((item.centre_m[0], item.centre_m[2]))
    need_cm = 0.56 * font_cm * len(name)
    width_cm, depth_cm = 100 * item.size_m[0], 100 * item.size_m[2]
    if need_cm <= width_cm and 1.1 * font_cm <= depth_cm:
        return f'<text x="{x}" y="{y + 0.35 * font_cm:.0f}">{escape(name)}</text>'
    if need_cm <= depth_cm and 1.1 * font_cm <= width_cm:
        return f'<text transform="translate({x + 0.35 * font_cm:.0f} {y})rotate(-90)">{escape(name)}</text>'
    return ""


def outline(polygon_m: Sequence[Point]) -> str:
    """Path data of a closed polygon."""
    return polyline([cm(point) for point in polygon_m], closed=True)


def _lines(segments: Iterable[tuple[Point, Point]]) -> str:
    return join(f'<path d="{polyline([cm(a), cm(b)])}"/>' for a, b in segments)


def _distinct(walls: Iterable[tuple[Point, Point]]) -> list[tuple[Point, Point]]:
    """ProcTHOR has a wall once a side: both lie on the same line."""
    found: dict[tuple[tuple[int, int], ...], tuple[Point, Point]] = {}
    for a, b in walls:
        found.setdefault(tuple(sorted((cm(a), cm(b)))), (a, b))
    return list(found.values())


def distance_m(a: Sequence[float], b: Sequence[float]) -> float:
    """Ground-plane distance of two `(x, y, z)` points."""
    return math.hypot(a[0] - b[0], a[2] - b[2])
