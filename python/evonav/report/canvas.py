"""Maps and words drawn with Pillow, for pictures that move: the colours of `templates/map.css`, Pillow's own font."""

import math
import re
import unicodedata
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from evonav.evaluation.records.schema import ObjectFootprint, Relocation, StageMap
from evonav.report.maps.floor_plan import FLAT_CATEGORIES, FLOORS, Frame
from evonav.report.maps.stage_map import map_css
from evonav.report.maps.svg import cm
from evonav.tasks.language import noun_of

Colour = tuple[int, int, int]
Spot = tuple[float, float]

SCALE = 2
"""Maps are drawn this much larger and made small again: smooth lines."""
_PLAIN = {"–": "-", "—": "-", "×": "x", "→": "->", "←": "<-", "✓": "", "•": "-", "²": "2"}


@cache
def colour(name: str) -> Colour:
    """A colour of maps on a light page."""
    light = map_css().partition("/* --- */")[0]
    found = re.search(rf"--{name}:#([0-9a-f]{{6}})", light)
    assert found is not None, name
    return (int(found[1][:2], 16), int(found[1][2:4], 16), int(found[1][4:], 16))


@cache
def font(size_px: int) -> ImageFont.FreeTypeFont:
    """Pillow's own font, which is the same on every machine."""
    found = ImageFont.load_default(size_px)
    assert isinstance(found, ImageFont.FreeTypeFont)
    return found


def plain(text: str) -> str:
    """`text` in the letters that the font has: accents go, other scripts become question marks."""
    text = "".join(_PLAIN.get(letter, letter) for letter in " ".join(text.split()))
    known = "…·°“”’"
    letters = (
        letter if letter.isascii() or letter in known else unicodedata.normalize("NFKD", letter)[0] for letter in text
    )
    return "".join(letter if letter.isascii() or letter in known else "?" for letter in letters)


def wrapped(text: str, size_px: int, width_px: float, max_lines: int) -> list[str]:
    """Lines no wider than `width_px`; an ellipsis ends what does not fit."""
    face, lines = font(size_px), [""]
    words = plain(text).split()
    for word in words:
        longer = f"{lines[-1]} {word}".strip()
        if face.getlength(longer) <= width_px or not lines[-1]:
            lines[-1] = longer
        else:
            lines.append(word)
    is_cut = len(lines) > max_lines
    lines = lines[:max_lines]
    for i, line in enumerate(lines):
        cut = line
        end = "…" if is_cut and i == len(lines) - 1 else ""
        while cut and face.getlength(cut + end) > width_px:
            cut, end = cut[:-1], "…"
        lines[i] = cut + end
    return lines


