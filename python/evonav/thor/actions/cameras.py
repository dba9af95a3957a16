"""Add and change third-party cameras, and switch the agent's camera to a map view from above.

Parameters, defaults and messages are those of AI2-THOR's `AgentManager.cs` and `getMapViewCameraProperties`. As there,
a house's ceilings are drawn from below only, so a camera above them sees the rooms. `antiAliasing` has no effect.
"""

import math
import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from PIL import ImageColor
from pydantic import BaseModel, ConfigDict

from evonav.thor.actions.motion import invalid_operation
from evonav.thor.actions.registry import ActionError, Vector3, action
from evonav.thor.actions.teleport import out_of_range
from evonav.thor.engine import Engine
from evonav.thor.geometry import Vec3, box_around, vector
from evonav.thor.scene import Scene
from evonav.world.camera import CameraView, Images
from evonav.world.pose import Pose

Rgb = tuple[int, int, int]

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


@dataclass(frozen=True, slots=True)
class ThirdPartyCamera:
    """One camera. It is immutable: a change makes another camera."""

    camera_id: int
    position_m: Vec3
    rotation_deg: Vec3
    """Unity's Euler angles in degrees: pitch down, yaw right, roll counter-clockwise; roll is applied first."""
    field_of_view_deg: float
    """Vertical field of view in degrees."""
    near_m: float
    far_m: float
    is_orthographic: bool
    orthographic_size_m: float
    """Half the height of an orthographic image, in metres."""
    skybox: Rgb | None
    """Colour of the background; `None` for the renderer's own."""

    def metadata(self) -> dict[str, Any]:
        """Return AI2-THOR's `ThirdPartyCameraMetadata`."""
        return {
            "thirdPartyCameraId": self.camera_id,
            "position": vector(self.position_m),
            "rotation": vector(_euler_deg(self.rotation_deg)),
            "fieldOfView": self.field_of_view_deg,
        }

    def render(self, scene: Scene, *, rgb: bool, instances: bool) -> Images:
        """Render the camera's view in the size of the screen; depth ends at its far plane."""
        view = self._view(scene.config.width_px, scene.config.height_px)
        needs_instances = instances or (rgb and self.skybox is not None)
        depth_m, colours, ids = scene.simulator.render_camera(view, rgb=rgb, instances=needs_instances)
        if colours is not None and self.skybox is not None and ids is not None:
            colours = np.where((ids == 0)[..., np.newaxis], np.array(self.skybox, dtype=np.uint8), colours)
        return Images(np.minimum(depth_m, np.float32(self.far_m)), colours, ids if instances else None)

    def _view(self, width_px: int, height_px: int) -> CameraView:
        down, right, roll = (math.radians(angle) for angle in self.rotation_deg)
        return CameraView(
            Pose(*self.position_m, yaw_rad=right, horizon_rad=down),
            width_px,
            height_px,
            math.radians(self.field_of_view_deg),
            self.near_m,
            self.far_m,
            roll,
            self.orthographic_size_m if self.is_orthographic else None,
        )


@action("AddThirdPartyCamera")
def add_third_party_camera(
    engine: Engine,
    *,
    position: Vector3,
    rotation: Vector3,
    fieldOfView: float = 90.0,
    skyboxColor: str | None = None,
    orthographic: bool = False,
    orthographicSize: float | None = None,
    nearClippingPlane: float | None = None,
    farClippingPlane: float | None = None,
    antiAliasing: str = "none",
) -> None:
    """Add a camera, whose images are part of every later event."""
    if len(engine.cameras) >= _MAX_CAMERAS:
        raise invalid_operation(f"there are already {_MAX_CAMERAS} third-party cameras; no more can be added")
    blank = ThirdPartyCamera(
        len(engine.cameras), (0, 0, 0), (0, 0, 0), 90.0, NEAR_M, FAR_M, False, ORTHOGRAPHIC_SIZE_M, None
    )
    camera = _changed(
        blank,
        position_m=(position.x, position.y, position.z),
        rotation_deg=(rotation.x, rotation.y, rotation.z),
        field_of_view_deg=fieldOfView,
        skybox_colour=skyboxColor,
        is_orthographic=orthographic,
        orthographic_size_m=orthographicSize,
        clip_m=(nearClippingPlane, farClippingPlane),
    )
    engine.cameras.append(camera)


