"""Run AI2-THOR as a simulator: Unity, or evonav's own engine, behind AI2-THOR's Python client."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.errors import InvalidArgumentError, SimulationError, SimulatorLostError
from evonav.world.ai2thor.events import InstanceDecoder, depth_of, rgb_of, with_boxes
from evonav.world.ai2thor.startup import Ai2ThorOptions, ProcessLog, lost, start_controller
from evonav.world.embedded import EmbeddedSimulator, nearest_of
from evonav.world.pose import Pose
from evonav.world.simulator import Action, Frame, OccupancyGrid, SceneObject, SimulatorConfig

if TYPE_CHECKING:
    from evonav.world.ai2thor.process import GuardedController

_Position = tuple[float, float, float]

# Unity reports poses in single precision, turned through quaternions. A report within this distance of the requested
# pose counts as the requested pose.
_SAME_M = 1e-3
_SAME_DEG = 1e-2

_SNAP_M = 0.5
"""Largest distance to the free point that a path's end or the occupancy's seed is moved to, as when embedded."""
_NUM_START_TRIALS = 50
_AGENT_Y_M = 0.9009992
"""Height of the centre of AI2-THOR's agent; by force it takes any height, and the camera follows."""

_BODY = {"camera_height_m": 1.575, "agent_radius_m": 0.2, "agent_height_m": 1.8}
"""The dimensions of AI2-THOR's default agent, which evonav evaluates."""


