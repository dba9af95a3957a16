"""Name the files of an exported stream, and define what its text files hold."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from evonav.memory_benchmark.truth import TrueChange
from evonav.records import Record, Version
from evonav.world.simulator import SceneObject

LayoutName = Literal["tum", "replica"]
STREAM_FILE = "stream.json"
FRAMES_FILE = "frames.jsonl"
ORACLE_FILE = "oracle.jsonl.xz"
WORLD = "right-handed, metres, z up: X = x, Y = z, Z = y of evonav; OpenCV's camera"


@dataclass(frozen=True, slots=True)
class FileLayout:
    """The names of a layout's files, and its unit of depth."""

    rgb: str
    """Path of an image of colours, with the index of the frame."""
    depth: str
    depth_scale: float
    """Number in the file for one metre."""

    def folders(self) -> Sequence[str]:
        """Return the folders that the images need."""
        return tuple(dict.fromkeys(str(Path(name).parent) for name in (self.rgb, self.depth, MASKS)))


LAYOUTS: dict[LayoutName, FileLayout] = {
    "tum": FileLayout("rgb/{:06d}.png", "depth/{:06d}.png", 5000.0),
    "replica": FileLayout("results/frame{:06d}.jpg", "results/depth{:06d}.png", 6553.5),
}
"""TUM RGB-D's layout and unit; those of the rendered Replica that NICE-SLAM, ConceptGraphs and HOV-SG read."""
MASKS = "masks/{:06d}.png"
FEATURES = "features/{:06d}.npy"

Vector = tuple[float, float, float]


class LayoutCamera(Record):
    """A pinhole camera: (0, 0) is the centre of the first pixel, as OpenCV counts."""

    w: PositiveInt
    h: PositiveInt
    fx: PositiveFloat
    fy: PositiveFloat
    cx: float
    cy: float
    vertical_fov_rad: PositiveFloat


class StreamFile(Record):
    """The public part of an exported stream, `stream.json`."""

    format: Version = 1
    name: str
    kind: str
    house: str
    digest: str
    """SHA-256 of the stream as it was before depth was rounded, see `evonav.memory_benchmark.streams.digest`."""
    layout: LayoutName
    num_frames: NonNegativeInt
    has_rgb: bool
    rate_hz: PositiveFloat
    depth_scale: PositiveFloat
    camera: LayoutCamera
    world: str = WORLD
    labels: tuple[str, ...]


class FrameLine(Record):
    """One line of `frames.jsonl`. Of a recording of one's own, only `depth` is needed."""

    index: NonNegativeInt = 0
    time_s: float = 0.0
    visit: PositiveInt = 1
    pose: tuple[float, float, float, float, float] | None = None
    """Pose of the camera in evonav's world: x, y, z, yaw and horizon."""
    rgb: str | None = None
    depth: str
    masks: str | None = None
    """Image with the index of the detection plus one at each pixel, 0 where none is."""
    features: str | None = None
    labels: tuple[str, ...] = ()
    confidences: tuple[Annotated[float, Field(ge=0.0, le=1.0)], ...] = ()


class ObjectLine(Record):
    """One object of the oracle's part."""

    id: str
    category: str
    centre_m: Vector
    size_m: tuple[NonNegativeFloat, NonNegativeFloat, NonNegativeFloat]

    @staticmethod
    def of(body: SceneObject) -> "ObjectLine":
        """Return the line of an object."""
        return ObjectLine(id=body.id, category=body.category, centre_m=body.centre_m, size_m=body.size_m)

    def object(self) -> SceneObject:
        """Return the object."""
        return SceneObject(self.id, self.category, "object", self.centre_m, self.size_m)


class ChangeLine(Record):
    """One change of the oracle's part."""

    object_id: str
    label: str
    kind: Literal["moved", "removed", "added"]
    frame: NonNegativeInt
    before: ObjectLine | None
    after: ObjectLine | None

    @staticmethod
    def of(change: TrueChange) -> "ChangeLine":
        """Return the line of a change."""
        return ChangeLine(
            object_id=change.object_id,
            label=change.label,
            kind=change.kind,
            frame=change.frame,
            before=None if change.before is None else ObjectLine.of(change.before),
            after=None if change.after is None else ObjectLine.of(change.after),
        )

    def change(self) -> TrueChange:
        """Return the change."""
        before = None if self.before is None else self.before.object()
        after = None if self.after is None else self.after.object()
        return TrueChange(self.object_id, self.label, self.kind, self.frame, before, after)


class OracleHead(Record):
    """The first line of the oracle's file."""

    name: str
    digest: str
    changes: tuple[ChangeLine, ...]


class TruthLine(Record):
    """A further line of the oracle's file: the truth of one frame."""

    objects: tuple[ObjectLine, ...] | None
    """Objects of the house; `None` if they are those of the frame before."""
    visible_px: dict[str, PositiveInt]
    empty_px: dict[NonNegativeInt, PositiveInt]
    detected_ids: tuple[str | None, ...]
