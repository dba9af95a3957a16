"""Draw a house from above: floors, walls, openings, furniture, labels, as SVG groups that many pictures share."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from evonav import _core
from evonav.drawing.plan import HousePlan, ObjectFootprint, RoomFootprint
from evonav.drawing.svg import Point, cm, escape, join, polyline, title
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
"""Categories of what hangs on walls: drawn without a label."""
FLOORS = {"Kitchen": "kitchen", "LivingRoom": "living", "Bedroom": "bedroom", "Bathroom": "bathroom"}
LABEL_MIN_M2 = 0.25
"""Footprint from which on furniture is named on the map."""
ROOM_LETTERS = 3.0
"""Height of letters, in units of a frame."""
ITEM_LETTERS = 1.75


Box = tuple[float, float, float, float]
"""Smallest and largest coordinates: left, low, right, high."""


@dataclass(frozen=True, slots=True)
class PlanFrame:
    """The part of the page that a map fills, in centimetres."""

    left: int
    top: int
    width: int
    height: int
    marker_scale: float = 1.0
    """Size of markers, lines and letters: below 1 for maps that are shown large."""

    @property
    def unit(self) -> float:
        """One hundredth of a map's size: what markers and letters scale with, so that all maps look alike."""
        return self.marker_scale * max(4.0, max(self.width, self.height) / 100)

    @property
    def view_box(self) -> str:
        """The value of the `viewBox` attribute."""
        return f"{self.left} {self.top} {self.width} {self.height}"

    @staticmethod
    def around(points_m: Iterable[Point]) -> "PlanFrame":
        """Return the frame that holds all points with a margin; 10 m wide if there are none."""
        points = [cm(point) for point in points_m] or [(-500, -500), (500, 500)]
        xs, ys = [x for x, _ in points], [y for _, y in points]
        left, top = min(xs) - MARGIN_CM, min(ys) - MARGIN_CM
        return PlanFrame(left, top, max(xs) + MARGIN_CM - left, max(ys) + MARGIN_CM - top)


def frame_of(maps: Iterable[HousePlan]) -> PlanFrame:
    """Return the frame that all stages of a task share."""
    maps = list(maps)
    points: list[Point] = [point for m in maps for room in m.rooms for point in room.polygon_m]
    points += [point for m in maps for wall in m.walls for point in wall]
    return PlanFrame.around(points)


def moving_ids(maps: Sequence[HousePlan]) -> frozenset[str]:
    """Return the ids of objects that do not stand in the same place in all of the stages."""
    first: dict[str, Sequence[Point]] = {}
    seen: Counter[str] = Counter()
    moved = set()
    for m in maps:
        for item in m.objects:
            seen[item.object_id] += 1
            polygon_m = first.setdefault(item.object_id, item.polygon_m)
            # Most objects stay to the bit: only others are compared by centimetres.
            if (
                polygon_m is not item.polygon_m
                and polygon_m != item.polygon_m
                and outline(polygon_m) != outline(item.polygon_m)
            ):
                moved.add(item.object_id)
    return frozenset(name for name, num in seen.items() if name in moved or num != len(maps))


def ground(floor_plan: HousePlan, frame: PlanFrame, without: frozenset[str] = frozenset()) -> str:
    """Draw floors, furniture, walls and openings; `without` names objects to leave out."""
    items = furniture([item for item in floor_plan.objects if item.object_id not in without], frame)
    return floors(floor_plan) + items + structure(floor_plan, frame)


def floors(floor_plan: HousePlan) -> str:
    """Draw rooms, coloured by type."""
    return join(
        f'<path class="floor {FLOORS.get(room.room_type, "other")}" d="{outline(room.polygon_m)}"/>'
        for room in floor_plan.rooms
    )


