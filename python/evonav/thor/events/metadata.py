"""Pack an event's metadata in msgpack, with the fields of AI2-THOR's `MetadataWrapper` (`AgentManager.cs`).

Most metadata depends on the scene alone. It is packed once for each version of the scene, and only if it is listed.
"""

import struct
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import msgpack
import numpy as np
from pydantic import BaseModel

from evonav.thor import objects
from evonav.thor.events.colors import Palette, palette_of
from evonav.thor.scene import Scene

if TYPE_CHECKING:
    from evonav.thor.engine import Engine, Result

Vector = dict[str, float]

# The packed keys of a record that depend on the agent; a double follows the first.
_DYNAMIC = ("distance", "visible", "isInteractable")
_DISTANCE = b"\xa8distance\xcb"
_NO_YES = (b"\xc2", b"\xc3")
_SIGHT = {
    (seen, usable): b"\xa7visible" + _NO_YES[seen] + b"\xaeisInteractable" + _NO_YES[usable]
    for seen in (False, True)
    for usable in (False, True)
}
_DOUBLE = struct.Struct(">d")
_MAP16 = struct.Struct(">BH")
_ARRAY32 = struct.Struct(">BI")


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, BaseModel):
        return value.model_dump()
    raise TypeError(f"metadata cannot contain a {type(value).__name__}")


_PACKER = msgpack.Packer(default=_plain, unicode_errors="replace")


def _packed(value: object) -> bytes:
    packed: bytes = _PACKER.pack(value)
    return packed


