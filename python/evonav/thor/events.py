"""Encode the answer to an action: metadata, in msgpack with the fields of AI2-THOR's `MetadataWrapper`, and images.

Most metadata depends on the scene alone. It is packed once for each version of the scene, and only if it is listed.
"""

import struct
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import msgpack
import numpy as np
from pydantic import BaseModel

from evonav.errors import EvonavError
from evonav.thor import images, objects
from evonav.thor.engine import Engine, Result, log_once
from evonav.thor.geometry import box_around, vector
from evonav.thor.images import ImageKinds, palette_of
from evonav.thor.scene import Scene
from evonav.thor.transport.fifo import Field, FieldType
from evonav.world.camera import Images

# The packed keys of a record that depend on the agent; a double follows the first.
_DYNAMIC = ("distance", "visible", "isInteractable")
_DISTANCE = b"\xa8distance\xcb"
_SIGHT = (b"\xa7visible\xc2\xaeisInteractable\xc2", b"\xa7visible\xc3\xaeisInteractable\xc3")
_DOUBLE = struct.Struct(">d")
_MAP16 = struct.Struct(">BH")
_ARRAY32 = struct.Struct(">BI")


class Emitter:
    """Encodes the events of one engine; what has not changed since the last event is reused."""

    def __init__(self, engine: Engine, *, has_camera: bool = True, has_patches: bool = True) -> None:
        """Emit events for an engine.

        Args:
            engine: The engine whose state the events show.
            has_camera: `False` for a client that asked for no graphics.
            has_patches: Whether the transport supports messages that contain only the changes.
        """
        self._engine = engine
        self._has_camera = has_camera
        self._has_patches = has_patches
        self._sequence_id = -1
        self._state: object = None
        self._images: list[Field] = []

    def event(self, message: Mapping[str, Any]) -> list[Field]:
        """Return the event that answers a message which the engine has executed."""
        sequence_id = message.get("sequenceId")
        self._sequence_id = (
            sequence_id if type(sequence_id) is int and abs(sequence_id) < 2**62 else self._sequence_id + 1
        )
        try:
            return self._event(message)
        except Exception as error:
            # The scene's house cannot be described. The client is informed and may load another house.
            problem = f"the engine cannot show the scene: {type(error).__name__}: {error}"
            if not isinstance(error, EvonavError):
                log_once(error, problem)
            self._engine.scene = Scene(self._engine.scene.name)
            self._engine.cameras.clear()
            self._engine.map_view = None
            self._engine.last = Result(self._engine.last.action, False, problem)
            return self._event(message)

    def _event(self, message: Mapping[str, Any]) -> list[Field]:
        engine = self._engine
        kinds = self._kinds(message)
        state = (engine.state, kinds)
        if self._has_patches and engine.settings.fastActionEmit and state == self._state:
            return [(FieldType.METADATA_PATCH, patch(engine.last))]
        if state != self._state:
            self._images = self._rendered(kinds) if kinds else []
            self._state = state
        has_colors = kinds is not None and kinds.needs_instances
        metadata = pack_event(engine, sequence_id=self._sequence_id, has_colors=has_colors)
        return [(FieldType.METADATA, metadata), *self._images]

    def _kinds(self, message: Mapping[str, Any]) -> ImageKinds | None:
        """Return the images to send with this event; `None` for none."""
        if not self._has_camera or not message.get("renderImage", True):
            return None
        settings = self._engine.settings
        return ImageKinds(
            rgb=True,
            depth=settings.renderDepthImage,
            # An action may request these two images for its own event only.
            instances=settings.renderInstanceSegmentation or message.get("renderInstanceSegmentation") is True,
            classes=settings.renderSemanticSegmentation or message.get("renderSemanticSegmentation") is True,
        )

    def _rendered(self, kinds: ImageKinds) -> list[Field]:
        engine = self._engine
        palette = engine.scene.derived(palette_of)
        views: list[Callable[..., Images]] = [engine.view]
        views += [partial(camera.render, engine.scene) for camera in engine.cameras]
        fields: list[Field] = []
        for index, render in enumerate(views):
            if engine.scene.house is None:
                seen = images.blank(engine.width_px, engine.height_px)
            else:
                seen = render(rgb=kinds.rgb, instances=kinds.needs_instances)
            fields += images.encode(seen, kinds, palette, is_third_party=index > 0)
        return fields


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