def structure(floor_plan: HousePlan, frame: PlanFrame) -> str:
    """Draw walls, doors and windows."""
    u = frame.unit
    doors = [(o.from_m, o.to_m) for o in floor_plan.openings if o.kind == "door"]
    windows = [(o.from_m, o.to_m) for o in floor_plan.openings if o.kind == "window"]
    wall_cm = max(9.0, 1.1 * u)
    return (
        f'<g class="walls" stroke-width="{wall_cm:.0f}">{_lines(_distinct(floor_plan.walls))}</g>'
        f'<g class="doors" stroke-width="{wall_cm * 1.15:.0f}">{_lines(doors)}</g>'
        f'<g class="windows" stroke-width="{wall_cm * 0.45:.0f}">{_lines(windows)}</g>'
    )


def furniture(items: Iterable[ObjectFootprint], frame: PlanFrame, css: str = "items", *, has_parts: bool = True) -> str:
    """Draw footprints, lower ones first, each with its category as tooltip; `has_parts` draws large ones in detail."""
    ordered = sorted(items, key=lambda item: (item.centre_m[1] + item.size_m[1] / 2, item.object_id))
    drawn = join(_footprint(item, has_parts=has_parts) for item in ordered)
    return f'<g class="{css}" stroke-width="{max(1.0, 0.2 * frame.unit):.1f}">{drawn}</g>'


def labels(floor_plan: HousePlan, frame: PlanFrame) -> str:
    """Write the names of rooms where there is least furniture."""
    u = frame.unit
    taken = [_box(item) for item in floor_plan.objects if item.category not in FLAT_CATEGORIES]
    rooms = join(_room_label(room, u, taken) for room in floor_plan.rooms)
    return f'<g class="rooms" font-size="{ROOM_LETTERS * u:.0f}" stroke-width="{0.9 * u:.1f}">{rooms}</g>'


def item_labels(
    items: Iterable[ObjectFootprint], frame: PlanFrame, min_m2: float = LABEL_MIN_M2, letters: float = ITEM_LETTERS
) -> str:
    """Write the names of the furniture that is large enough to hold them, none over another.

    Furniture with a footprint below `min_m2` has no name. `letters` is the height of names, in units of the frame.
    """
    size = letters * frame.unit
    placed: list[Box] = []
    named = []
    for item in sorted(items, key=lambda item: (-item.size_m[0] * item.size_m[2], item.object_id)):
        if item.size_m[0] * item.size_m[2] < min_m2 or item.category in FLAT_CATEGORIES:
            continue
        if (label := _item_label(item, size)) is not None and not any(_meet(label[0], other) for other in placed):
            placed.append(label[0])
            named.append(label[1])
    return f'<g class="names" font-size="{size:.0f}">{join(named)}</g>'


def label_point(
    polygon_m: Sequence[Point], num: int = 24, *, taken_m: Sequence[Box] = (), size_m: Point = (0.0, 0.0)
) -> Point:
    """Return where in a polygon a label stands best: over little, and far from the edges.

    The place is right to about a `num`-th of the polygon's size.

    Args:
        num: Places tried, along each axis.
        taken_m: Boxes that it should not cover.
        size_m: Width and height of the label.
    """
    return _core.label_point(polygon_m, num, taken_m=taken_m, size_m=size_m)


def _footprint(item: ObjectFootprint, *, has_parts: bool) -> str:
    css = "item flat" if item.category in FLAT_CATEGORIES else "item"
    if max(item.size_m[0], item.size_m[2]) < SMALL_M:
        css = "item small"
    hint = title(noun_of(item.category))
    if item.outlines_m:
        return _shape(item, css, hint, has_parts=has_parts)
    if item.category in ROUND_CATEGORIES:
        x, y = cm((item.centre_m[0], item.centre_m[2]))
        rx, ry = round(50 * item.size_m[0]), round(50 * item.size_m[2])
        return f'<ellipse class="{css}" cx="{x}" cy="{y}" rx="{rx}" ry="{ry}">{hint}</ellipse>'
    return f'<path class="{css}" d="{outline(item.polygon_m)}">{hint}</path>'


