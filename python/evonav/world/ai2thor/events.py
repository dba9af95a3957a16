"""Convert AI2-THOR's events, images and boxes, to evonav's."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import SimulationError
from evonav.world.camera import unproject
from evonav.world.simulator import Frame, SceneObject

_FAR = 1.0 - 1e-6
"""Share of the far plane from which on a pixel is background: AI2-THOR draws the background there."""


def depth_of(event: Any, far_m: float) -> NDArray[np.float32]:  # noqa: ANN401 - the client's event
    """Return an event's `(H, W)` planar depth, `inf` where nothing is nearer than the far plane.

    Raises:
        SimulationError: The event has no depth image.
    """
    if event.depth_frame is None:
        raise SimulationError("AI2-THOR sent no depth image")
    depth_m = np.array(event.depth_frame, dtype=np.float32, order="C")
    depth_m[~(depth_m < far_m * _FAR)] = np.inf
    return depth_m


def rgb_of(event: Any) -> NDArray[np.uint8]:  # noqa: ANN401 - the client's event
    """Return an event's `(H, W, 3)` colours.

    Raises:
        SimulationError: The event has no colour image.
    """
    if event.frame is None:
        raise SimulationError("AI2-THOR sent no colour image")
    return np.array(event.frame, dtype=np.uint8, order="C")


class InstanceDecoder:
    """Converts the colours of AI2-THOR's instance images to instance ids.

    Every event lists the name of each colour. The names of the house's bodies are their ids. Other names (ceilings,
    which AI2-THOR does not count as objects, and parts of doors) are assigned to the nearest part of the structure.
    """

    def __init__(self, objects: Sequence[SceneObject]) -> None:
        """Prepare for the bodies of a house, in instance order."""
        self._instance_of: dict[str, int] = {}
        for index, body in enumerate(objects):
            # A ceiling has the id of its room's floor. Evonav's engine uses this name, Unity has no name for it.
            name = f"Ceiling|{body.id}" if body.kind == "ceiling" else body.id
            self._instance_of[name] = index + 1
        is_fixed = np.array([body.kind != "object" for body in objects], dtype=bool)
        self._fixed = np.flatnonzero(is_fixed) + 1
        self._centres_m = np.array([body.centre_m for body in objects], dtype=np.float64).reshape(-1, 3)[is_fixed]
        self._halves_m = np.array([body.size_m for body in objects], dtype=np.float64).reshape(-1, 3)[is_fixed] / 2
        self._names: dict[tuple[int, ...], str] | None = None
        self._keys = np.empty(0, dtype=np.uint32)
        self._instances = np.empty(0, dtype=np.int32)

    def decode(self, event: Any, frame: Frame) -> NDArray[np.int32]:  # noqa: ANN401 - the client's event
        """Return `(H, W)` instance ids, 0 where nothing is.

        Args:
            event: Event with an instance image.
            frame: Frame of the same view; its depth locates pixels whose name is not in the house.

        Raises:
            SimulationError: The event has no instance image.
        """
        image = event.instance_segmentation_frame
        if image is None:
            raise SimulationError("AI2-THOR sent no instance image")
        if event.color_to_object_id != self._names:
            self._learn(event.color_to_object_id)
        channels = image.astype(np.uint32)
        keys = channels[..., 0] << 16 | channels[..., 1] << 8 | channels[..., 2]
        at = np.minimum(np.searchsorted(self._keys, keys), max(0, len(self._keys) - 1))
        instances = np.zeros(keys.shape, dtype=np.int32)
        if len(self._keys):
            instances = np.where(self._keys[at] == keys, self._instances[at], 0).astype(np.int32)
        is_there = np.isfinite(frame.depth_m)
        instances[~is_there] = 0
        unnamed = is_there & (instances == 0)
        if unnamed.any():
            instances[unnamed] = self._nearest_fixed(unproject(frame.depth_m, frame.pose, frame.intrinsics)[unnamed])
        return instances

    def _learn(self, names: dict[tuple[int, ...], str]) -> None:
        known = {
            red << 16 | green << 8 | blue: self._instance_of[name]
            for (red, green, blue), name in names.items()
            if name in self._instance_of
        }
        self._names = dict(names)
        self._keys = np.array(sorted(known), dtype=np.uint32)
        self._instances = np.array([known[int(key)] for key in self._keys], dtype=np.int32)

    def _nearest_fixed(self, points_m: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return the instance of the structure's body whose box is nearest to each point."""
        if not len(self._fixed):
            return np.zeros(len(points_m), dtype=np.int32)
        best_m2 = np.full(len(points_m), np.inf)
        best = np.zeros(len(points_m), dtype=np.int32)
        for instance, centre_m, half_m in zip(self._fixed, self._centres_m, self._halves_m, strict=True):
            outside_m = np.maximum(np.abs(points_m - centre_m) - half_m, 0.0)
            squared_m2 = np.einsum("ij,ij->i", outside_m, outside_m)
            is_nearer = squared_m2 < best_m2
            best[is_nearer], best_m2[is_nearer] = instance, squared_m2[is_nearer]
        return best


def with_boxes(bodies: Sequence[SceneObject], records: Sequence[dict[str, Any]]) -> Iterator[SceneObject]:
    """Yield the bodies of a house, objects with the boxes that AI2-THOR reports.

    Raises:
        SimulationError: AI2-THOR does not list an object of the house.
    """
    boxes = {record["objectId"]: record["axisAlignedBoundingBox"] for record in records}
    missing = [body.id for body in bodies if body.kind == "object" and boxes.get(body.id) is None]
    if missing:
        raise SimulationError(f"AI2-THOR's scene lacks {len(missing)} objects of the house: {', '.join(missing[:5])}")
    for body in bodies:
        if body.kind == "object":
            centre, size = boxes[body.id]["center"], boxes[body.id]["size"]
            yield replace(
                body,
                centre_m=(float(centre["x"]), float(centre["y"]), float(centre["z"])),
                size_m=(float(size["x"]), float(size["y"]), float(size["z"])),
            )
        else:
            yield body
