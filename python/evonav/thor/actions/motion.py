"""Move the agent: `Move*`, `Rotate*`, `Look*`, `Stand`, `Crouch`, `Teleport*`, and the actions that do nothing.

Based on AI2-THOR's `BaseFPSAgentController`, `PhysicsRemoteFPSAgentController` and `LocobotFPSAgentController`. The
messages are AI2-THOR's; where its code throws, the message starts with the exception's name, as AI2-THOR's does.
"""

import math
from collections.abc import Callable

from evonav.thor.actions.registry import ActionError, Arguments, ErrorCode, Vector3, action, missing_arguments
from evonav.thor.agent import BODY_Y_M
from evonav.thor.engine import Engine
from evonav.thor.geometry import Point, Vec3, box_around, ground_gap_m
from evonav.world.pose import canonical_deg, canonical_yaw_deg

# AI2-THOR's parameters for objects in the agent's hand, other agents, and the motion of arms. They have no effect here.
_UNUSED = {
    **dict.fromkeys(("forceAction", "manualInteract", "returnToStart", "disableRendering"), bool),
    **dict.fromkeys(("speed", "fixedDeltaTime"), float),
}
_UNUSED_IN_TURNS = {**_UNUSED, "waitForFixedUpdate": bool}
_UNUSED_IN_MOVES = {**_UNUSED, "allowAgentsToIntersect": bool}

_FLOAT32_MAX = 3.4028234663852886e38
_GROUND_M = 0.05
"""Largest height above the floor from which a teleported agent is set down on it."""
_FALL_M = 2 * 9.81
"""Height that AI2-THOR's agent falls where there is no floor: one step of its doubled gravity."""


def invalid_operation(message: str) -> ActionError:
    """Return the error that AI2-THOR reports for an `InvalidOperationException`."""
    return ActionError(f"InvalidOperationException: {message}")


def out_of_range(message: str) -> ActionError:
    """Return AI2-THOR's error for an `ArgumentOutOfRangeException`, whose one argument is a parameter's name."""
    reason = f"Specified argument was out of the range of valid values.\nParameter name: {message}"
    return ActionError(f"ArgumentOutOfRangeException: {reason}")


@action("Pass", "Done", "NoOp", "Stop")
def pass_(engine: Engine) -> None:
    """Do nothing."""


def _mover(right: float, ahead: float) -> Callable[..., None]:
    """Return the action that steps in one direction of the agent."""

    def move(
        engine: Engine,
        *,
        moveMagnitude: float | None = None,
        objectId: str | None = None,
        maxAgentsDistance: float = -1.0,
        noise: float = 0.0,
    ) -> None:
        _move_relative(engine, (right, ahead), moveMagnitude, noise, (objectId, maxAgentsDistance))

    return move


action("MoveAhead", unused=_UNUSED_IN_MOVES)(_mover(0.0, 1.0))
action("MoveBack", unused=_UNUSED_IN_MOVES)(_mover(0.0, -1.0))
action("MoveRight", unused=_UNUSED_IN_MOVES)(_mover(1.0, 0.0))
action("MoveLeft", unused=_UNUSED_IN_MOVES)(_mover(-1.0, 0.0))


@action("MoveRelative", unused={"forceAction": bool})
def move_relative(
    engine: Engine,
    *,
    moveMagnitude: float | None = None,
    x: float = 0.0,
    z: float = 0.0,
    noise: float = 0.0,
) -> None:
    """Move a LoCoBot by `moveMagnitude * |(x, z)|`, with `z` along the heading."""
    if not engine.agent.is_locobot:
        raise ActionError("Invalid action: MoveRelative", ErrorCode.INVALID_ACTION)
    if math.hypot(x, z) <= 1e-5:
        raise ActionError("either x or z must be != 0 for the MoveRelative action")
    _move_relative(engine, (x, z), moveMagnitude, noise, (None, -1.0))


@action("MoveGlobal")
def move_global(engine: Engine, *, x: float, z: float) -> None:
    """Move the agent by the world's `(x, z)`."""
    _move_by(engine, x, z)


