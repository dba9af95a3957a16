"""Add and change third-party cameras, and switch the agent's camera to a map view from above.

Parameters, defaults and messages are those of AI2-THOR's `AgentManager.cs` and `getMapViewCameraProperties`. As there,
a house's ceilings are drawn from below only, so a camera above them sees the rooms. `antiAliasing` has no effect.
"""

import re
from dataclasses import replace
from typing import Any, TypeVar

from PIL import ImageColor
from pydantic import BaseModel, ConfigDict

from evonav.thor.actions.motion import invalid_operation, out_of_range
from evonav.thor.actions.registry import ActionError, Arguments, action
from evonav.thor.engine import Engine, Rgb, ThirdPartyCamera
from evonav.thor.geometry import Vec3, box_around, vector

_T = TypeVar("_T")

NEAR_M, FAR_M = 0.1, 20.0
"""Clip planes of a camera without its own: those of the agent's camera."""
ORTHOGRAPHIC_SIZE_M = 5.0
"""Unity's default for orthographic cameras."""
_MAX_M = 1e6
_MAX_CAMERAS = 64
# The range that the renderer can draw; AI2-THOR's own message states "between 0 and 180".
_FOV_DEG = (0.6, 177.0)
_NEAR_M = 1e-4

# The colour names of Unity's `ColorUtility.TryParseHtmlString`; all but one are the same colours in CSS.
_COLOURS = frozenset(
    {
        *("red", "cyan", "blue", "darkblue", "lightblue", "purple", "yellow", "lime", "fuchsia", "white", "silver"),
        *("grey", "black", "orange", "brown", "maroon", "green", "olive", "navy", "teal", "aqua", "magenta"),
    }
)
_DARK_BLUE = (0, 0, 160)


class PartialVector3(BaseModel):
    """A vector with components that may be absent; absent ones keep their value."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    x: float | None = None
    y: float | None = None
    z: float | None = None


class _Properties(Arguments):
    """The properties that a new camera and a change of one have in common."""

    position: PartialVector3 | None = None
    rotation: PartialVector3 | None = None
    fieldOfView: float | None = None
    skyboxColor: str | None = None
    orthographic: bool | None = None
    orthographicSize: float | None = None
    nearClippingPlane: float | None = None
    farClippingPlane: float | None = None


class _NewCamera(_Properties):
    """The arguments of `AddThirdPartyCamera`."""

    position: PartialVector3
    rotation: PartialVector3
    antiAliasing: str = "none"


class _CameraChange(_Properties):
    """The arguments of `UpdateThirdPartyCamera`."""

    thirdPartyCameraId: int = 0


@action("AddThirdPartyCamera")
def add_third_party_camera(engine: Engine, given: _NewCamera) -> None:
    """Add a camera, whose images are part of every later event."""
    if len(engine.cameras) >= _MAX_CAMERAS:
        raise invalid_operation(f"there are already {_MAX_CAMERAS} third-party cameras; no more can be added")
    origin, size_m = (0.0, 0.0, 0.0), ORTHOGRAPHIC_SIZE_M
    blank = ThirdPartyCamera(len(engine.cameras), origin, origin, 90.0, NEAR_M, FAR_M, False, size_m, None)
    engine.cameras.append(_changed(blank, given))


@action("UpdateThirdPartyCamera")
def update_third_party_camera(engine: Engine, given: _CameraChange) -> None:
    """Change a camera; absent properties keep their value, except the clip planes, which become the agent's."""
    index, num_cameras = given.thirdPartyCameraId, len(engine.cameras)
    if not 0 <= index < num_cameras:
        raise out_of_range(
            f"thirdPartyCameraId: {index} (int: default=0) must in 0 <= thirdPartyCameraId"
            f" < len(thirdPartyCameras)={num_cameras}."
        )
    engine.cameras[index] = _changed(engine.cameras[index], given)


@action("ToggleMapView")
def toggle_map_view(engine: Engine) -> None:
    """Switch the agent's images to a view of the whole house from above, or back (deprecated in AI2-THOR too)."""
    if engine.map_view is not None:
        engine.map_view = None
        return
    seen = get_map_view_camera_properties(engine)
    at, size_m = seen["position"], seen["orthographicSize"]
    position_m = (at["x"], at["y"], at["z"])
    fov_deg = engine.scene.config.vertical_fov_deg
    engine.map_view = ThirdPartyCamera(-1, position_m, (90.0, 0.0, 0.0), fov_deg, NEAR_M, FAR_M, True, size_m, None)
    engine.map_view_size_m = size_m


