"""A small simulator in NumPy for tests of the protocol: boxes on a floor, rays against boxes, Dijkstra on a grid.

It shares nothing with evonav's own simulator. Houses are ProcTHOR-like JSON whose objects carry their `size`.
"""

import heapq
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from evonav.evaluation.episode.spec import EpisodeSpec, StageSpec
from evonav.evaluation.records.schema import Relocation, TargetRecord, TransitionRecord
from evonav.tasks.public import Goal
from evonav.world.pose import Pose
from evonav.world.simulator import Action, Frame, Intrinsics, OccupancyGrid, SceneObject, SimulatorConfig

CELL_M = 0.1
WIDTH_M, DEPTH_M = 8.0, 5.0
WALL_M = 0.1

# Two rooms of 4 x 5 m; the wall between them has a 1 m doorway.
WALLS = {
    "south": ((0.0, 0.0), (WIDTH_M, 0.0)),
    "north": ((0.0, DEPTH_M), (WIDTH_M, DEPTH_M)),
    "west": ((0.0, 0.0), (0.0, DEPTH_M)),
    "east": ((WIDTH_M, 0.0), (WIDTH_M, DEPTH_M)),
    "middle-south": ((4.0, 0.0), (4.0, 2.0)),
    "middle-north": ((4.0, 3.0), (4.0, DEPTH_M)),
}
ROOMS = {"room|1": ("Kitchen", 0.0, 4.0), "room|2": ("Bedroom", 4.0, 8.0)}
OBJECTS = {
    "Fridge|1": ("Fridge", (0.5, 0.9, 4.4), (0.7, 1.8, 0.7)),
    "DiningTable|1": ("DiningTable", (2.0, 0.4, 1.2), (1.2, 0.8, 0.8)),
    "Chair|1": ("Chair", (2.0, 0.45, 2.1), (0.5, 0.9, 0.5)),
    "Bed|1": ("Bed", (6.8, 0.35, 4.0), (2.0, 0.7, 1.6)),
    "Dresser|1": ("Dresser", (4.6, 0.5, 4.6), (0.8, 1.0, 0.5)),
    "GarbageCan|1": ("GarbageCan", (7.6, 0.3, 0.5), (0.4, 0.6, 0.4)),
    "Mug|1": ("Mug", (1.7, 0.87, 1.2), (0.14, 0.14, 0.14)),
}


def house_json(moves=None):
    """The toy house, with objects moved: id -> centre."""
    objects = []
    for object_id, (category, centre, size) in OBJECTS.items():
        x, y, z = (moves or {}).get(object_id, centre)
        objects.append(
            {
                "id": object_id,
                "assetId": f"Toy_{category}",
                "position": {"x": x, "y": y, "z": z},
                "rotation": {"x": 0, "y": 0, "z": 0},
                "size": size,
                "children": [],
            }
        )
    rooms = [
        {
            "id": room_id,
            "roomType": kind,
            "floorMaterial": {"name": "Plain"},
            "floorPolygon": [{"x": x, "y": 0, "z": z} for x, z in ((a, 0), (a, DEPTH_M), (b, DEPTH_M), (b, 0))],
        }
        for room_id, (kind, a, b) in ROOMS.items()
    ]
    walls = [
        {
            "id": f"wall|{name}",
            "roomId": "room|1",
            "material": {"name": "Plain"},
            "polygon": [{"x": x, "y": y, "z": z} for y, ends in ((0, (a, b)), (2.5, (b, a))) for x, z in ends],
        }
        for name, (a, b) in WALLS.items()
    ]
    metadata = {"agent": {"position": {"x": 1, "y": 0.9, "z": 3}, "rotation": {"x": 0, "y": 0, "z": 0}, "horizon": 30}}
    house = {"objects": objects, "rooms": rooms, "walls": walls, "doors": [], "windows": [], "metadata": metadata}
    return json.dumps(house)