def _shape(item: ObjectFootprint, css: str, hint: str, *, has_parts: bool) -> str:
    """Draw all parts as one outline, and in a large object the parts themselves, higher ones over lower ones."""
    parts = _core.outlines(item.outlines_m)
    # The fill hides the inner half of every stroke (`paint-order`): what is left is the outline of the union.
    union = f'<path class="{css}" d="{join(parts)}">{hint}</path>'
    if css != "item" or len(parts) == 1 or not has_parts:
        return union
    return union + join(f'<path class="part" d="{part}"/>' for part in dict.fromkeys(parts))


def _room_label(room: RoomFootprint, unit: float, taken_m: Sequence[Box]) -> str:
    if len(room.polygon_m) < 3:
        return ""
    name = noun_of(room.room_type)
    low, high = np.min(room.polygon_m, axis=0), np.max(room.polygon_m, axis=0)
    # A name that is wider than its room is written smaller.
    full_cm = ROOM_LETTERS * unit
    font_cm = full_cm * max(0.55, min(1.0, 100 * float(high[0] - low[0]) / (0.62 * full_cm * len(name))))
    size_m = (0.006 * font_cm * len(name), 0.01 * font_cm)
    near = [box for box in taken_m if _meet(box, (low[0], low[1], high[0], high[1]))]
    x, y = cm(label_point(room.polygon_m, taken_m=near, size_m=size_m))
    size = "" if font_cm == full_cm else f' font-size="{font_cm:.0f}"'
    return f'<text{size} x="{x}" y="{y + 0.3 * font_cm:.0f}">{escape(name)}</text>'


def _item_label(item: ObjectFootprint, font_cm: float) -> tuple[Box, str] | None:
    """Return box and text of a label that fits into the largest part of an object."""
    x0, z0, x1, z1 = max((_box_of(part) for part in item.outlines_m), key=_area_m2, default=_box(item))
    name = noun_of(item.category)
    x, y = cm(((x0 + x1) / 2, (z0 + z1) / 2))
    need_cm = 0.56 * font_cm * len(name)
    width_cm, depth_cm = 100 * (x1 - x0), 100 * (z1 - z0)
    if need_cm <= width_cm and 1.1 * font_cm <= depth_cm:
        box = (x - need_cm / 2, y - font_cm / 2, x + need_cm / 2, y + font_cm / 2)
        return box, f'<text x="{x}" y="{y + 0.35 * font_cm:.0f}">{escape(name)}</text>'
    if need_cm <= depth_cm and 1.1 * font_cm <= width_cm:
        box = (x - font_cm / 2, y - need_cm / 2, x + font_cm / 2, y + need_cm / 2)
        turned = f"translate({x + 0.35 * font_cm:.0f} {y})rotate(-90)"
        return box, f'<text transform="{turned}">{escape(name)}</text>'
    return None


def _box(item: ObjectFootprint) -> Box:
    """Return the box around an object, in metres."""
    (x, _, z), (width_m, _, depth_m) = item.centre_m, item.size_m
    return (x - width_m / 2, z - depth_m / 2, x + width_m / 2, z + depth_m / 2)


def _box_of(outline_m: Sequence[Point]) -> Box:
    xs, zs = [x for x, _ in outline_m], [z for _, z in outline_m]
    return (min(xs), min(zs), max(xs), max(zs))


def _area_m2(box: Box) -> float:
    return (box[2] - box[0]) * (box[3] - box[1])


def _meet(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def outline(polygon_m: Sequence[Point]) -> str:
    """Return path data of a closed polygon."""
    return _core.outlines([polygon_m])[0]


def _lines(segments: Iterable[tuple[Point, Point]]) -> str:
    return join(f'<path d="{polyline([cm(a), cm(b)])}"/>' for a, b in segments)


def _distinct(walls: Iterable[tuple[Point, Point]]) -> list[tuple[Point, Point]]:
    """Return each wall once: ProcTHOR has one a side, and both lie on the same line."""
    found: dict[tuple[tuple[int, int], ...], tuple[Point, Point]] = {}
    for a, b in walls:
        found.setdefault(tuple(sorted((cm(a), cm(b)))), (a, b))
    return list(found.values())


def distance_m(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the ground-plane distance of two `(x, y, z)` points."""
    return math.hypot(a[0] - b[0], a[2] - b[2])