class MapCanvas:
    """A map in a picture: drawn in page coordinates (`svg.cm`)."""

    def __init__(self, frame: Frame, size_px: tuple[int, int]) -> None:
        """Fits a map's frame into a picture.

        Args:
            frame: Of the map.
            size_px: Width and height of the picture.
        """
        self._frame = frame
        self._size = (size_px[0] * SCALE, size_px[1] * SCALE)
        self._per_cm = min(self._size[0] / frame.width, self._size[1] / frame.height)
        self._left = (self._size[0] - frame.width * self._per_cm) / 2
        self._top = (self._size[1] - frame.height * self._per_cm) / 2
        self.image = Image.new("RGB", self._size, colour("paper"))
        self._draw = ImageDraw.Draw(self.image, "RGBA")

    def copy(self) -> "MapCanvas":
        """The same picture, to draw more on."""
        other = object.__new__(MapCanvas)
        other._frame, other._size, other._per_cm = self._frame, self._size, self._per_cm
        other._left, other._top = self._left, self._top
        other.image = self.image.copy()
        other._draw = ImageDraw.Draw(other.image, "RGBA")
        return other

    def small(self) -> Image.Image:
        """The picture in its size."""
        return self.image.resize((self._size[0] // SCALE, self._size[1] // SCALE), Image.Resampling.LANCZOS)

    def at(self, point_cm: Spot) -> Spot:
        """Pixel of a point."""
        x, y = point_cm
        return (self._left + (x - self._frame.left) * self._per_cm, self._top + (y - self._frame.top) * self._per_cm)

    def unit(self, units: float) -> float:
        """Pixels of so many hundredths of the map's size."""
        return units * self._frame.unit * self._per_cm

    def polygon(
        self,
        points_cm: Iterable[Spot],
        fill: Colour | None,
        edge: Colour | None = None,
        *,
        alpha: int = 255,
        width: float = 0.2,
    ) -> None:
        """A filled outline."""
        points = [self.at(point) for point in points_cm]
        if len(points) < 3:
            return
        if fill is not None:
            self._draw.polygon(points, fill=(*fill, alpha))
        if edge is not None:
            self._draw.line([*points, points[0]], fill=edge, width=max(1, round(self.unit(width))), joint="curve")

    def line(
        self, points_cm: Sequence[Spot], ink: Colour, width: float, *, alpha: int = 255, dash: float = 0.0
    ) -> None:
        """A line `width` units thick; `dash` is the length of its dashes, in units."""
        points = [self.at(point) for point in points_cm]
        if len(points) < 2:
            return
        thick = max(1, round(self.unit(width)))
        if not dash:
            self._draw.line(points, fill=(*ink, alpha), width=thick, joint="curve")
            return
        for (ax, ay), (bx, by) in pairwise(points):
            length, step = math.dist((ax, ay), (bx, by)), self.unit(dash)
            for i in range(0, math.ceil(length / step), 2):
                t0, t1 = i * step / length, min(1.0, (i + 1) * step / length)
                ends = [(ax + t * (bx - ax), ay + t * (by - ay)) for t in (t0, t1)]
                self._draw.line(ends, fill=(*ink, alpha), width=thick)

    def disc(
        self,
        centre_cm: Spot,
        radius_px: float,
        fill: Colour | None,
        edge: Colour | None = None,
        *,
        width: float = 0.4,
        alpha: int = 255,
    ) -> None:
        """A circle."""
        x, y = self.at(centre_cm)
        box = (x - radius_px, y - radius_px, x + radius_px, y + radius_px)
        ink = None if fill is None else (*fill, alpha)
        self._draw.ellipse(box, fill=ink, outline=edge, width=max(1, round(self.unit(width))))

    def ring(self, centre_cm: Spot, radius_cm: float) -> None:
        """The success radius."""
        points = [
            (centre_cm[0] + radius_cm * math.cos(t), centre_cm[1] + radius_cm * math.sin(t))
            for t in np.linspace(0, math.tau, 61)
        ]
        self.polygon(points[:-1], colour("gold"), alpha=26)
        self.line(points, colour("ring"), 0.4, dash=1.2)

    def cone(self, centre_cm: Spot, yaw_rad: float, fov_rad: float, reach_cm: float, alpha: int) -> None:
        """What a view looks at."""
        turns = np.linspace(yaw_rad - fov_rad / 2, yaw_rad + fov_rad / 2, 9)
        x, y = centre_cm
        arc = [(x + reach_cm * math.sin(t), y - reach_cm * math.cos(t)) for t in turns]
        self.polygon([centre_cm, *arc], colour("gold"), alpha=alpha)

    def star(self, centre_cm: Spot, units: float, fill: Colour | None) -> None:
        """A target."""
        x, y = self.at(centre_cm)
        r = self.unit(units)
        sizes = [r if i % 2 == 0 else 0.42 * r for i in range(10)]
        points = [(x + s * math.sin(math.pi * i / 5), y - s * math.cos(math.pi * i / 5)) for i, s in enumerate(sizes)]
        if fill is not None:
            self._draw.polygon(points, fill=fill)
        edge = (31, 37, 48) if fill is not None else colour("ring")
        self._draw.line([*points, points[0]], fill=edge, width=max(1, round(self.unit(0.35))), joint="curve")

    def cross(self, centre_cm: Spot, units: float, ink: Colour, width: float = 0.45) -> None:
        """A cross."""
        x, y = self.at(centre_cm)
        arm, thick = self.unit(units), max(1, round(self.unit(width)))
        for ends in (((x - arm, y - arm), (x + arm, y + arm)), ((x - arm, y + arm), (x + arm, y - arm))):
            self._draw.line(ends, fill=ink, width=thick)

    def words(self, text: str, at_cm: Spot, size_px: int, ink: Colour) -> None:
        """Words over the map, with a pale edge; they stay inside the picture."""
        face, spot = font(size_px * SCALE), self.at(at_cm)
        half = face.getlength(plain(text)) / 2 + SCALE
        x = min(max(spot[0], half), max(half, self._size[0] - half))
        edge = (*colour("paper"), 210)
        self._draw.text(
            (x, spot[1]), plain(text), font=face, fill=ink, anchor="mm", stroke_width=SCALE, stroke_fill=edge
        )

    def cells(self, cells: NDArray[np.uint8], cell_cm: float, corner_cm: Spot, colours: NDArray[np.uint8]) -> None:
        """An agent's map over what is there.

        Args:
            cells: `(R, C)`, `[row = z, col = x]`.
            cell_cm: Edge of a cell.
            corner_cm: Page coordinates of the smallest corner of cell (0, 0).
            colours: `(N, 4)` RGBA by value of a cell; what the map does not reach has the first one.
        """
        rows, cols = cells.shape
        left, top = self.at((corner_cm[0], corner_cm[1] - rows * cell_cm))
        size = (max(1, round(cols * cell_cm * self._per_cm)), max(1, round(rows * cell_cm * self._per_cm)))
        drawn = Image.fromarray(colours[cells[::-1]], "RGBA").resize(size, Image.Resampling.NEAREST)
        layer = Image.new("RGBA", self._size, tuple(int(value) for value in colours[0]))
        layer.paste(drawn, (round(left), round(top)))
        self.image.paste(layer, (0, 0), layer)

    def house(self, stage_map: StageMap, *, is_faint: bool = False) -> None:
        """Floors, furniture, walls and openings; faint ones have no floors and no furniture."""
        if not is_faint:
            for room in stage_map.rooms:
                self.polygon([cm(p) for p in room.polygon_m], colour(FLOORS.get(room.room_type, "other")))
            lowest_first = sorted(
                stage_map.objects, key=lambda item: (item.centre_m[1] + item.size_m[1] / 2, item.object_id)
            )
            for item in lowest_first:
                self.footprint(item, colour("item"), colour("edge"))
        wall = max(9.0 / self._frame.unit, 1.1)
        for a, b in stage_map.walls:
            self.line([cm(a), cm(b)], colour("wall"), wall)
        for opening in stage_map.openings:
            ink, part = (colour("door"), 1.15) if opening.kind == "door" else (colour("window"), 0.45)
            self.line([cm(opening.from_m), cm(opening.to_m)], ink, wall * part)

    def footprint(self, item: ObjectFootprint, fill: Colour | None, edge: Colour, *, width: float = 0.2) -> None:
        """An object from above."""
        outlines = item.outlines_m or (item.polygon_m,)
        is_flat = item.category in FLAT_CATEGORIES
        for outline in outlines:
            self.polygon([cm(p) for p in outline], edge if is_flat else fill, edge, width=width)

    def room_names(self, stage_map: StageMap, size_px: int) -> None:
        """Names of rooms in their middles."""
        for room in stage_map.rooms:
            x, z = np.mean(room.polygon_m, axis=0)
            self.words(noun_of(room.room_type), cm((float(x), float(z))), size_px, colour("soft"))

    def moved(self, relocations: Sequence[Relocation], now: StageMap | None, before: StageMap | None) -> None:
        """What moved before the stage: where it stood, where it stands, and an arrow for what is large."""
        names = {relocation.object_id for relocation in relocations}
        for stage_map, fill in ((before, None), (now, colour("moved"))):
            for item in () if stage_map is None else stage_map.objects:
                if item.object_id in names:
                    self.footprint(item, fill, colour("orange"), width=0.3)
        for relocation in relocations:
            start = cm((relocation.from_m[0], relocation.from_m[2]))
            end = cm((relocation.to_m[0], relocation.to_m[2]))
            self.line([start, end], colour("orange"), 0.3, alpha=110)