@action("UpdateThirdPartyCamera")
def update_third_party_camera(
    engine: Engine,
    *,
    thirdPartyCameraId: int = 0,
    position: PartialVector3 | None = None,
    rotation: PartialVector3 | None = None,
    fieldOfView: float | None = None,
    skyboxColor: str | None = None,
    orthographic: bool | None = None,
    orthographicSize: float | None = None,
    nearClippingPlane: float | None = None,
    farClippingPlane: float | None = None,
) -> None:
    """Change a camera; absent properties keep their value, except the clip planes, which become the agent's."""
    num_cameras = len(engine.cameras)
    if not 0 <= thirdPartyCameraId < num_cameras:
        raise out_of_range(
            f"thirdPartyCameraId: {thirdPartyCameraId} (int: default=0) must in 0 <= thirdPartyCameraId"
            f" < len(thirdPartyCameras)={num_cameras}."
        )
    camera = engine.cameras[thirdPartyCameraId]
    if not isinstance(camera, ThirdPartyCamera):
        raise ActionError(f"camera {thirdPartyCameraId} is not a third-party camera")
    engine.cameras[thirdPartyCameraId] = _changed(
        camera,
        position_m=_filled(position, camera.position_m),
        rotation_deg=_filled(rotation, camera.rotation_deg),
        field_of_view_deg=camera.field_of_view_deg if fieldOfView is None else fieldOfView,
        skybox_colour=skyboxColor,
        is_orthographic=orthographic,
        orthographic_size_m=orthographicSize,
        clip_m=(nearClippingPlane, farClippingPlane),
    )


@action("ToggleMapView")
def toggle_map_view(engine: Engine) -> None:
    """Switch the agent's images to a view of the whole house from above, or back (deprecated in AI2-THOR too)."""
    if engine.map_view is not None:
        engine.map_view = None
        return
    seen = get_map_view_camera_properties(engine)
    at, size_m = seen["position"], seen["orthographicSize"]
    position_m = (at["x"], at["y"], at["z"])
    fov_deg = engine.field_of_view_deg
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


def _changed(
    camera: ThirdPartyCamera,
    *,
    position_m: Vec3,
    rotation_deg: Vec3,
    field_of_view_deg: float,
    skybox_colour: str | None,
    is_orthographic: bool | None,
    orthographic_size_m: float | None,
    clip_m: tuple[float | None, float | None],
) -> ThirdPartyCamera:
    """Return the camera with new properties, checked as AI2-THOR checks them and as the renderer needs them."""
    if not 0 < field_of_view_deg < 180:
        raise out_of_range(f"fieldOfView: {field_of_view_deg:g} must be in 0 < fieldOfView > 0.")
    if not _FOV_DEG[0] <= field_of_view_deg <= _FOV_DEG[1]:
        raise out_of_range(
            f"fieldOfView: {field_of_view_deg:g}: this engine draws {_FOV_DEG[0]} to {_FOV_DEG[1]} degrees"
        )
    if is_orthographic is not True and orthographic_size_m is not None:
        raise invalid_operation(
            f"orthographicSize(: {orthographic_size_m:g}) can only be set when orthographic=True.\n"
            "Otherwise, we use assume perspective camera setting."
            "Hint: call .step(..., orthographic=True)."
        )
    size_m = camera.orthographic_size_m if orthographic_size_m is None else orthographic_size_m
    near_m, far_m = NEAR_M if clip_m[0] is None else clip_m[0], FAR_M if clip_m[1] is None else clip_m[1]
    if not _NEAR_M <= near_m < far_m <= _MAX_M:
        raise out_of_range(
            f"nearClippingPlane {near_m:g} and farClippingPlane {far_m:g}: {_NEAR_M:g} <= near < far <= {_MAX_M:g}"
        )
    if not 1e-3 <= size_m <= _MAX_M:
        raise out_of_range(f"orthographicSize: {size_m:g} must be in [0.001, {_MAX_M:g}]")
    if max(map(abs, (*position_m, *rotation_deg))) > _MAX_M:
        raise out_of_range(f"position and rotation must be within {_MAX_M:g}")
    return replace(
        camera,
        position_m=position_m,
        rotation_deg=rotation_deg,
        field_of_view_deg=field_of_view_deg,
        near_m=near_m,
        far_m=far_m,
        is_orthographic=camera.is_orthographic if is_orthographic is None else is_orthographic,
        orthographic_size_m=size_m,
        skybox=_skybox(skybox_colour, camera.skybox),
    )


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
    x, y, z = (old if new is None else new for new, old in zip((given.x, given.y, given.z), before, strict=True))
    return (x, y, z)


def _euler_deg(angles_deg: Vec3) -> Vec3:
    """Return angles as Unity reads them back: each in [0, 360), with a pitch of at most 90 degrees."""
    down, right, roll = (angle % 360 for angle in angles_deg)
    if 90 < down < 270:
        down, right, roll = (180 - down) % 360, (right + 180) % 360, (roll + 180) % 360
    return (down, right, roll)