@action("GetMapViewCameraProperties")
def get_map_view_camera_properties(engine: Engine) -> dict[str, Any]:
    """Return the properties of a camera that sees the whole house from above."""
    bodies = engine.scene.simulator.objects
    ceilings = [body for body in bodies if body.kind == "ceiling"]
    low_m, high_m = box_around(ceilings or bodies)
    x_m, _, z_m = ((low_m + high_m) / 2).tolist()
    y_m = float(low_m[1] if ceilings else high_m[1])
    return {
        "position": vector((x_m, y_m, z_m)),
        "rotation": vector((90.0, 0.0, 0.0)),
        "orthographicSize": float(max(high_m[0] - low_m[0], high_m[2] - low_m[2]) / 2),
        "orthographic": True,
    }


def _changed(camera: ThirdPartyCamera, given: _Properties) -> ThirdPartyCamera:
    """Return the camera with new properties, checked as AI2-THOR checks them and as the renderer needs them."""
    fov_deg = _or(given.fieldOfView, camera.field_of_view_deg)
    if not 0 < fov_deg < 180:
        raise out_of_range(f"fieldOfView: {fov_deg:g} must be in 0 < fieldOfView > 0.")
    if not _FOV_DEG[0] <= fov_deg <= _FOV_DEG[1]:
        raise out_of_range(f"fieldOfView: {fov_deg:g}: this engine draws {_FOV_DEG[0]} to {_FOV_DEG[1]} degrees")
    if given.orthographic is not True and given.orthographicSize is not None:
        raise invalid_operation(
            f"orthographicSize(: {given.orthographicSize:g}) can only be set when orthographic=True.\n"
            "Otherwise, we use assume perspective camera setting."
            "Hint: call .step(..., orthographic=True)."
        )
    size_m = _or(given.orthographicSize, camera.orthographic_size_m)
    near_m, far_m = _or(given.nearClippingPlane, NEAR_M), _or(given.farClippingPlane, FAR_M)
    if not _NEAR_M <= near_m < far_m <= _MAX_M:
        raise out_of_range(
            f"nearClippingPlane {near_m:g} and farClippingPlane {far_m:g}: {_NEAR_M:g} <= near < far <= {_MAX_M:g}"
        )
    if not 1e-3 <= size_m <= _MAX_M:
        raise out_of_range(f"orthographicSize: {size_m:g} must be in [0.001, {_MAX_M:g}]")
    position_m, rotation_deg = _filled(given.position, camera.position_m), _filled(given.rotation, camera.rotation_deg)
    if max(map(abs, (*position_m, *rotation_deg))) > _MAX_M:
        raise out_of_range(f"position and rotation must be within {_MAX_M:g}")
    return replace(
        camera,
        position_m=position_m,
        rotation_deg=rotation_deg,
        field_of_view_deg=fov_deg,
        near_m=near_m,
        far_m=far_m,
        is_orthographic=_or(given.orthographic, camera.is_orthographic),
        orthographic_size_m=size_m,
        skybox=_skybox(given.skyboxColor, camera.skybox),
    )


def _or(given: _T | None, otherwise: _T) -> _T:
    return otherwise if given is None else given


def _skybox(colour: str | None, before: Rgb | None) -> Rgb | None:
    if colour is None:
        return before
    if colour == "default":
        return None
    name = colour.lower()
    if name == "darkblue":
        return _DARK_BLUE
    if name not in _COLOURS and not re.fullmatch(r"#([0-9a-f]{3,4}|[0-9a-f]{6}|[0-9a-f]{8})", name):
        raise ActionError(f"ArgumentException: Invalid skyboxColor: {colour}! Cannot be parsed as an HTML color.")
    red, green, blue = ImageColor.getrgb(name)[:3]
    return (red, green, blue)


def _filled(given: PartialVector3 | None, before: Vec3) -> Vec3:
    if given is None:
        return before
    x, y, z = map(_or, (given.x, given.y, given.z), before)
    return (x, y, z)
