"""Write and read requests to an agent's process, with their arrays in shared memory.

Requests come from the evaluator, who is trusted, so they are pickled. An observation of three views has 17 dataclasses
and 15 arrays, each of which pickle would call Python for: it is taken apart first.
"""

import pickle
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields
from operator import attrgetter
from typing import Any, TypeAlias

import numpy as np

from evonav._core import RunImage
from evonav.agents.hosting.shared_slots import Places
from evonav.sensors.observation import Detections, Observation, View, VisibleOccupancy
from evonav.world.pose import Pose
from evonav.world.run_images import unexpanded
from evonav.world.simulator import Intrinsics

Parts: TypeAlias = Any
"""Tuples, lists, numbers and texts."""

_KINDS = (View, Pose, Intrinsics, Detections, VisibleOccupancy)
_POSE, _INTRINSICS, _VIEW, _OBSERVATION = (
    attrgetter(*(field.name for field in fields(kind))) for kind in (Pose, Intrinsics, View, Observation)
)


def write_request(
    number: int, operation: str, arguments: tuple[Any, ...], put: Callable[[Iterable[Any]], Places]
) -> bytes:
    """Return a request.

    Args:
        arguments: Its arguments; the first one of `act` is an observation.
        put: Copies arrays into the shared memory, and returns where they are.
    """
    if operation == "act":
        observation, *others = arguments
        parts, arrays = _taken_apart(observation)
        content: object = (parts, others)
    else:
        buffers: list[pickle.PickleBuffer] = []
        content = pickle.dumps(arguments, protocol=5, buffer_callback=buffers.append)
        arrays = [np.asarray(buffer.raw()) for buffer in buffers]
    return pickle.dumps((number, operation, put(arrays), content), protocol=5)


def read_request(request: bytes | bytearray, get: Callable[[Places], list[Any]]) -> tuple[int, str, tuple[Any, ...]]:
    """Return number, operation and arguments of a request."""
    number, operation, places, content = pickle.loads(request)  # noqa: S301 - from the evaluator
    arrays = get(places)
    if operation == "act":
        parts, others = content
        return number, operation, (_put_together(parts, arrays), *others)
    return number, operation, pickle.loads(content, buffers=arrays)  # noqa: S301


def _taken_apart(observation: Observation) -> tuple[Parts, list[Any]]:
    """Return the parts of an observation, and its arrays. What has a subclass's type is a part as a whole."""
    if (type(observation), type(observation.pose)) != (Observation, Pose):
        return observation, []
    views, pose, *others, goal_feature = _OBSERVATION(observation)
    arrays = [goal_feature]
    return ([_view_parts(view, arrays) for view in views], _POSE(pose), others), arrays


def _put_together(parts: Parts, arrays: list[Any]) -> Observation:
    """Return the observation again."""
    if isinstance(parts, Observation):
        return parts
    views, pose, others = parts
    rest = iter(arrays)
    goal_feature = next(rest)
    return Observation(tuple([_view_of(view, rest) for view in views]), Pose(*pose), *(*others, goal_feature))


def _view_parts(view: View, arrays: list[Any]) -> Parts:
    pose, intrinsics, depth_m, detections, occupancy, rgb = _VIEW(view)
    if (type(view), type(pose), type(intrinsics), type(detections), type(occupancy)) != _KINDS:
        return view
    masks, shape = detections.stored_masks, None
    if type(masks) is RunImage:
        masks, shape = masks.ends, masks.shape
    arrays += (depth_m, masks, detections.confidences, detections.features, occupancy.free, occupancy.blocked, rgb)
    return _POSE(pose), _INTRINSICS(intrinsics), shape, detections.labels


def _view_of(parts: Parts, arrays: Iterator[Any]) -> View:
    if isinstance(parts, View):
        return parts
    pose, intrinsics, shape, labels = parts
    depth_m, masks = next(arrays), next(arrays)
    return View(
        Pose(*pose),
        Intrinsics(*intrinsics),
        depth_m,
        Detections(masks if shape is None else unexpanded(RunImage(shape, masks)), labels, next(arrays), next(arrays)),
        VisibleOccupancy(next(arrays), next(arrays)),
        next(arrays),
    )
