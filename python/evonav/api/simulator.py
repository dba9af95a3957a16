"""Look and move in a house from Python: `evonav.Simulator`."""

import math
from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evonav._core import House
from evonav.api.loading import load_houses
from evonav.drawing.pictures import Picture, house_picture
from evonav.errors import InvalidArgumentError, SimulationError
from evonav.evaluation.episode.sensors import map_frame
from evonav.perception.ground_truth import DETECTED_KINDS, GroundTruthPerception
from evonav.sensors.observation import MapFrame, View
from evonav.sensors.visibility import visible_occupancy
from evonav.world.appearance import Change, Colors, Lighting, Materials
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Action, OccupancyGrid, SceneObject, SimulatorConfig, Style

OTHER_NAMES = {"moveahead": "MOVE_FORWARD", "rotateleft": "TURN_LEFT", "rotateright": "TURN_RIGHT", "done": "STOP"}
"""AI2-THOR's names of actions, in small letters."""
OCCUPANCY_RANGE_M = 3.0

Place = Pose | Sequence[float]
"""A pose, or a point `(x, z)` or `(x, y, z)` in metres."""


class Simulator:
    """A house to look at and move in, with an agent's eyes: ground-truth detections and visible occupancy.

    Examples:
        >>> import evonav
        >>> house = evonav.load_houses("bundled")[2]
        >>> simulator = evonav.Simulator(house)
        >>> simulator.step("TURN_LEFT")
        True
        >>> view = simulator.look()
        >>> view.rgb.shape
        (300, 300, 3)
        >>> memory = evonav.ObjectMap()
        >>> update = memory.update(view)
        >>> path = simulator.path_to("Fridge")
        >>> picture = simulator.plot(path)
    """

    house: House
    """The house, as it was loaded."""
    embedded: EmbeddedSimulator
    """The simulator behind this one, with all that it can do."""

    def __init__(
        self,
        house: House | str | Path,
        pose: Pose | None = None,
        *,
        config: SimulatorConfig | None = None,
        style: Style | None = None,
        allow_unknown_assets: bool = False,
    ) -> None:
        """Load a house; the agent stands at `pose`, or at the house's own start.

        Args:
            house: A house, its JSON, or a file of houses, of which the first is taken.
            pose: Pose of the agent; if it does not fit there, it stands at the nearest place where it does.
            config: Camera, body, steps and style; AI2-THOR's camera and body by default.
            style: Way in which colours are drawn: `plain` or `default`. Default: that of `config`.
            allow_unknown_assets: Give assets that are missing from the catalogue the usual size of their category.

        Raises:
            HouseError: The house is malformed or contains an unknown asset.
            InvalidArgumentError: There is no such style.
            SimulationError: The agent fits nowhere.
        """
        config = config or SimulatorConfig()
        config = config if style is None else replace(config, style=style)
        self.embedded = EmbeddedSimulator(config, allow_unknown_assets=allow_unknown_assets)
        self._perception = GroundTruthPerception()
        self.house = _house_of(house)
        self.reset(None, pose)

    def reset(self, house: House | str | Path | None = None, pose: Pose | None = None) -> Pose:
        """Begin again, in this house or another; return the agent's pose.

        Args:
            house: A house as for `Simulator`. Default: the present one.
            pose: Pose of the agent, as for `Simulator`.
        """
        if house is not None:
            self.house = _house_of(house)
        effective = self.embedded.reset(self.house, pose)
        self._grid: OccupancyGrid = self.embedded.occupancy()
        return effective

    @property
    def pose(self) -> Pose:
        """The agent's pose."""
        return self.embedded.pose

    @property
    def objects(self) -> list[SceneObject]:
        """The objects of the house, without walls, floors, ceilings, doors and windows."""
        return [body for body in self.embedded.objects if body.kind == "object"]

    @property
    def map_frame(self) -> MapFrame:
        """Shape and place of the cells of `View.occupancy`, for `evonav.OccupancyMap`."""
        return map_frame(self._grid)

    def step(self, action: Action | str) -> bool:
        """Execute one action; return `False`, and stay, when something is in the way.

        Args:
            action: `MOVE_FORWARD` (0.25 m), `TURN_LEFT` or `TURN_RIGHT` (15 degrees), or `STOP`, which does nothing.

        Raises:
            InvalidArgumentError: There is no such action.
        """
        return self.embedded.step(_action_of(action))

    def teleport(self, place: Place, yaw_deg: float | None = None) -> bool:
        """Put the agent somewhere; return `False`, and stay, where it does not fit.

        Args:
            place: A pose, or a point `(x, z)` or `(x, y, z)`; heights are ignored.
            yaw_deg: Heading, 0 along +z, clockwise. Default: that of the pose, or the present one.

        Raises:
            InvalidArgumentError: The place is none of these.
        """
        if isinstance(place, Pose):
            pose = place
        else:
            x_m, z_m = _point_of(place)
            pose = Pose(x_m, 0.0, z_m, self.pose.yaw_rad, self.pose.horizon_rad)
        if yaw_deg is not None:
            pose = Pose(pose.x_m, pose.y_m, pose.z_m, math.radians(yaw_deg), pose.horizon_rad)
        return self.embedded.teleport(pose)

    def look(self, rgb: bool = True) -> View:
        """Return what the agent sees: depth, detections by ground truth, visible cells, and colours.

        Args:
            rgb: Whether to render colours, which cost more than the rest together.
        """
        frame = self.embedded.render(rgb=rgb, instances=True)
        return View(
            pose=frame.pose,
            intrinsics=frame.intrinsics,
            depth_m=frame.depth_m,
            detections=self._perception.detect(frame, self.embedded.objects),
            occupancy=visible_occupancy(self._grid, self.pose, frame.intrinsics, OCCUPANCY_RANGE_M),
            rgb=frame.rgb,
        )

    def path_to(self, target: str | Sequence[float]) -> NDArray[np.float64]:
        """Return the shortest path from the agent.

        Args:
            target: The category of an object, of which the nearest is taken, the id of an object, or a point `(x, z)`
                or `(x, y, z)`. Doors and windows are found as objects are.

        Returns:
            `(M, 3)` corners `(x, y, z)` in metres. It ends beside the object, in its room, or at the free point nearest
            to the target.

        Raises:
            InvalidArgumentError: The house has no such object.
            SimulationError: There is no path.
        """
        if isinstance(target, str):
            targets_m = [self._beside(found) for found in self._found(target)]
        else:
            x_m, z_m = _point_of(target)
            targets_m = [(x_m, 0.0, z_m)]
        paths = [self.embedded.shortest_path(self.pose.position_m, target_m) for target_m in targets_m]
        paths = [path for path in paths if len(path)]
        if not paths:
            raise SimulationError(f"no path from {self.pose.position_m} to {target!r}")
        return min(paths, key=lambda path: float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()))

    def randomize(
        self,
        *,
        materials: bool = True,
        lighting: bool | Lighting = True,
        colors: bool = False,
        categories: Sequence[str] | None = None,
        room_types: Sequence[str] | None = None,
        seed: int = 0,
    ) -> None:
        """Give the house a random look, for training; `reset` and `reset_appearance` give it its own again.

        Only colours change: depth, detections and collisions stay as they are. Each call replaces the look of the one
        before. `evonav.world.appearance` describes the changes.

        Args:
            materials: Whether surfaces get other materials of their class: another floor, another sofa's cloth.
            lighting: Whether rooms and sun get another brightness and colour, or a `Lighting` with its ranges and seed.
                It is seen in the style `default` alone.
            colors: Whether surfaces get any colours, like AI2-THOR's `RandomizeColors`.
            categories: Categories of what gets materials and colours, such as `Sofa` or `Floor`. Default: all.
            room_types: Types of the rooms in which it is, such as `Kitchen`. Default: all.
            seed: Seed of the look; equal seeds give equal looks.

        Raises:
            InvalidArgumentError: The seed, a category or a type of room does not exist.

        Examples:
            >>> import evonav
            >>> simulator = evonav.Simulator(evonav.load_houses("bundled")[2])
            >>> own = simulator.look().rgb
            >>> simulator.randomize(seed=7)
            >>> bool((simulator.look().rgb == own).all())
            False
            >>> simulator.reset_appearance()
            >>> bool((simulator.look().rgb == own).all())
            True
        """
        changes: list[Change] = []
        if materials:
            changes.append(Materials(seed, categories, room_types))
        if colors:
            changes.append(Colors(seed, categories, room_types))
        if lighting:
            changes.append(lighting if isinstance(lighting, Lighting) else Lighting(seed))
        self.embedded.set_appearance(changes)

    def reset_appearance(self) -> None:
        """Give the house its own look again."""
        self.embedded.set_appearance(())

    def plot(self, path: NDArray[np.float64] | None = None) -> Picture:
        """Draw the house from above, with the agent and what it looks at.

        Args:
            path: A path to draw, `(M, 3)`, such as `path_to` returns.
        """
        points = [] if path is None else [(float(x_m), float(z_m)) for x_m, _, z_m in path]
        camera = self.embedded.intrinsics
        fov_rad = 2.0 * math.atan(camera.width_px / 2.0 / camera.focal_px)
        return house_picture(self.house, path_m=points, pose=self.pose, fov_rad=fov_rad)

    def __repr__(self) -> str:
        """Return the house and the agent's pose."""
        pose = self.pose
        return f"Simulator({self.house!r}, at x={pose.x_m:.2f} z={pose.z_m:.2f} yaw={pose.yaw_deg:.0f} degrees)"

    def _repr_html_(self) -> str:
        return self.plot()._repr_html_()

    def _beside(self, target: SceneObject) -> tuple[float, float, float]:
        """Return the reachable position nearest to an object's box, of those in its room if there are any."""
        free_m = self.embedded.reachable_positions()
        room = self.house.room_of(target.centre_m[0], target.centre_m[2])
        is_in_room = np.array([self.house.room_of(x_m, z_m) == room for x_m, _, z_m in free_m.tolist()])
        if is_in_room.any():
            free_m = free_m[is_in_room]
        gap_m = np.abs(free_m - target.centre_m) - np.array(target.size_m) / 2
        x_m, y_m, z_m = free_m[np.argmin(np.hypot(*gap_m[:, [0, 2]].clip(0.0).T))].tolist()
        return (x_m, y_m, z_m)

    def _found(self, name: str) -> list[SceneObject]:
        """Return the objects, doors or windows of a category, or the one with an id."""
        objects = [body for body in self.embedded.objects if body.kind in DETECTED_KINDS]
        found = [one for one in objects if name in (one.id, one.category)]
        if not found:
            categories = sorted({one.category for one in objects})
            near = get_close_matches(name.lower(), [category.lower() for category in categories], 1)
            match = next((category for category in categories if near and category.lower() == near[0]), None)
            hint = f"did you mean `{match}`?" if match else f"there are {', '.join(categories)}"
            raise InvalidArgumentError(f"the house has no object `{name}`; {hint}")
        return found


