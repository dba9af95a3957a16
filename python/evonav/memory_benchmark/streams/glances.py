"""Plan visits in which changed places are only glanced at (S6)."""

import math
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evonav._core import House
from evonav.memory_benchmark.streams.evidence import num_looks_through
from evonav.memory_benchmark.streams.plan import StreamPlan
from evonav.memory_benchmark.streams.rendered import RenderedStream
from evonav.memory_benchmark.streams.spec import StreamSpec
from evonav.memory_benchmark.streams.visits import visits
from evonav.memory_benchmark.truth import EVIDENCE_PX
from evonav.world.simulator import Frame, SceneObject

MAX_GLANCES = 5
"""Largest number of frames of a visit that show a changed place."""
SIDE_RAD = math.radians(45.0)
"""Largest angle, at the place, between the first glance and another: all come from one side."""
HIDDEN_SHARE = 0.5
"""A place is partly hidden if at most this share of its box's pixels in the image shows it."""
CANDIDATES = 2
"""Frames candidates for each frame of a visit: those that show too much are left out."""


@dataclass(frozen=True, slots=True)
class _Look:
    """A frame's look at a changed place."""

    bearing_rad: float
    """Direction from the place to the camera."""
    is_hidden: bool
    is_evident: bool
    """Whether it shows at least `EVIDENCE_PX` pixels of the place."""


def glances(spec: StreamSpec, house: House) -> StreamPlan:
    """Plan visits as `visits`, and leave out frames so that no changed place is in more than `MAX_GLANCES` of a visit.

    A changed place is the old box of an object that has gone, until it is taken, and an object that has moved or is
    new, in this visit or before. It counts as shown with one pixel, at any distance. Frames in which all such places
    are partly hidden are preferred; others are taken for places that would have no glance of `EVIDENCE_PX` else.

    Args:
        house: The house before the changes.

    Raises:
        HouseError: The house does not change at any attempt.
    """
    candidates = visits(replace(spec, frames_a_visit=CANDIDATES * spec.frames_a_visit), house)
    shown_in = _glances_of(RenderedStream(spec, candidates))
    indices: dict[int, list[int]] = {}
    for index, frame in enumerate(candidates.frames):
        indices.setdefault(frame.visit, []).append(index)
    chosen = [index for mine in indices.values() for index in _selected(mine, shown_in, spec.frames_a_visit)]
    return replace(candidates, frames=[candidates.frames[index] for index in chosen])


def _glances_of(stream: RenderedStream) -> list[Mapping[Hashable, _Look]]:
    """Return the changed places that each frame shows."""
    found: list[Mapping[Hashable, _Look]] = []
    old = {number: change.before for number, change in enumerate(stream.changes) if change.before is not None}
    new: dict[str, SceneObject] = {}
    changes = list(stream.changes)
    for index, (frame, visible, empty) in enumerate(stream.evidence(range_m=math.inf)):
        while changes and changes[0].frame <= index:
            change = changes.pop(0)
            new.pop(change.object_id, None)
            if change.after is not None:
                new[change.object_id] = change.after
        shown: dict[Hashable, _Look] = {number: _look(frame, old[number], count) for number, count in empty.items()}
        shown |= {body_id: _look(frame, new[body_id], count) for body_id, count in visible.items() if body_id in new}
        found.append(shown)
    return found


def _look(frame: Frame, place: SceneObject, count: int) -> _Look:
    nothing = np.full_like(frame.depth_m, np.inf)
    in_box = num_looks_through(nothing, frame.pose, frame.intrinsics, place)
    bearing_rad = math.atan2(frame.pose.x_m - place.centre_m[0], frame.pose.z_m - place.centre_m[2])
    return _Look(bearing_rad, count <= HIDDEN_SHARE * in_box, count >= EVIDENCE_PX)


def _selected(frames: Sequence[int], shown_in: list[Mapping[Hashable, _Look]], num_frames: int) -> list[int]:
    """Return the frames of one visit that stay, ascending."""
    counts, bearings_rad, evident = Counter[Hashable](), dict[Hashable, float](), set[Hashable]()
    glanced: list[int] = []

    def is_allowed(shown: Mapping[Hashable, _Look]) -> bool:
        return all(
            counts[place] < MAX_GLANCES
            and abs(math.remainder(look.bearing_rad - bearings_rad.get(place, look.bearing_rad), math.tau)) <= SIDE_RAD
            for place, look in shown.items()
        )

    for needs_hidden in (True, False):
        for index in frames:
            shown = shown_in[index]
            new = {place for place, look in shown.items() if look.is_evident} - evident
            is_wanted = all(look.is_hidden for look in shown.values()) if needs_hidden else bool(new)
            is_wanted &= any(look.is_evident for look in shown.values())
            if index not in glanced and is_wanted and is_allowed(shown) and len(glanced) < num_frames:
                glanced.append(index)
                counts.update(list(shown))
                evident |= new
                for place, look in shown.items():
                    bearings_rad.setdefault(place, look.bearing_rad)
    others = [index for index in frames if not shown_in[index]]
    return sorted([*glanced, *others[: num_frames - len(glanced)]])
