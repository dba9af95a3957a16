"""Set the agent's pose: `Teleport`, `TeleportFull`.

Based on `teleportFull` and its callers in AI2-THOR's `BaseFPSAgentController` and `PhysicsRemoteFPSAgentController`.
"""

import math

from evonav.thor.actions.motion import invalid_operation, is_within_bounds, snapped, vector_text
from evonav.thor.actions.registry import ActionError, Arguments, ErrorCode, Vector3, action, missing_arguments
from evonav.thor.agent import BODY_Y_M
from evonav.thor.engine import Engine
from evonav.world.pose import canonical_deg, canonical_yaw_deg

_FLOAT32_MAX = 3.4028234663852886e38
_GROUND_M = 0.05
"""Largest height above the floor from which a teleported agent is set down on it."""
_FALL_M = 2 * 9.81
"""Height that AI2-THOR's agent falls where there is no floor: one step of its doubled gravity."""


def out_of_range(message: str) -> ActionError:
    """Return AI2-THOR's error for an `ArgumentOutOfRangeException`, whose one argument is a parameter's name."""
    reason = f"Specified argument was out of the range of valid values.\nParameter name: {message}"
    return ActionError(f"ArgumentOutOfRangeException: {reason}")


class _Pose(Arguments):
    """The parts of a pose; its position is a vector or, in the older form, three numbers."""

    position: Vector3 | None = None
    x: float | None = None
    y: float | None = None
    z: float | None = None
    rotation: Vector3 | None = None
    horizon: float | None = None
    standing: bool | None = None
    forceAction: bool = False

    def checked_position(self, engine: Engine, name: str) -> Vector3 | None:
        """Return the position; refuse a pose that does not fit the agent."""
        if engine.agent.is_locobot and self.standing is not None:
            raise ActionError(f"{name} of a locobot has no argument standing", ErrorCode.INVALID_ARGUMENT)
        parts = {"x": self.x, "y": self.y, "z": self.z}
        missing = [axis for axis, value in parts.items() if value is None]
        if self.position is not None or len(missing) == 3:
            return self.position
        if missing:
            raise missing_arguments(name, *missing)
        return Vector3.model_validate(parts)


class _FullPose(_Pose):
    """A pose without defaults for the angles."""

    rotation: Vector3
    horizon: float


@action("Teleport")
def teleport(engine: Engine, given: _Pose) -> None:
    """Set the given parts of the pose."""
    agent = engine.agent
    at = given.checked_position(engine, "Teleport") or Vector3(x=agent.x_m, y=agent.y_m, z=agent.z_m)
    turned = given.rotation or Vector3(y=agent.yaw_deg)
    horizon_deg = agent.horizon_deg if given.horizon is None else given.horizon
    is_standing = agent.is_standing if given.standing is None else given.standing
    _teleport(engine, at, turned, horizon_deg, is_standing, given.forceAction)


@action("TeleportFull")
def teleport_full(engine: Engine, given: _FullPose) -> None:
    """Set the whole pose; `standing` is required for the default agent and refused for a LoCoBot."""
    at = given.checked_position(engine, "TeleportFull")
    missing = ["position"] if at is None else []
    if given.standing is None and not engine.agent.is_locobot:
        missing.append("standing")
    if at is None or missing:
        raise missing_arguments("TeleportFull", *missing)
    _teleport(engine, at, given.rotation, given.horizon, given.standing is not False, given.forceAction)


def _teleport(
    engine: Engine, at: Vector3, rotation: Vector3, horizon_deg: float, is_standing: bool, force_action: bool
) -> None:
    agent, y_m = engine.agent, at.y
    # AI2-THOR's numbers have single precision.
    if not all(abs(value) <= _FLOAT32_MAX for value in (at.x, at.y, at.z, rotation.y, horizon_deg)):
        raise out_of_range("Teleport pose has numbers that are not finite in single precision.")
    if not force_action:
        _check_pose(engine, at, rotation, horizon_deg)
        y_m = BODY_Y_M
    agent.x_m, agent.y_m, agent.z_m = at.x, y_m, at.z
    agent.yaw_deg, agent.horizon_deg = canonical_yaw_deg(rotation.y), canonical_deg(horizon_deg)
    agent.is_standing = is_standing


def _check_pose(engine: Engine, at: Vector3, rotation: Vector3, horizon_deg: float) -> None:
    """Check a teleport that is not forced as AI2-THOR does, in the same order."""
    body, point_m, place = engine.agent.body, (at.x, at.z), vector_text((at.x, at.y, at.z), 6)
    if max(abs(rotation.x), abs(rotation.z)) >= 1e-2:
        given = vector_text((rotation.x, rotation.y, rotation.z), 6)
        raise out_of_range(
            "No agents currently can change in pitch or roll. So, you must set rotation(x=0, y=yaw, z=0)."
            f" You gave {given}."
        )
    if not -body.max_upward_deg <= horizon_deg <= body.max_downward_deg:
        limits = f"[{-body.max_upward_deg:g}:{body.max_downward_deg:g}]"
        raise out_of_range(f"Each horizon must be in {limits}. You gave {horizon_deg:g}.")
    simulator = engine.scene.simulator
    is_free = simulator.can_move(point_m, point_m)
    if not is_free and not is_within_bounds(engine, point_m):
        raise out_of_range(f"Teleport position {place} out of scene bounds! Ignore this by setting forceAction=true.")
    if math.dist(snapped(engine, point_m), point_m) > 1e-5:
        grid = f"{engine.settings.gridSize:g}"
        raise out_of_range(f"Teleport position {place} is not on the grid of size {grid}.")
    blocker = simulator.blocker(point_m, point_m)
    if blocker is not None:
        raise invalid_operation(f"Collided with: {blocker.id}.")
    if at.y < BODY_Y_M - _GROUND_M:
        raise invalid_operation("Collided with: Floor.")
    fallen_m = at.y - BODY_Y_M if is_free else _FALL_M
    if fallen_m > _GROUND_M:
        raise invalid_operation(
            "After teleporting and adjusting agent position to floor, there was too large a change"
            f"({fallen_m:g} > 0.05) in the y component."
            " Consider using `forceAction=true` if you'd like to teleport anyway."
        )