def pack_event(engine: Engine, *, sequence_id: int, has_colors: bool) -> bytes:
    """Return all metadata of an event, packed."""
    action_return = _packed_return(engine.last)
    fields = agent_fields(engine) | {"sceneBounds": engine.scene.derived(scene_bounds)}
    colors = engine.scene.derived(_packed_colors) if has_colors else b"\xc0"
    tail = {"thirdPartyCameras": fields["thirdPartyCameras"], "sequenceId": sequence_id, "activeAgentId": 0}
    return b"".join(
        [
            b"\x84\xa6agents\x91",
            *(_opened(fields, 3), b"\xacactionReturn", action_return, b"\xa6colors", colors, b"\xa7objects"),
            *_objects(engine),
            *(_packed(part) for pair in tail.items() for part in pair),
        ]
    )


def _objects(engine: Engine) -> list[bytes]:
    wanted = engine.object_filter
    if wanted == frozenset():
        return [_ARRAY32.pack(0xDD, 0)]
    packed = engine.scene.derived(_packed_records)
    parts = [b""]
    for index, (record, distance_m, is_visible) in enumerate(objects.views(engine)):
        if wanted is None or record["objectId"] in wanted:
            if index not in packed:
                packed[index] = _static(record)
            parts += (packed[index], _DISTANCE, _DOUBLE.pack(distance_m), _SIGHT[is_visible])
    parts[0] = _ARRAY32.pack(0xDD, (len(parts) - 1) // 4)
    return parts


def _packed_records(scene: Scene) -> dict[int, bytes]:
    """Return the packed static records by index: none at first, since packing all of them takes long."""
    return {}


def _packed_colors(scene: Scene) -> bytes:
    return _packed(scene.derived(palette_of).entries)


def patch(result: Result) -> bytes:
    """Pack the result of an action that changed nothing: AI2-THOR's `MetadataPatch`."""
    action_return = _packed_return(result)
    return _opened({**_outcome(result), "agentId": 0}, 1) + b"\xacactionReturn" + action_return


def agent_fields(engine: Engine) -> dict[str, Any]:
    """Return `MetadataWrapper` without the objects, the colours and the bounds of the scene."""
    agent = engine.agent
    position = vector((agent.x_m, agent.y_m, agent.z_m))
    rotation = vector((0.0, agent.yaw_deg, 0.0))
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
        "fov": engine.scene.config.vertical_fov_deg,
        "cameraPosition": vector(engine.camera_position_m),
        "cameraOrthSize": engine.map_view_size_m,
        "thirdPartyCameras": [camera.metadata() for camera in engine.cameras],
        "collided": False,
        "collidedObjects": [],
        "inventoryObjects": [],
        # The agent never holds an object and has no arm.
        "heldObjectPose": {
            "position": position,
            "rotation": rotation,
            "localPosition": vector((0.0, 0.0, 0.0)),
            "localRotation": vector((0.0, 0.0, 0.0)),
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


def _outcome(result: Result) -> dict[str, Any]:
    return {
        "lastAction": result.action,
        "lastActionSuccess": result.is_success,
        "errorMessage": result.error_message,
        "errorCode": result.error_code.value,
    }


def _packed_return(result: Result) -> bytes:
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
    low_m, high_m = box_around(bodies)
    spans = list(zip(high_m.tolist(), low_m.tolist(), strict=True))
    return {
        "cornerPoints": [[x, y, z] for x in spans[0] for y in spans[1] for z in spans[2]],
        "center": vector((0.5 * (low_m + high_m)).tolist()),
        "size": vector((high_m - low_m).tolist()),
    }
