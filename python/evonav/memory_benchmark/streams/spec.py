"""Describe one stream of the memory benchmark, and list the streams of the default benchmark."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from evonav._core import House
from evonav.errors import HouseError, InvalidArgumentError
from evonav.house.files import BUNDLED, stream_houses
from evonav.world.simulator import SimulatorConfig, vertical_fov_deg

Kind = Literal["S0", "S1", "S2", "S3", "S4", "S5", "S6", "S7", "S8", "S9"]
KINDS: tuple[Kind, ...] = get_args(Kind)
TITLES: dict[Kind, str] = {
    "S0": "nothing changes",
    "S1": "a salient object moves between visits",
    "S2": "groups move between visits",
    "S3": "a room is shuffled between visits",
    "S4": "things come and go, doors and furniture open and close",
    "S5": "ten visits of daily activities",
    "S6": "changed places are only glanced at",
    "S7": "the number of objects grows",
    "S8": "groups move, and perception errs",
    "S9": "things move during a visit",
}
"""The event of each kind of stream."""
NOISES = ("noisy:good", "noisy:yolo-world-like", "noisy:poor")
"""Perceptions of S8; the last one errs about depth and pose, too."""
GROUND_TRUTH = "gt"
"""Perception of all other kinds; `noisy:perfect` gives the same detections."""
NUM_HOUSES, NUM_SEEDS = 5, 3
MIN_ROOMS, MAX_ROOMS = 3, 5
"""Numbers of rooms of the houses that are chosen: a visit of the default length sees most of such a house."""
FRAMES_A_VISIT = 120
DAY_FRAMES = 75
"""Frames of a visit of S5: a part of the house, so that what changed is often seen late."""
RATE_HZ = 2.0
HORIZONTAL_FOV_DEG = 90.0


@dataclass(frozen=True, slots=True)
class StreamSpec:
    """All that decides the frames of a stream."""

    kind: Kind
    house: str
    """A house by file and number, such as `bundled:3`; that of the first tour for S7."""
    seed: int = 0
    """Seed of changes, walks and errors of perception."""
    width_px: int = 300
    height_px: int = 300
    perception: str = GROUND_TRUTH
    """Short name of the perception, see `evonav.perception.shorthand`."""
    frames_a_visit: int = FRAMES_A_VISIT
    """Frames of one visit.

    S9's only visit has twice as many, a visit of S6 may have fewer, and S7 goes on with a tour of this length in
    another house until it has seen enough objects.
    """
    max_objects: int = 800
    """Number of objects after which S7 ends."""
    allow_unknown_assets: bool = False
    """Whether to draw assets that the catalogue lacks in the usual size of their category."""

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            InvalidArgumentError: A value is outside its domain.
        """
        if self.kind not in KINDS:
            raise InvalidArgumentError(f"kind = {self.kind!r}: expected one of {', '.join(KINDS)}")
        if self.seed < 0:
            raise InvalidArgumentError(f"seed = {self.seed}: must be >= 0")
        for name in ("width_px", "height_px", "frames_a_visit", "max_objects"):
            if getattr(self, name) < 1:
                raise InvalidArgumentError(f"{name} = {getattr(self, name)}: must be >= 1")

    @property
    def house_name(self) -> str:
        """The house in names of streams: `bundled-0003` for `bundled:3`."""
        stem = re.sub(r"\.(jsonl|json)(\.gz)?", "", self.house.replace("\\", "/").rsplit("/", 1)[-1])
        slug = re.sub(r"[^A-Za-z0-9]+", "-", stem).strip("-") or "house"
        return re.sub(r"\d+", lambda digits: digits.group().zfill(4), slug)

    @property
    def name(self) -> str:
        """Kind, house and seed; then what differs from the default: `S8/bundled-0003/0/noisy-poor/640x480`."""
        parts = [self.kind, self.house_name, str(self.seed)]
        if self.perception != GROUND_TRUTH:
            parts.append(re.sub(r"[^A-Za-z0-9.=-]+", "-", self.perception))
        if (self.width_px, self.height_px) != (300, 300):
            parts.append(f"{self.width_px}x{self.height_px}")
        return "/".join(parts)

    @property
    def walk_kind(self) -> Kind:
        """The kind whose houses and walks it has: S8 is S2 under other errors of perception."""
        return "S2" if self.kind == "S8" else self.kind

    @property
    def camera(self) -> SimulatorConfig:
        """The camera: 90 degrees wide, at AI2-THOR's height."""
        fov_deg = vertical_fov_deg(HORIZONTAL_FOV_DEG, self.width_px, self.height_px)
        return SimulatorConfig(width_px=self.width_px, height_px=self.height_px, vertical_fov_deg=fov_deg)


def reference_specs(
    houses: str | Path = BUNDLED,
    *,
    quick: bool = False,
    kinds: Sequence[Kind] = KINDS,
    width_px: int = 300,
    height_px: int = 300,
) -> list[StreamSpec]:
    """Return the streams of the default benchmark: 5 houses with 3 seeds each of every kind, but one seed of S7.

    Args:
        houses: `bundled`, or a file or folder of houses as for `evonav.load_houses`.
        quick: Take one house and one seed.

    Raises:
        HouseError: The houses cannot be read, or none has at least three rooms.
    """
    names = chosen_houses(houses, 1 if quick else NUM_HOUSES)
    return [
        StreamSpec(kind, house, seed, width_px, height_px, perception, DAY_FRAMES if kind == "S5" else FRAMES_A_VISIT)
        for kind in kinds
        for house in names
        for seed in range(1 if quick or kind == "S7" else NUM_SEEDS)
        for perception in (NOISES if kind == "S8" else (GROUND_TRUTH,))
    ]


def chosen_houses(houses: str | Path, count: int) -> list[str]:
    """Choose houses: of those with 3 to 5 rooms, in the order of the file, `count` at even distances from the first.

    Where no house has so many rooms, those with more are taken.

    Raises:
        HouseError: No house has at least three rooms.
    """
    rooms = [(house.name, len(house.rooms)) for house in stream_houses(houses)]
    fitting = [name for name, number in rooms if MIN_ROOMS <= number <= MAX_ROOMS]
    fitting = fitting or [name for name, number in rooms if number >= MIN_ROOMS]
    if not fitting:
        raise HouseError(f"{houses}: no house has at least {MIN_ROOMS} rooms")
    count = min(count, len(fitting))
    return [fitting[number * len(fitting) // count] for number in range(count)]


def source_of(house: str) -> str:
    """Return the file of a house that is named by file and place: `bundled` of `bundled:3`."""
    return re.sub(r":\d+(\[\d+\])?$", "", house)


def read_house(name: str) -> House:
    """Return the house with this name, such as `bundled:3` or, in a file with a list of houses, `mine.json:1[4]`.

    Raises:
        HouseError: There is none, or it cannot be read.
    """
    source = source_of(name)
    # The reader of houses finds a numbered one without parsing those before it; it knows no other places.
    is_numbered = name[-1:].isdigit() and (source == BUNDLED or Path(source).is_file())
    houses = stream_houses(name if is_numbered else source)
    found = next((house for house in houses if is_numbered or name in (house.name, source)), None)
    if found is None:
        raise HouseError(f"{name}: no such house in {source}")
    return found