def _house_of(house: House | str | Path) -> House:
    if isinstance(house, House):
        return house
    if isinstance(house, str) and house.lstrip().startswith("{"):
        return House(house)
    if isinstance(house, str | Path):
        return load_houses(house, limit=1)[0]
    raise InvalidArgumentError(f"house = {house!r}: expected an `evonav.House`, its JSON, or a path")


def _action_of(action: Action | str) -> Action:
    if isinstance(action, Action):
        return action
    names = [one.value for one in Action]
    if isinstance(action, str):
        if action.upper() in names:
            return Action[action.upper()]
        plain = action.replace("_", "").lower()
        near = [OTHER_NAMES[plain]] if plain in OTHER_NAMES else get_close_matches(action.upper(), names, 1, 0.5)
        if near:
            raise InvalidArgumentError(f"no action {action!r}: did you mean `{near[0]}`?")
    raise InvalidArgumentError(f"no action {action!r}: there are {', '.join(names)}")


def _point_of(place: Sequence[float]) -> tuple[float, float]:
    """Return the `(x, z)` of a point of two or three numbers."""
    try:
        numbers = [float(number) for number in place]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) not in (2, 3):
        raise InvalidArgumentError(f"{place!r} is no place: expected a `Pose`, (x, z) or (x, y, z) in metres")
    return (numbers[0], numbers[-1])