class Ai2ThorSimulator:
    """A `Simulator` over `ai2thor.controller.Controller`.

    The process starts with the first `reset`, and again with the first one after a `SimulatorLostError`.

    The bodies of the house and their order come from the house file, as in the embedded simulator. Boxes of objects,
    images, collisions and paths come from AI2-THOR.
    """

    def __init__(self, config: SimulatorConfig | None = None, options: Ai2ThorOptions | None = None) -> None:
        """Store the configuration; nothing is started yet.

        Args:
            config: Camera, body and steps; AI2-THOR's by default.
            options: Build of AI2-THOR, and the device that it renders on.

        Raises:
            InvalidArgumentError: AI2-THOR cannot satisfy `config`, or the options contradict each other.
        """
        self.config = config or SimulatorConfig()
        self.options = options or Ai2ThorOptions()
        self.options.check()
        for name, value in _BODY.items():
            if (requested := getattr(self.config, name)) != value:
                raise InvalidArgumentError(f"{name} = {requested}: AI2-THOR's default agent has {value}")
        self.intrinsics = self.config.intrinsics
        self._controller: GuardedController | None = None
        self._log: ProcessLog | None = None
        # The embedded simulator's reading of the house: its bodies, its start, the place of its map.
        self._reading = EmbeddedSimulator(self.config, allow_unknown_assets=True)
        self._is_loaded = False
        self._objects: tuple[SceneObject, ...] = ()
        self._decoder = InstanceDecoder(())
        self._occupancy: OccupancyGrid | None = None
        self._start = self._pose = self._placed = self.config.standing(Pose(0.0, 0.0, 0.0, 0.0))
        # `_pose` is the agent's pose for evonav, `_placed` its pose in AI2-THOR: rendering elsewhere changes only the
        # latter.

    def start(self) -> None:
        """Start the process, so that a failure shows early.

        Raises:
            SimulationError: It cannot be started; the message says why, and what to do.
        """
        if self._controller is None:
            self._launch("Procedural")

    def reset(self, house_json: str, pose: Pose | None = None) -> Pose:
        """Load a house; the agent stands at `pose`, or at the house's own start.

        Args:
            house_json: A ProcTHOR house.
            pose: Requested pose; the agent moves to the nearest reachable grid position if it does not fit there.

        Returns:
            The effective pose.

        Raises:
            HouseError: The house is malformed.
            SimulationError: AI2-THOR does not start, refuses the house, or the agent fits nowhere.
            SimulatorLostError: The process ended or does not answer.
        """
        self._is_loaded, self._occupancy = False, None
        own_start = self._reading.reset(house_json)
        house = json.loads(house_json)
        if self._controller is None:
            event = self._launch(house)
        else:
            try:
                event = self._controller.reset(scene=house)
            except Exception as error:
                raise self._failed("CreateHouse", error) from error
        if not event.metadata["lastActionSuccess"]:
            raise SimulationError(f"AI2-THOR does not load the house: {event.metadata['errorMessage']}")
        self._objects = tuple(with_boxes(self._reading.objects, event.metadata["objects"]))
        self._decoder = InstanceDecoder(self._objects)
        self._is_loaded = True
        # Only the agent moves from now on: events need not list every object, which is most of their cost.
        self._do("SetObjectFilter", objectIds=[])
        self._enter(own_start)
        self._start = self._pose
        if pose is not None:
            self._enter_at(pose)
        return self._pose

    @property
    def pose(self) -> Pose:
        """The agent's pose."""
        return self._pose

    @property
    def objects(self) -> Sequence[SceneObject]:
        """Bodies in instance order (instance id = index + 1)."""
        return self._objects

    def step(self, action: Action) -> bool:
        """Execute one discrete action; `False`, and the pose unchanged, when it collides. `STOP` does nothing."""
        if action is Action.STOP:
            return True
        self._place(self._pose)
        commands: dict[Action, tuple[str, dict[str, Any]]] = {
            Action.MOVE_FORWARD: ("MoveAhead", {"moveMagnitude": self.config.move_m}),
            Action.TURN_RIGHT: ("RotateRight", {"degrees": self.config.turn_deg}),
            Action.TURN_LEFT: ("RotateLeft", {"degrees": self.config.turn_deg}),
        }
        command, amount = commands[action]
        event = self._do(command, **amount)
        if not event.metadata["lastActionSuccess"]:
            return False
        self._pose = self._placed = self._adopted(self.config.stepped(self._pose, action), event)
        return True

    def teleport(self, pose: Pose) -> bool:
        """Set the pose; `False`, and the pose unchanged, when the agent does not fit there."""
        if not pose.is_finite or not self._try_place(self.config.standing(pose)):
            return False
        self._pose = self._placed
        return True

    def render(self, pose: Pose | None = None, *, rgb: bool = True, instances: bool = True) -> Frame:
        """Render the camera's view from `pose` (default: the agent's own); collisions are not checked.

        The agent is put there by force, and back before anything that depends on its pose. (A third-party camera would
        render every image twice, with the agent's own body in it.)

        Raises:
            InvalidArgumentError: The pose is not finite.
            SimulationError: AI2-THOR refuses the pose.
        """
        at = self.config.standing(pose or self._pose)
        if not at.is_finite:
            raise InvalidArgumentError(f"pose = {at}: must be finite")
        event = self._teleported(at, by_force=True, is_rendered=True)
        camera = replace(self._placed, y_m=self.config.camera_height_m)
        depth_m = depth_of(event, self._far_m)
        frame = Frame(camera, self.intrinsics, depth_m, rgb_of(event) if rgb else None)
        return replace(frame, instances=self._decoder.decode(event, frame)) if instances else frame

    def reachable_positions(self) -> NDArray[np.float64]:
        """Return the `(N, 3)` positions of the square grid through the agent that it can reach there, by z, then x."""
        self._place(self._pose)
        return self.config.on_floor(self._reachable(self._pose, self.config.grid_m))

    def nearest_reachable_position(self, position_m: _Position) -> _Position:
        """Return the reachable position nearest on the ground plane."""
        return nearest_of(self.reachable_positions(), position_m)

    def is_free(self, position_m: _Position) -> bool:
        """Return whether the agent's body fits at the position and can move there from the house's start."""
        if not all(map(math.isfinite, position_m)):
            return False
        there = replace(self._pose, x_m=position_m[0], z_m=position_m[2])
        return self._try_place(there) and len(self.shortest_path(self._start.position_m, there.position_m)) > 0

    def shortest_path(self, start_m: _Position, target_m: _Position) -> NDArray[np.float64]:
        """Return the geodesic's `(M, 3)` corners, `(0, 3)` without one; both ends move to the nearest free point."""
        event = self._do(
            "GetShortestPathToPoint",
            position=self._vector(start_m),
            x=target_m[0],
            y=_AGENT_Y_M,
            z=target_m[2],
            allowedError=_SNAP_M,
        )
        if not event.metadata["lastActionSuccess"]:
            return np.empty((0, 3))
        corners = event.metadata["actionReturn"]["corners"]
        return self.config.on_floor(np.array([(corner["x"], corner["z"]) for corner in corners]))

    def occupancy(self) -> OccupancyGrid:
        """Return the oracle occupancy: a cell is free if the agent reaches its centre along the grid of cell centres.

        The flood fill begins at the centre nearest to the house's start where the agent fits.
        """
        if self._occupancy is None:
            self._occupancy = self._mapped()
        return self._occupancy

    def close(self) -> None:
        """End the process and release everything; safe to call twice."""
        if self._controller is not None:
            self._controller.stop()
        if self._log is not None:
            self._log.close()
        self._controller = self._log = None
        self._is_loaded = False
        self._reading.close()

    @property
    def _far_m(self) -> float:
        server = self._running.server
        assert server is not None  # a running controller has one
        return float(server.camera_far_plane)

    @property
    def _running(self) -> "GuardedController":
        if self._controller is None or not self._is_loaded:
            raise SimulationError("no house: call reset first")
        return self._controller

    def _launch(self, scene: str | dict[str, Any]) -> Any:  # noqa: ANN401 - the client's event
        self._log = ProcessLog()
        try:
            self._controller = start_controller(self.config, self.options, scene, self._log)
        except BaseException:
            self._log.close()
            raise
        return self._controller.last_event

    def _do(self, action: str, *, renderImage: bool = False, **arguments: object) -> Any:  # noqa: ANN401, N803
        try:
            return self._running.step(action=action, renderImage=renderImage, **arguments)
        except SimulationError:
            raise
        except Exception as error:
            raise self._failed(action, error) from error

    def _failed(self, action: str, error: Exception) -> SimulationError:
        """Return the error for a failed action; anything but a refusal ends the process."""
        if isinstance(error, ValueError):
            return SimulationError(f"AI2-THOR refuses {action}: {error}")
        failure: SimulatorLostError = lost(f"executing {action}", error, "" if self._log is None else self._log.tail())
        self.close()
        return failure

    def _teleported(self, pose: Pose, *, by_force: bool, is_rendered: bool = False) -> Any:  # noqa: ANN401
        """Put AI2-THOR's agent at a pose, by force or only if it fits there; return the event."""
        event = self._do(
            "TeleportFull",
            position=self._vector(pose.position_m),
            rotation={"x": 0.0, "y": pose.yaw_deg, "z": 0.0},
            horizon=pose.horizon_deg,
            standing=True,
            forceAction=by_force,
            renderImage=is_rendered,
        )
        if event.metadata["lastActionSuccess"]:
            self._placed = self._adopted(pose, event)
        elif by_force:
            raise SimulationError(f"AI2-THOR does not put the agent at {pose}: {event.metadata['errorMessage']}")
        return event

    def _try_place(self, pose: Pose) -> bool:
        return bool(self._teleported(pose, by_force=False).metadata["lastActionSuccess"])

    def _place(self, pose: Pose) -> None:
        """Put AI2-THOR's agent at a pose where it was before."""
        if self._placed != pose:
            self._teleported(pose, by_force=True)

    def _adopted(self, requested: Pose, event: Any) -> Pose:  # noqa: ANN401 - the client's event
        """Return the requested pose if AI2-THOR reports that one, else the reported pose."""
        agent = event.metadata["agent"]
        x_m, z_m = float(agent["position"]["x"]), float(agent["position"]["z"])
        yaw_deg, horizon_deg = float(agent["rotation"]["y"]), float(agent["cameraHorizon"])
        is_same = (
            math.dist((x_m, z_m), (requested.x_m, requested.z_m)) < _SAME_M
            and abs(math.remainder(yaw_deg - requested.yaw_deg, 360.0)) < _SAME_DEG
            and abs(horizon_deg - requested.horizon_deg) < _SAME_DEG
        )
        return requested if is_same else self.config.standing(Pose.of_degrees(x_m, 0.0, z_m, yaw_deg, horizon_deg))

    def _enter(self, start: Pose) -> None:
        """Put the agent at the house's start, or at the nearest place that AI2-THOR accepts."""
        start = self.config.standing(start)
        if not self._try_place(start):
            self._teleported(start, by_force=True)
            points_m = self._reachable(start, self.config.grid_m)
            nearest = np.argsort(np.hypot(*(points_m - (start.x_m, start.z_m)).T), kind="stable")
            trials = points_m[nearest][:_NUM_START_TRIALS].tolist()
            if not any(self._try_place(replace(start, x_m=x_m, z_m=z_m)) for x_m, z_m in trials):
                raise SimulationError("AI2-THOR's agent fits nowhere near the house's start")
        self._pose = self._placed

    def _enter_at(self, pose: Pose) -> None:
        x_m, z_m = pose.x_m, pose.z_m
        if not self.is_free(pose.position_m):
            x_m, _, z_m = self.nearest_reachable_position(pose.position_m)
        if not self.teleport(replace(pose, x_m=x_m, z_m=z_m)):
            raise SimulationError(f"AI2-THOR does not put the agent at the reachable position ({x_m}, {z_m})")

    def _reachable(self, origin: Pose, grid_m: float) -> NDArray[np.float64]:
        """Return `(N, 2)` x and z that AI2-THOR's agent reaches on the grid through `origin`, where it stands."""
        event = self._do("GetReachablePositions", gridSize=grid_m)
        if not event.metadata["lastActionSuccess"]:
            raise SimulationError(f"AI2-THOR finds no reachable positions: {event.metadata['errorMessage']}")
        found = event.metadata["actionReturn"]
        points_m = np.array([(p["x"], p["z"]) for p in found], dtype=np.float64).reshape(-1, 2)
        origin_m = np.array([origin.x_m, origin.z_m], dtype=np.float64)
        # Reported in single precision; rounded to the grid in double precision.
        cells: NDArray[np.float64] = np.rint((points_m - origin_m) / grid_m)
        cells = cells[np.lexsort((cells[:, 0], cells[:, 1]))]
        on_grid_m: NDArray[np.float64] = origin_m + cells * grid_m
        return on_grid_m

    def _mapped(self) -> OccupancyGrid:
        cell_m = self.config.occupancy_cell_m
        shape, corner_m = _core.map_spec(self._reading.house_json, name="house", cell_m=cell_m)
        grid = OccupancyGrid(np.ones(shape, dtype=np.uint8), cell_m, corner_m)
        if (seed := next((pose for pose in self._seeds(grid) if self._try_place(pose)), None)) is not None:
            free_m = self._reachable(seed, cell_m)
            cols, rows = np.floor((free_m - corner_m) / cell_m).astype(int).T
            is_in = (rows >= 0) & (cols >= 0) & (rows < shape[0]) & (cols < shape[1])
            grid.cells[rows[is_in], cols[is_in]] = 0
        return grid

    def _seeds(self, grid: OccupancyGrid) -> Iterator[Pose]:
        """Yield the centres of cells near the house's start, the nearest first, equal ones by row and column."""
        rows, cols = np.indices(grid.cells.shape)
        x_m = grid.corner_m[0] + (cols + 0.5) * grid.cell_m
        z_m = grid.corner_m[1] + (rows + 0.5) * grid.cell_m
        squared_m2 = (x_m - self._start.x_m) ** 2 + (z_m - self._start.z_m) ** 2
        order = np.argsort(squared_m2, axis=None, kind="stable")
        for index in order[: int((squared_m2 <= _SNAP_M**2).sum())]:
            yield replace(self._start, x_m=float(x_m.flat[index]), z_m=float(z_m.flat[index]))

    def _vector(self, position_m: _Position) -> dict[str, float]:
        """Return a position for the wire, where the agent's height is always AI2-THOR's own."""
        return {"x": position_m[0], "y": _AGENT_Y_M, "z": position_m[2]}
