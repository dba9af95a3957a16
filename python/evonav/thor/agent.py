"""Hold the agent's body, state and camera in AI2-THOR's units: metres and degrees."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from evonav.records import sentence_of
from evonav.thor.actions.registry import ActionError, Vector3
from evonav.world.pose import Pose, canonical_deg, canonical_yaw_deg

BODY_Y_M = 0.9009992
"""AI2-THOR's `agent.position.y` on a floor, in all of its agent modes."""


@dataclass(frozen=True, slots=True)
class Body:
    """The body of an agent mode, as `InitializeBody` of AI2-THOR's controllers sets it."""

    mode: str
    radius_m: float
    height_m: float
    camera_height_m: float
    """Height of the camera above the floor when standing."""
    crouch_m: float
    """Distance by which crouching lowers the camera."""
    vertical_fov_deg: float
    max_upward_deg: float
    max_downward_deg: float


BODIES = {
    "default": Body("default", 0.2, 1.8, 1.575, 0.675, 90.0, 30.0, 60.0),
    "locobot": Body("locobot", 0.175, 0.9, BODY_Y_M - 0.0312, 0.2206, 60.0, 29.0, 30.0),
}
"""The bodies by agent mode."""


def body_of(agent_mode: str, max_upward_deg: float = 0.0, max_downward_deg: float = 0.0) -> Body:
    """Return the body of an agent mode.

    Args:
        agent_mode: Name of the mode in any case.
        max_upward_deg: Limit of the default agent's camera, 0 for AI2-THOR's; the LoCoBot's own limit does not change.
        max_downward_deg: The same for looking down.

    Raises:
        ActionError: `BODIES` does not contain the mode.
    """
    body = BODIES.get(agent_mode.lower())
    if body is None:
        raise ActionError(f"agentMode {agent_mode!r} is not supported by this engine, only {', '.join(BODIES)}")
    if body.mode == "locobot":
        return body
    return replace(
        body,
        max_upward_deg=max_upward_deg or body.max_upward_deg,
        max_downward_deg=max_downward_deg or body.max_downward_deg,
    )


class HousePose(BaseModel):
    """The start pose that a house gives for an agent mode."""

    model_config = ConfigDict(allow_inf_nan=False)

    position: Vector3 | None = None
    rotation: Vector3 | None = None
    horizon: float = 0.0
    standing: bool | None = None


_POSES = TypeAdapter(dict[str, HousePose])


@dataclass(slots=True)
class AgentBody:
    """Pose and body of the agent."""

    x_m: float = 0.0
    y_m: float = BODY_Y_M
    z_m: float = 0.0
    yaw_deg: float = 0.0
    horizon_deg: float = 0.0
    is_standing: bool = True
    body: Body = BODIES["default"]
    noise: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    """Source of the LoCoBot's motion noise; every `Reset` restarts it."""

    @property
    def pose(self) -> Pose:
        """The agent's pose in the form of evonav's simulators."""
        return Pose(self.x_m, self.y_m, self.z_m, self.yaw_rad, math.radians(self.horizon_deg))

    @property
    def camera(self) -> Pose:
        """The pose of the agent's camera."""
        return replace(self.pose, y_m=self.camera_height_m)

    @property
    def yaw_rad(self) -> float:
        """Heading in radians."""
        return math.radians(self.yaw_deg)

    @property
    def point_m(self) -> tuple[float, float]:
        """Position on the ground plane, `(x, z)`."""
        return (self.x_m, self.z_m)

    @property
    def camera_height_m(self) -> float:
        """Height of the camera above the floor: lower when crouching, higher after a forced teleport."""
        sunk_m = 0.0 if self.is_standing else self.body.crouch_m
        return self.body.camera_height_m - sunk_m + (self.y_m - BODY_Y_M)

    @property
    def is_locobot(self) -> bool:
        """Whether it is a LoCoBot: no steps aside, no crouching, motion noise."""
        return self.body.mode == "locobot"

    def enter(self, house: Mapping[str, Any]) -> None:
        """Take the pose that `metadata.agentPoses` of a house gives for the agent's mode; without one, stay.

        AI2-THOR's `setAgentPose` in `ProceduralTools` does the same. The client itself teleports to `metadata.agent`.

        Raises:
            ActionError: The house's poses are malformed.
        """
        metadata = house.get("metadata")
        poses = metadata.get("agentPoses") if isinstance(metadata, dict) else None
        try:
            pose = _POSES.validate_python(poses or {}).get(self.body.mode)
        except ValidationError as error:
            raise ActionError(f"CreateHouse: {sentence_of(error, 'metadata.agentPoses')}") from error
        if pose is None:
            return
        if pose.position is not None:
            self.x_m, self.y_m, self.z_m = pose.position.x, BODY_Y_M, pose.position.z
        if pose.rotation is not None:
            self.yaw_deg = canonical_yaw_deg(pose.rotation.y)
        self.horizon_deg = canonical_deg(pose.horizon)
        if pose.standing is not None and not self.is_locobot:
            self.is_standing = pose.standing