class ToySimulator:
    """`evonav.world.simulator.Simulator` over boxes."""

    def __init__(self, width_px=48, height_px=48):
        self.config = SimulatorConfig(width_px=width_px, height_px=height_px, occupancy_cell_m=CELL_M)
        self.num_resets = 0

    def reset(self, house_json, pose=None):
        self.num_resets += 1
        house = json.loads(house_json)
        bodies = [
            ("floor", "Floor", "floor", (WIDTH_M / 2, -0.05, DEPTH_M / 2), (WIDTH_M, 0.1, DEPTH_M)),
        ]
        for name, ((x0, z0), (x1, z1)) in WALLS.items():
            size = (x1 - x0 + WALL_M, 2.5, z1 - z0 + WALL_M)
            bodies.append((f"wall|{name}", "Wall", "wall", ((x0 + x1) / 2, 1.25, (z0 + z1) / 2), size))
        for entry in house["objects"]:
            centre = tuple(entry["position"][axis] for axis in "xyz")
            bodies.append((entry["id"], entry["assetId"].removeprefix("Toy_"), "object", centre, tuple(entry["size"])))
        self._objects = [SceneObject(*body) for body in bodies]
        centres = np.array([body.centre_m for body in self._objects])
        sizes = np.array([body.size_m for body in self._objects])
        self._low, self._high = centres - sizes / 2, centres + sizes / 2
        self._blocked = self._rasterise()
        self._pose = pose or Pose(1.0, 0.9, 3.0, 0.0)
        if not self.is_free(self._pose.position_m):
            x_m, _, z_m = self.nearest_reachable_position(self._pose.position_m)
            self._pose = replace(self._pose, x_m=x_m, z_m=z_m)
        return self._pose

    def _rasterise(self):
        """Cells whose centre is nearer than the agent's radius to anything it could bump into."""
        rows, cols = round(DEPTH_M / CELL_M), round(WIDTH_M / CELL_M)
        x = (np.arange(cols) + 0.5) * CELL_M
        z = (np.arange(rows) + 0.5) * CELL_M
        blocked = np.zeros((rows, cols), dtype=np.uint8)
        for body, low, high in zip(self._objects, self._low, self._high, strict=True):
            if body.kind == "floor":
                continue
            dx = np.maximum(np.maximum(low[0] - x, x - high[0]), 0)[None, :]
            dz = np.maximum(np.maximum(low[2] - z, z - high[2]), 0)[:, None]
            blocked |= (np.hypot(dx, dz) < self.config.agent_radius_m).astype(np.uint8)
        return blocked

    @property
    def pose(self):
        return self._pose

    @property
    def objects(self):
        return self._objects

    def step(self, action):
        pose = self._pose
        turn_rad = math.radians(self.config.turn_deg)
        if action is Action.MOVE_FORWARD:
            x_m = pose.x_m + self.config.move_m * math.sin(pose.yaw_rad)
            z_m = pose.z_m + self.config.move_m * math.cos(pose.yaw_rad)
            return self.teleport(replace(pose, x_m=x_m, z_m=z_m))
        sign = {Action.TURN_LEFT: -1, Action.TURN_RIGHT: 1}[action]
        self._pose = replace(pose, yaw_rad=pose.yaw_rad + sign * turn_rad)
        return True

    def teleport(self, pose):
        if not self.is_free(pose.position_m):
            return False
        self._pose = pose
        return True

    def render(self, pose=None, *, rgb=True, instances=True):
        pose = pose or self._pose
        config = self.config
        intrinsics = Intrinsics(config.width_px, config.height_px, math.radians(config.vertical_fov_deg))
        u = (np.arange(config.width_px) + 0.5 - config.width_px / 2) / intrinsics.focal_px
        v = (np.arange(config.height_px) + 0.5 - config.height_px / 2) / intrinsics.focal_px
        sin_yaw, cos_yaw = math.sin(pose.yaw_rad), math.cos(pose.yaw_rad)
        sin_pitch, cos_pitch = math.sin(pose.horizon_rad), math.cos(pose.horizon_rad)
        forward = np.array([sin_yaw * cos_pitch, -sin_pitch, cos_yaw * cos_pitch])
        right = np.array([cos_yaw, 0.0, -sin_yaw])
        up = np.array([sin_yaw * sin_pitch, cos_pitch, cos_yaw * sin_pitch])
        rays = forward + u[None, :, None] * right - v[:, None, None] * up
        origin = np.array([pose.x_m, config.camera_height_m, pose.z_m])
        enter, leave = -np.inf, np.inf
        with np.errstate(divide="ignore", invalid="ignore"):
            for axis in range(3):  # bodies first, then pixels
                ray = rays[..., axis]
                near = (self._low[:, axis] - origin[axis])[:, None, None] / ray
                far = (self._high[:, axis] - origin[axis])[:, None, None] / ray
                enter = np.fmax(enter, np.minimum(near, far))
                leave = np.fmin(leave, np.maximum(near, far))
        depth = np.where((enter <= leave) & (enter > 0.05), enter, np.inf)
        index = depth.argmin(axis=0)
        nearest = depth.min(axis=0)
        ids = np.where(np.isfinite(nearest), index + 1, 0).astype(np.int32)
        return Frame(
            pose=replace(pose, y_m=config.camera_height_m),
            intrinsics=intrinsics,
            depth_m=nearest.astype(np.float32),
            rgb=np.zeros((*ids.shape, 3), dtype=np.uint8) if rgb else None,
            instances=ids if instances else None,
        )

    def _cell(self, position_m):
        return math.floor(position_m[2] / CELL_M), math.floor(position_m[0] / CELL_M)

    def is_free(self, position_m):
        row, col = self._cell(position_m)
        rows, cols = self._blocked.shape
        return 0 <= row < rows and 0 <= col < cols and not self._blocked[row, col]

    def reachable_positions(self):
        rows, cols = np.nonzero(self._blocked == 0)
        return np.stack([(cols + 0.5) * CELL_M, np.full(len(rows), 0.9), (rows + 0.5) * CELL_M], axis=1)

    def nearest_reachable_position(self, position_m):
        free = self.reachable_positions()
        gaps = np.hypot(free[:, 0] - position_m[0], free[:, 2] - position_m[2])
        return tuple(float(value) for value in free[gaps.argmin()])

    def shortest_path(self, start_m, target_m):
        start = self._cell(start_m if self.is_free(start_m) else self.nearest_reachable_position(start_m))
        goal = self._cell(target_m if self.is_free(target_m) else self.nearest_reachable_position(target_m))
        blocked = np.pad(self._blocked, 1, constant_values=1).tolist()  # the pad also catches index -1
        cost, parent, queue = {start: 0.0}, {}, [(0.0, start)]
        while queue:
            so_far, cell = heapq.heappop(queue)
            if cell == goal:
                break
            for d_row, d_col in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
                after = (cell[0] + d_row, cell[1] + d_col)
                if blocked[after[0] + 1][after[1] + 1]:
                    continue
                length = so_far + math.hypot(d_row, d_col)
                if length < cost.get(after, math.inf):
                    cost[after], parent[after] = length, cell
                    heapq.heappush(queue, (length, after))
        if goal not in cost:
            return np.zeros((0, 3))
        cells = [goal]
        while cells[-1] != start:
            cells.append(parent[cells[-1]])
        points = [((col + 0.5) * CELL_M, 0.9, (row + 0.5) * CELL_M) for row, col in reversed(cells)]
        if self.is_free(start_m):
            points[0] = (start_m[0], 0.9, start_m[2])
        return np.array(points)

    def occupancy(self):
        return OccupancyGrid(cells=self._blocked.copy(), cell_m=CELL_M, corner_m=(0.0, 0.0))

    def close(self):
        pass


