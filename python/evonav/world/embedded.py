"""Simulate AI2-THOR's agent in a ProcTHOR house with the Rust core, without Unity."""

import json
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary, WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.errors import InvalidArgumentError, SimulationError
from evonav.world.appearance import Change, changes_json
from evonav.world.camera import CameraView, Images
from evonav.world.pose import Pose, canonical_at, moved
from evonav.world.run_images import unexpanded
from evonav.world.simulator import Action, Frame, OccupancyGrid, SceneObject, SimulatorConfig

_Position = tuple[float, float, float]
Houses = deque[_core.EmbeddedSimulator]
_LOADED: WeakValueDictionary[tuple[str, str, SimulatorConfig, bool], _core.EmbeddedSimulator] = WeakValueDictionary()
"""Houses that are in use in this process, by JSON, name and settings: episodes of a task share them."""


@dataclass
class _Facts:
    """The objects and the occupancy of a house, computed at the first request; its look changes neither."""

    objects: tuple[SceneObject, ...] | None = None
    occupancy: OccupancyGrid | None = None


_FACTS: WeakKeyDictionary[_core.EmbeddedSimulator, _Facts] = WeakKeyDictionary()
"""Facts about the houses that are in use."""


class EmbeddedSimulator:
    """A `Simulator` over the Rust core: one house at a time, deterministic, about 1,000 images a second per CPU core.

    Angles of poses are canonical (`Pose.canonical`), so a simulator that uses degrees gives the same bits. Calls
    release the GIL. A pickle contains the house, its look and the pose; the rest is computed again in milliseconds.

    Examples:
        >>> simulator = EmbeddedSimulator()  # doctest: +SKIP
        >>> simulator.reset(house)  # doctest: +SKIP
        >>> simulator.render(rgb=False).depth_m.shape  # doctest: +SKIP
        (300, 300)
    """

    def __init__(
        self, config: SimulatorConfig | None = None, *, allow_unknown_assets: bool = False, recent: Houses | None = None
    ) -> None:
        """Make a simulator without a house; call `reset` next.

        Args:
            config: Camera, body and steps; AI2-THOR's by default.
            allow_unknown_assets: Whether to draw assets that the catalogue lacks (Objaverse's) in the usual size of
                their category; otherwise such a house is refused.
            recent: Keeps the houses that were loaded last, 1.5 MB each, also for simulators that share it; else one.
        """
        if config is not None and not isinstance(config, SimulatorConfig):
            raise InvalidArgumentError(
                f"config = {config!r}: expected a `SimulatorConfig`; give a house to `reset`, or to `evonav.Simulator`"
            )
        self.config = config or SimulatorConfig()
        self.allow_unknown_assets = allow_unknown_assets
        self.intrinsics = self.config.intrinsics
        self._loaded: _core.EmbeddedSimulator | None = None
        self._recent = Houses(maxlen=1) if recent is None else recent
        self._house_name = "house"
        self._pose = self.config.standing(Pose(0.0, 0.0, 0.0, 0.0))
        self._facts = _Facts()
        self._appearance: tuple[Change, ...] = ()

    def reset(self, house: str | _core.House, pose: Pose | None = None, *, name: str | None = None) -> Pose:
        """Load a house in its own look; the agent stands at `pose`, or at the house's own start.

        A house that this simulator or another one in this process keeps is not built again.

        If the agent does not fit at `pose`, or cannot reach it from the house's start, it moves to the nearest
        reachable grid position.

        Args:
            house: A ProcTHOR house, or its JSON.
            pose: Requested pose of the agent.
            name: Name of the house in errors. Default: its own, or `house`.

        Returns:
            The effective pose.

        Raises:
            HouseError: The house is malformed or contains an unknown asset.
            InvalidArgumentError: A number of the configuration is out of range, or there is no such style.
            SimulationError: The agent fits nowhere.
        """
        if isinstance(house, _core.House):
            name = name or house.name
            house = house.to_json()
        self._house_name = name or "house"
        config, allows_all = self.config, self.allow_unknown_assets
        self._recent.append(core_of(house, config, name=self._house_name, allow_unknown_assets=allows_all))
        self._appearance = ()
        return self._enter(self._recent[-1], pose)

    def apply(self, delta: str | Mapping[str, Any], pose: Pose | None = None) -> Pose:
        """Change the current house; only what moved is built again.

        Args:
            delta: A `HouseDelta`, as JSON or as its dictionary.
            pose: The agent's pose after the change; by default its present one.

        Returns:
            The effective pose, as from `reset`.

        Raises:
            HouseError: The delta names an object that the house does not contain.
            InvalidArgumentError: The argument is not a `HouseDelta`.
        """
        delta_json = delta if isinstance(delta, str) else json.dumps(delta)
        return self._enter(self._world.apply(delta_json), pose or self._pose)

    def enter(self, pose: Pose | None = None) -> Pose:
        """Put the agent at `pose`, as `reset` does, in the current house."""
        return self._enter(self._world, pose)

    @property
    def appearance(self) -> tuple[Change, ...]:
        """The changes of the house's look; empty if it is the house's own."""
        return self._appearance

    def set_appearance(self, changes: Sequence[Change], *, are_checked: bool = False) -> None:
        """Give the house a random look, until the next `reset`; only colours change.

        Args:
            changes: `Materials`, `Colors` and `Lighting` of `evonav.world.appearance`, carried out one after another on
                the house's own look; none for its own look. Of several `Lighting`, the last counts.
            are_checked: Whether to ignore categories that the house no longer has, not to refuse them.

        Raises:
            InvalidArgumentError: A number is out of range, or a category or a type of room does not exist; the look
                stays.
            SimulationError: There is no house yet.

        Examples:
            >>> import evonav
            >>> from evonav.world.appearance import Lighting, Materials
            >>> from evonav.world.embedded import EmbeddedSimulator
            >>> simulator = EmbeddedSimulator()
            >>> pose = simulator.reset(evonav.load_houses("bundled")[2])
            >>> own = simulator.render()
            >>> simulator.set_appearance([Materials(seed=1), Lighting(seed=1)])
            >>> other = simulator.render()
            >>> bool((own.rgb != other.rgb).any()), bool((own.depth_m == other.depth_m).all())
            (True, True)
        """
        changes = tuple(changes)
        self._loaded = self._world.with_look(changes_json(changes), are_checked=are_checked)
        self._appearance = changes

    @property
    def core(self) -> _core.EmbeddedSimulator:
        """The core's simulator of the current house; it never changes, so many may share it."""
        return self._world

    @property
    def house_json(self) -> str:
        """The current house as JSON."""
        return self._world.house_json()

    @property
    def pose(self) -> Pose:
        """The agent's pose."""
        return self._pose

    @property
    def objects(self) -> Sequence[SceneObject]:
        """Bodies in instance order (instance id = index + 1)."""
        if self._facts.objects is None:
            self._facts.objects = tuple(
                SceneObject(body_id, category, kind, (x_m, y_m, z_m), (width_m, height_m, depth_m))
                for body_id, category, kind, (x_m, y_m, z_m), (width_m, height_m, depth_m) in self._world.bodies()
            )
        return self._facts.objects

    def step(self, action: Action) -> bool:
        """Execute one discrete action; `False`, and the pose unchanged, when it collides. `STOP` does nothing.

        Raises:
            InvalidArgumentError: It is no `Action`.
            SimulationError: There is no house yet.
        """
        if not isinstance(action, Action):
            names = ", ".join(f"Action.{one.name}" for one in Action)
            raise InvalidArgumentError(f"action = {action!r}: expected one of {names}")
        world = self._world
        requested = self.config.stepped(self._pose, action)
        if action is Action.MOVE_FORWARD and not world.can_move(_on_ground(self._pose), _on_ground(requested)):
            return False
        if action is not Action.STOP:
            self._pose = requested
        return True

    def teleport(self, pose: Pose) -> bool:
        """Set the pose; `False`, and the pose unchanged, when the agent does not fit there."""
        if not pose.is_finite or not self._world.is_free(_on_ground(pose)):
            return False
        self._pose = self.config.standing(pose)
        return True

    def render(self, pose: Pose | None = None, *, rgb: bool = True, instances: bool = True) -> Frame:
        """Render the camera's view from `pose` (default: the agent's own); collisions are not checked.

        Instances are stored as runs of pixels, and made an array when they are looked at.

        Raises:
            InvalidArgumentError: The pose is not finite.
        """
        at = canonical_at(self.config.camera_height_m, pose or self._pose)
        depth_m, colours, ids = self._world.render(at, rgb=rgb, instances=instances)
        return Frame(at, self.intrinsics, depth_m, colours, None if ids is None else unexpanded(ids))

    def render_camera(self, view: CameraView, *, rgb: bool = True, instances: bool = True) -> Images:
        """Render any camera; ceilings are seen from below only, so views from above show the rooms.

        Angles are not rounded.

        Raises:
            InvalidArgumentError: A number of the view is not finite or out of range.
        """
        return Images(*self._world.render_camera(view, rgb=rgb, instances=instances))

    def visible_objects(
        self, view: CameraView, *, max_distance_m: float = 1.5, agent_m: tuple[float, float] | None = None
    ) -> list[int]:
        """Return the bodies that AI2-THOR calls visible (`visibilityScheme` "Collider", its default).

        A body is visible if some part of it is near the agent on the ground plane, and one of its visibility points, a
        grid over its surfaces, is inside the image and not occluded. Clip planes do not count.

        Args:
            view: View of the agent's camera, or of another.
            max_distance_m: AI2-THOR's `visibilityDistance`.
            agent_m: The agent's `(x, z)`; by default below the camera.

        Returns:
            Indices into `objects` (instance id - 1), ascending; never ceilings.

        Raises:
            InvalidArgumentError: A number is not finite or out of range.
        """
        agent_m = agent_m or _on_ground(view.pose)
        return self._world.visible_bodies(view, agent_m=agent_m, max_distance_m=max_distance_m)

    def reachable_positions(self) -> NDArray[np.float64]:
        """Return the positions of the square grid through the agent that it can reach: `(N, 3)`, x, y, z in metres."""
        return self.config.on_floor(self._world.reachable_positions(_on_ground(self._pose), self.config.grid_m))

    def nearest_reachable_position(self, position_m: _Position) -> _Position:
        """Return the reachable position nearest on the ground plane."""
        return nearest_of(self.reachable_positions(), position_m)

    def is_free(self, position_m: _Position) -> bool:
        """Return whether the agent's body fits at the position and can move there from the house's start."""
        return self._world.is_reachable((position_m[0], position_m[2]))

    def can_move(self, from_m: tuple[float, float], to_m: tuple[float, float]) -> bool:
        """Return whether the agent can move straight between `(x, z)` points; for equal points, whether it fits."""
        return self._world.can_move(from_m, to_m)

    def blocker(self, from_m: tuple[float, float], to_m: tuple[float, float]) -> SceneObject | None:
        """Return the body that blocks a straight move between points `(x, z)`; `None` if only the floor is missing."""
        index = self._world.blocker(from_m, to_m)
        return None if index is None else self.objects[index]

    def is_visible(self, from_m: _Position, to_m: _Position, ignored_instances: Sequence[int] = ()) -> bool:
        """Return whether nothing stands between two points, except bodies with the given instance ids."""
        return self._world.is_visible(from_m, to_m, [instance - 1 for instance in ignored_instances if instance > 0])

    def shortest_path(self, start_m: _Position, target_m: _Position) -> NDArray[np.float64]:
        """Return the geodesic's `(M, 3)` corners, `(0, 3)` without one; both ends move to the nearest free point."""
        return self.config.on_floor(self._world.shortest_path((start_m[0], start_m[2]), (target_m[0], target_m[2])))

    def path_lengths_m(self, start_m: _Position, targets_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the geodesic distances from one position to many.

        Args:
            start_m: Start, `(x, y, z)`.
            targets_m: Targets, `(N, 3)`.

        Returns:
            `(N,)` metres, `inf` where no path exists.
        """
        targets = np.ascontiguousarray(np.asarray(targets_m, dtype=np.float64).reshape(-1, 3)[:, [0, 2]])
        return self._world.distances_m((start_m[0], start_m[2]), targets)

    def occupancy(self) -> OccupancyGrid:
        """Return the oracle occupancy: cells whose centres the agent's body reaches from the house's start are free.

        The body moves straight along the grid, beginning at the centre nearest to the start where it fits. The grid has
        the same shape for all arrangements of a house.
        """
        if self._facts.occupancy is None:
            cells, corner_m = self._world.occupancy(self.config.occupancy_cell_m)
            cells.flags.writeable = False
            self._facts.occupancy = OccupancyGrid(cells, self.config.occupancy_cell_m, corner_m)
        return self._facts.occupancy

    def triangles(self) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.uint8]]:
        """Return all surfaces, for other renderers and for export.

        Returns:
            `(N, 3, 3)` corners in metres, clockwise seen from outside; `(N,)` body indices (instance id - 1); and
            `(N, 3)` colours, sRGB.
        """
        return self._world.triangles()

    def close(self) -> None:
        """Release the houses; safe to call twice."""
        self._loaded, self._facts = None, _Facts()
        self._recent.clear()

    def __copy__(self) -> "EmbeddedSimulator":
        """Return another simulator of the same house; both share it, since `apply` replaces the house."""
        twin = type(self).__new__(type(self))
        twin.__dict__.update(self.__dict__ | {"_recent": self._recent.copy()})
        return twin

    def __getstate__(self) -> dict[str, Any]:
        """Return house and pose; see the class."""
        house_json = self._loaded and self._loaded.house_json()
        return self.__dict__ | {"_loaded": house_json, "_recent": deque(maxlen=self._recent.maxlen), "_facts": _Facts()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Load the house again."""
        house_json = state["_loaded"]
        self.__dict__.update(state | {"_loaded": None})
        if house_json:
            pose, changes = self._pose, self._appearance
            self.reset(house_json, name=self._house_name)
            self.set_appearance(changes, are_checked=True)
            self._pose = pose

    @property
    def _world(self) -> _core.EmbeddedSimulator:
        if self._loaded is None:
            raise SimulationError("no house: call reset first")
        return self._loaded

    def _enter(self, core: _core.EmbeddedSimulator, pose: Pose | None) -> Pose:
        if core is not self._loaded:
            self._loaded, self._facts = core, _FACTS.setdefault(core, _Facts())
        start_m, yaw_rad, horizon_rad = core.start()
        self._pose = Pose(*start_m, yaw_rad=yaw_rad, horizon_rad=horizon_rad).canonical()
        if pose is not None:
            if not core.is_reachable(_on_ground(pose)):
                x_m, _, z_m = self.nearest_reachable_position(pose.position_m)
                pose = moved(pose, x_m, z_m, pose.yaw_rad)
            self._pose = self.config.standing(pose)
        return self._pose


def core_of(
    house_json: str, config: SimulatorConfig, *, name: str, allow_unknown_assets: bool
) -> _core.EmbeddedSimulator:
    """Load a house in the Rust core, with a simulator's camera, body and style, or take the one that somebody has.

    Raises:
        HouseError: The house is malformed or contains an unknown asset.
        InvalidArgumentError: A number of the configuration is out of range, or there is no such style.
    """
    source = (house_json, name, config, allow_unknown_assets)
    if (core := _LOADED.get(source)) is None:
        core = _LOADED[source] = _core.EmbeddedSimulator(
            house_json,
            name=name,
            image_px=(config.width_px, config.height_px),
            vertical_fov_rad=config.intrinsics.vertical_fov_rad,
            clip_m=(config.near_m, config.far_m),
            camera_height_m=config.camera_height_m,
            agent_radius_m=config.agent_radius_m,
            agent_height_m=config.agent_height_m,
            allow_unknown_assets=allow_unknown_assets,
            style=config.style,
        )
    return core


def nearest_of(reachable_m: NDArray[np.float64], position_m: _Position) -> _Position:
    """Return the position nearest to another on the ground plane, the first of equal ones."""
    if not len(reachable_m):
        raise SimulationError("no position is reachable from the agent's place")
    squared_m2 = (reachable_m[:, 0] - position_m[0]) ** 2 + (reachable_m[:, 2] - position_m[2]) ** 2
    x_m, y_m, z_m = reachable_m[int(np.argmin(squared_m2))].tolist()
    return (x_m, y_m, z_m)


def _on_ground(pose: Pose) -> tuple[float, float]:
    return (pose.x_m, pose.z_m)