class MetadataEncoder:
    """Packs the metadata of one engine's events."""

    def __init__(self) -> None:
        self._scene_version = -1
        self._packed: dict[int, bytes] = {}
        self._bounds: dict[str, Any] | None = None
        self._palette = Palette(-1, [], np.zeros((1, 4), np.uint8), np.zeros((1, 4), np.uint8))
        self._colors = b""

    def palette(self, scene: Scene) -> Palette:
        """Return the colours of the scene in its present version."""
        if self._palette.version != scene.version:
            self._palette = palette_of(scene)
            self._colors = _packed(self._palette.entries)
        return self._palette

    def event(self, engine: "Engine", *, sequence_id: int, has_colors: bool) -> bytes:
        """Return all metadata of an event, packed."""
        scene = engine.scene
        self._refresh(scene)
        colors = b"\xc0"
        if has_colors:
            self.palette(scene)
            colors = self._colors
        action_return = _packed_return(engine.last)
        fields = agent_fields(engine) | {"sceneBounds": self._bounds}
        tail = {"thirdPartyCameras": fields["thirdPartyCameras"], "sequenceId": sequence_id, "activeAgentId": 0}
        return b"".join(
            [
                b"\x84\xa6agents\x91",
                *(_opened(fields, 3), b"\xacactionReturn", action_return, b"\xa6colors", colors, b"\xa7objects"),
                *self._objects(engine),
                *(_packed(part) for pair in tail.items() for part in pair),
            ]
        )

    def _objects(self, engine: "Engine") -> list[bytes]:
        if engine.object_filter == frozenset():
            return [_ARRAY32.pack(0xDD, 0)]
        views = objects.object_views(engine.scene, engine.agent, engine.settings)
        wanted = engine.object_filter
        parts = [b""]
        for i, (record, view) in enumerate(zip(objects.static_records(engine.scene), views, strict=True)):
            if wanted is None or record["objectId"] in wanted:
                static = self._packed.get(i)
                if static is None:
                    static = self._packed[i] = _static(record)
                distance, sight = _DOUBLE.pack(view.distance_m), _SIGHT[view.is_visible, view.is_interactable]
                parts += (static, _DISTANCE, distance, sight)
        parts[0] = _ARRAY32.pack(0xDD, (len(parts) - 1) // 4)
        return parts

    def _refresh(self, scene: Scene) -> None:
        if self._scene_version == scene.version:
            return
        self._packed = {}
        self._bounds = scene_bounds(scene)
        self._scene_version = scene.version


def patch(result: "Result") -> bytes:
    """Pack the result of an action that changed nothing: AI2-THOR's `MetadataPatch`."""
    action_return = _packed_return(result)
    return _opened({**_outcome(result), "agentId": 0}, 1) + b"\xacactionReturn" + action_return


def agent_fields(engine: "Engine") -> dict[str, Any]:
    """Return `MetadataWrapper` without the objects, the colours and the bounds of the scene."""
    agent = engine.agent
    position = vector(agent.x_m, agent.y_m, agent.z_m)
    rotation = vector(0.0, agent.yaw_deg, 0.0)
    return {
        **_outcome(engine.last),
        "agent": {
            "name": "agent",
            "position": position,
            "rotation": rotation,
            "cameraHorizon": agent.horizon_deg,
            "isStanding": None if agent.is_locobot else agent.is_standing,
            "inHighFrictionArea": False,
        },
        "agentId": 0,
        "sceneName": engine.scene.name,
        "isSceneAtRest": True,
        "screenWidth": engine.width_px,
        "screenHeight": engine.height_px,
        "depthFormat": "Meters",
        "fov": engine.field_of_view_deg,
        "cameraPosition": vector(*engine.camera_position_m),
        "cameraOrthSize": engine.map_view_size_m,
        "thirdPartyCameras": [camera.metadata() for camera in engine.cameras],
        "collided": False,
        "collidedObjects": [],
        "inventoryObjects": [],
        # The agent never holds an object and has no arm.
        "heldObjectPose": {
            "position": position,
            "rotation": rotation,
            "localPosition": vector(0.0, 0.0, 0.0),
            "localRotation": vector(0.0, 0.0, 0.0),
        },
        "arm": None,
        "colorBounds": None,
        "currentTime": 0.0,
        # AI2-THOR fills these in actions for its own demos only.
        "flatSurfacesOnGrid": [],
        "distances": [],
        "normals": [],
        "isOpenableGrid": [],
        "segmentedObjectIds": [],
        "objectIdsInBox": [],
        "actionIntReturn": 0,
        "actionFloatReturn": 0.0,
        "actionStringsReturn": [],
        "actionFloatsReturn": [],
        "actionVector3sReturn": [],
        "visibleRange": None,
    }


def vector(x: float, y: float, z: float) -> Vector:
    """Return Unity's `Vector3`."""
    return {"x": x, "y": y, "z": z}


def _outcome(result: "Result") -> dict[str, Any]:
    return {
        "lastAction": result.action,
        "lastActionSuccess": result.is_success,
        "errorMessage": result.error_message,
        "errorCode": result.error_code.value,
    }


def _packed_return(result: "Result") -> bytes:
    """Pack what the action returned; fail the action if that cannot be sent."""
    try:
        return _packed(result.action_return)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        result.is_success, result.action_return = False, None
        result.error_message = f"{result.action} returned a value that cannot be sent: {error}"
        return b"\xc0"


def _static(record: Mapping[str, Any]) -> bytes:
    return _opened({key: value for key, value in record.items() if key not in _DYNAMIC}, len(_DYNAMIC))


def _opened(fields: Mapping[str, Any], num_more: int) -> bytes:
    """Return a packed map to which `num_more` pairs can be appended."""
    # A map of 16 or more pairs has a header of three bytes, a smaller one a header of one byte.
    packed = memoryview(_packed(fields))[3 if len(fields) > 15 else 1 :]
    return _MAP16.pack(0xDE, len(fields) + num_more) + packed


def scene_bounds(scene: Scene) -> dict[str, Any] | None:
    """Return AI2-THOR's `SceneBounds`, the box around everything; `None` for an empty scene."""
    bodies = scene.simulator.objects if scene.house is not None else ()
    if not bodies:
        return None
    centres_m = np.array([body.centre_m for body in bodies])
    halves_m = 0.5 * np.array([body.size_m for body in bodies])
    low_m, high_m = (centres_m - halves_m).min(axis=0), (centres_m + halves_m).max(axis=0)
    spans: Sequence[tuple[float, float]] = list(zip(high_m.tolist(), low_m.tolist(), strict=True))
    return {
        "cornerPoints": [[x, y, z] for x in spans[0] for y in spans[1] for z in spans[2]],
        "center": vector(*(0.5 * (low_m + high_m)).tolist()),
        "size": vector(*(high_m - low_m).tolist()),
    }