def make_simulator():
    return ToySimulator()


def stage_case(stage, target_id, *, moves=None, before=None, instruction=None, mode=None):
    """A stage of the toy house.

    Args:
        moves: Where objects are in this stage, id -> centre.
        before: The same for the previous stage.
    """
    category = OBJECTS[target_id][0]
    place = {key: (moves or {}).get(key, OBJECTS[key][1]) for key in OBJECTS}
    was = {key: (before or {}).get(key, OBJECTS[key][1]) for key in OBJECTS}
    text = instruction or f"Please navigate to the {category}."
    return StageSpec(
        public=Goal(stage, category, text, text, text, np.zeros((8, 8, 3), dtype=np.uint8)),
        house_json=house_json(moves),
        target=TargetRecord(
            object_id=target_id,
            category=category,
            position_m=place[target_id],
            room_id="room|1" if place[target_id][0] < 4.0 else "room|2",
            is_relocated=place[target_id] != OBJECTS[target_id][1],
            is_relocated_now=place[target_id] != was[target_id],
        ),
        transition=TransitionRecord(
            mode=mode,
            room_id="room|1" if mode else None,
            relocations=tuple(
                Relocation(object_id=key, category=OBJECTS[key][0], from_m=was[key], to_m=place[key])
                for key in OBJECTS
                if was[key] != place[key]
            ),
        ),
    )


CHAIR_AWAY = {"Chair|1": (7.5, 0.45, 2.0)}
TABLE_AWAY = {"DiningTable|1": (2.9, 0.4, 3.6), "Mug|1": (2.6, 0.87, 3.6)}


def moved_table_stages():
    """Return stages in which the house is seen, and the table moves while the agent is in the bedroom."""
    return (
        stage_case(1, "GarbageCan|1"),
        stage_case(2, "Fridge|1"),
        stage_case(3, "DiningTable|1", moves=TABLE_AWAY, mode="SALIENT_OBJECT"),
    )


EPISODES = {
    "toy-static": lambda: (stage_case(1, "Bed|1"), stage_case(2, "Fridge|1"), stage_case(3, "GarbageCan|1")),
    "toy-moved": lambda: (
        stage_case(1, "Chair|1"),
        stage_case(2, "Bed|1"),
        stage_case(3, "Chair|1", moves=CHAIR_AWAY, mode="SALIENT_OBJECT"),
    ),
}


def episode_spec(task_id):
    return EpisodeSpec(task_id=task_id, house="toy", start=Pose(1.0, 0.9, 3.0, 0.0), stages=EPISODES[task_id]())


def load_spec(path: Path):
    return episode_spec(path.name)


def write_tasks(directory: Path):
    """Headers that `task_files` finds; the contents are in `EPISODES`."""
    for task_id in EPISODES:
        (directory / task_id).mkdir(parents=True)
        header = {"task_id": task_id, "num_stages": len(EPISODES[task_id]())}
        (directory / task_id / "task.json").write_text(json.dumps(header))