def _move_relative(
    engine: Engine,
    direction: tuple[float, float],
    magnitude_m: float | None,
    noise_m: float,
    leash: tuple[str | None, float],
) -> None:
    """Move the agent along `direction`, `(right, ahead)`."""
    agent, (right, ahead) = engine.agent, direction
    step_m = engine.settings.gridSize if magnitude_m is None else magnitude_m
    if engine.agent.is_locobot:
        if right != 0:
            raise invalid_operation(
                "Controller does not support horizontal movement. "
                "Set AllowHorizontalMovement to true on the Controller."
            )
        if step_m <= 0:
            raise invalid_operation("moveMagnitude must be null or >= 0.")
        turn_deg, slip_m = _noise_of_move(engine)
        agent.yaw_deg = canonical_yaw_deg(agent.yaw_deg + turn_deg)
        step_m = abs(ahead) * step_m + noise_m + slip_m
        ahead = math.copysign(1.0, ahead)
    elif step_m <= 0:
        raise invalid_operation("moveMagnitude must be > 0")
    # Signed steps rather than signed sines give the same bits as `EmbeddedSimulator.step`.
    sine, cosine = math.sin(agent.yaw_rad), math.cos(agent.yaw_rad)
    if right:
        _move_by(engine, right * step_m * cosine, -right * step_m * sine, *leash)
    else:
        _move_by(engine, ahead * step_m * sine, ahead * step_m * cosine, *leash)


def _move_by(
    engine: Engine, x_m: float, z_m: float, object_id: str | None = None, max_distance_m: float = -1.0
) -> None:
    agent, before_m = engine.agent, engine.agent.point_m
    to_m = (agent.x_m + x_m, agent.z_m + z_m)
    if not engine.scene.simulator.can_move(before_m, to_m):
        raise ActionError(_why_blocked(engine, to_m, (x_m, 0.0, z_m)))
    agent.x_m, agent.z_m = snapped(engine, to_m)
    if object_id and max_distance_m > 0 and distance_to_object(engine, objectId=object_id) > max_distance_m:
        agent.x_m, agent.z_m = before_m
        raise ActionError(f"Agent movement would bring it beyond the max distance of {object_id}")


def snapped(engine: Engine, point_m: Point) -> Point:
    """Return a point moved to the grid through the world's origin, if `snapToGrid`; halves round to even as in C#."""
    if not engine.settings.snapToGrid:
        return point_m
    per_m = 1 / engine.settings.gridSize
    x_m, z_m = (round(value * per_m) / per_m + 0.0 for value in point_m)
    return (x_m, z_m)


def _why_blocked(engine: Engine, to_m: Point, offset_m: Vec3) -> str:
    if not is_within_bounds(engine, to_m):
        return f"Scene bounds do not contain target position: {vector_text((to_m[0], engine.agent.y_m, to_m[1]), 2)}"
    blocker = engine.scene.simulator.blocker(engine.agent.point_m, to_m)
    name = "Floor" if blocker is None else blocker.id
    return f"{name} is blocking Agent 0 from moving by {vector_text(offset_m, 4)}."


def is_within_bounds(engine: Engine, point_m: Point) -> bool:
    """Return whether a point is in the box around the whole scene."""
    low, high = (corner[[0, 2]] for corner in box_around(engine.scene.simulator.objects))
    return bool(((low <= point_m) & (point_m <= high)).all())


@action("DistanceToObject")
def distance_to_object(engine: Engine, *, objectId: str) -> float:
    """Return the ground-plane distance from the agent to the object's box."""
    body = next((body for body in engine.scene.simulator.objects if body.id == objectId), None)
    if body is None:
        raise ActionError(f"No object with ID {objectId}")
    return ground_gap_m(engine.agent.point_m, body.centre_m, body.size_m)


def _noise_of_move(engine: Engine) -> tuple[float, float]:
    """Draw the errors of a LoCoBot's move: degrees and metres."""
    settings, normal = engine.settings, engine.agent.noise.normal
    if not settings.applyActionNoise:
        return 0.0, 0.0
    mean_deg, deviation_deg = _turn_noise_deg(engine)
    turn_deg = float(normal(mean_deg, deviation_deg / 2))
    return turn_deg, float(normal(settings.movementGaussianMu or 0.001, settings.movementGaussianSigma or 0.005))


def vector_text(vector: Vec3, digits: int) -> str:
    """Format a vector as Unity prints it."""
    return "(" + ", ".join(f"{round(value, digits) + 0.0:.{digits}f}" for value in vector) + ")"


def _turner(sign: float) -> Callable[..., None]:
    """Return the action that turns the agent, clockwise seen from above for sign 1."""

    def turn(engine: Engine, *, degrees: float | None = None) -> None:
        step_deg = engine.settings.rotateStepDegrees if degrees is None else degrees
        noise_deg = 0.0
        if engine.agent.is_locobot:
            step_deg = step_deg or engine.settings.rotateStepDegrees
            noise_deg = _noise_of_turn_deg(engine)
        elif step_deg == 0:
            raise invalid_operation(
                "Cannot rotate by 0 degrees as this previously defaulted to rotating by a diferent amount."
            )
        engine.agent.yaw_deg = canonical_yaw_deg(engine.agent.yaw_deg + sign * step_deg + noise_deg)

    return turn


action("RotateRight", unused=_UNUSED_IN_TURNS)(_turner(1.0))
action("RotateLeft", unused=_UNUSED_IN_TURNS)(_turner(-1.0))


@action("Rotate", unused={"manualInteract": bool})
def rotate(engine: Engine, *, rotation: Vector3, noise: float = 0.0) -> None:
    """Set the yaw of the default agent; turn a LoCoBot by it."""
    agent = engine.agent
    base_deg = agent.yaw_deg + noise + _noise_of_turn_deg(engine) if engine.agent.is_locobot else 0.0
    agent.yaw_deg = canonical_yaw_deg(base_deg + rotation.y)


@action("RotateLook")
def rotate_look(engine: Engine, *, rotation: Vector3 | None = None, horizon: float = 0.0, **_: object) -> None:
    """Set yaw and horizon without regard to the limits."""
    yaw_deg = 0.0 if rotation is None else rotation.y
    engine.agent.yaw_deg, engine.agent.horizon_deg = canonical_yaw_deg(yaw_deg), canonical_deg(horizon)


def _noise_of_turn_deg(engine: Engine) -> float:
    return float(engine.agent.noise.normal(*_turn_noise_deg(engine))) if engine.settings.applyActionNoise else 0.0


def _turn_noise_deg(engine: Engine) -> tuple[float, float]:
    """Return mean and standard deviation; 0 stands for AI2-THOR's own values, as there."""
    return engine.settings.rotateGaussianMu, engine.settings.rotateGaussianSigma or 0.5


def _looker(way: str, sign: float, place: str) -> Callable[..., None]:
    """Return the action that lowers (sign 1) or raises (sign -1) the camera, by 30 degrees by default."""

    def look(engine: Engine, *, degrees: float = 0.0, **_: object) -> None:
        body = engine.agent.body
        horizon_deg = engine.agent.horizon_deg + sign * _look_step_deg(engine, f"Look{way.capitalize()}", degrees)
        limit_deg = body.max_downward_deg if sign > 0 else body.max_upward_deg
        if round(sign * horizon_deg, 1) > limit_deg:
            message = f"can't look {way} beyond {limit_deg:g} degrees {place} the forward horizon"
            # AI2-THOR has the same code for both directions.
            raise ActionError(message, ErrorCode.LOOK_DOWN_CANT_EXCEED_MIN)
        engine.agent.horizon_deg = canonical_deg(horizon_deg)

    return look


action("LookDown")(_looker("down", 1.0, "below"))
action("LookUp")(_looker("up", -1.0, "above"))


def _look_step_deg(engine: Engine, name: str, degrees: float) -> float:
    if engine.agent.is_locobot and degrees != 0:
        raise ActionError("Must have degrees == 0 for now.")
    if degrees < 0:
        raise ActionError(f"{name} action requires positive degree value. Invalid value used: {degrees:g}")
    if abs(degrees - round(degrees, 1)) > 1e-7:
        raise ActionError(f"{name} action requires degree value to be a multiple of 0.1f")
    return round(degrees, 1) or 30.0


def _stander(name: str, state: str, *, is_standing: bool) -> Callable[..., None]:
    """Return the action that moves the camera between its two heights; the body's stays, as in AI2-THOR."""

    def stand(engine: Engine) -> None:
        if engine.agent.is_locobot:
            raise ActionError(f"Invalid action: {name}", ErrorCode.INVALID_ACTION)
        if engine.agent.is_standing == is_standing:
            raise ActionError(f"Already {state}.")
        engine.agent.is_standing = is_standing

    return stand


action("Stand")(_stander("Stand", "standing", is_standing=True))
action("Crouch")(_stander("Crouch", "crouching", is_standing=False))


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
