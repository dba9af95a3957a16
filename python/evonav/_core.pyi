"""Stub of the Rust extension; `mypy.stubtest evonav._core` holds it to the binary."""

from collections.abc import Sequence
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from evonav.agents.unigoal.bev import BevConfig
from evonav.drawing.pictures import Picture
from evonav.memory.objects import ObjectMapConfig, SeeThroughConfig, SightConfig
from evonav.memory.occupancy import FrontierConfig
from evonav.memory.presence import EvidenceConfig
from evonav.sensors.observation import MapFrame, View
from evonav.world.camera import CameraView
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, Intrinsics

__version__: str

class EvonavError(Exception): ...
class HouseError(EvonavError): ...
class TaskError(EvonavError): ...
class SimulationError(EvonavError): ...
class DecisionError(EvonavError): ...
class StoreError(EvonavError): ...
class InvalidArgumentError(EvonavError): ...

# house

_Vec2: TypeAlias = tuple[float, float]
_Vec3: TypeAlias = tuple[float, float, float]

@final
class House:
    """A ProcTHOR house (schema 0.0.1 or 1.0.0), checked; the document is stored without loss.

    Metres in AI2-THOR's frame: x right, y up, z forward.
    """

    def __new__(cls, json: str, *, name: str = "house") -> House:
        """Read and check one house; `HouseError` names house, object, field and value."""

    @property
    def name(self) -> str:
        """Name of the house in errors."""

    @property
    def start(self) -> tuple[_Vec3, float, float] | None:
        """Position, yaw and horizon (radians) of `metadata.agent`, if the file gives one."""

    @property
    def rooms(self) -> list[Room]:
        """Rooms, in file order."""

    @property
    def walls(self) -> list[Wall]:
        """Walls, in file order: inner walls once per room, outer ones twice."""

    @property
    def doors(self) -> list[Opening]:
        """Doors, in file order."""

    @property
    def windows(self) -> list[Opening]:
        """Windows, in file order."""

    @property
    def objects(self) -> list[HouseObject]:
        """Objects, depth first: a parent comes before its children."""

    def room_of(self, x_m: float, z_m: float) -> str | None:
        """Return the id of the room whose floor contains the point."""

    def to_json(self) -> str:
        """Return the document, compact: every key and value as it was read, in order."""

    def apply(self, delta_json: str) -> House:
        """Apply a `HouseDelta` (JSON), for example `{"moves": [{"id", "position_m", "rotation_deg", "parent"}]}`."""

    def footprints(
        self, *, allow_unknown_assets: bool
    ) -> list[tuple[str, str, list[tuple[list[_Vec2], float, float]]]]:
        """Return the footprint of each object on the floor plan, in order of `objects`.

        Id, category, and for each of its convex parts the outline `(x, z)`, the lowest and the highest point.
        `HouseError` if an asset is unknown, unless allowed: then it has the size and shape of its category.
        """

    def plot(self) -> Picture:
        """Draw the house from above, with the names of rooms and furniture."""

    def _repr_html_(self) -> str: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __getnewargs_ex__(self) -> tuple[tuple[str], dict[str, Any]]: ...

@final
class Room:
    """A room: its floor outline is a list of `(x, z)`."""

    id: str
    room_type: str
    polygon_m: list[_Vec2]

    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Wall:
    """One side of a wall; `room_id` is `exterior` on outer sides, `is_empty` means open plan."""

    id: str
    room_id: str
    from_m: _Vec2
    to_m: _Vec2
    height_m: float
    is_empty: bool

    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Opening:
    """A door or window; the hole is `(along, up)` in the frame of the first wall."""

    id: str
    asset_id: str
    wall_ids: tuple[str, str]
    room_ids: tuple[str, str]
    hole_min_m: _Vec2
    hole_max_m: _Vec2
    openness: float

    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class HouseObject:
    """An object; its position is its box's centre. `category` is None if it is unknown."""

    id: str
    asset_id: str
    category: str | None
    position_m: _Vec3
    rotation_deg: _Vec3
    parent_id: str | None
    child_ids: list[str]
    room_id: str | None

    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

def object_outlines(house: House) -> list[tuple[str, str, _Vec3, _Vec3, list[_Vec2], list[list[_Vec2]]]]:
    """Return the objects of a house as drawings show them, in order of `objects`, without those that have no parts.

    Id, category, centre and size of the axis-aligned box, its corners `(x, z)`, and the convex outlines of the parts,
    each once, lower ones first. Corners and outlines are rounded to the millimetre. Unknown assets have the size and
    shape of their category; `HouseError` if that is unknown, too.
    """

def assets() -> list[tuple[str, str, _Vec3]]:
    """Return id, category and box size in metres of every asset of the catalogue, ordered by id."""

# sensors

@final
class RunImage:
    """An `(H, W)` image of numbers as runs of equal pixels in its rows."""

    def __new__(cls, shape: tuple[int, int], ends: NDArray[np.int32]) -> RunImage:
        """Make an image of its height, its width and its `ends`."""

    @staticmethod
    def of(pixels: NDArray[np.int32]) -> RunImage:
        """Find the runs of an image."""

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""

    @property
    def ends(self) -> NDArray[np.int32]:
        """`(N, 2)` one past the last pixel of each run, in row-major order, and the number of its pixels."""

    def pixels(self) -> NDArray[np.int32]:
        """Return the `(H, W)` number of each pixel."""

    def __eq__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[type[RunImage], tuple[tuple[int, int], NDArray[np.int32]]]: ...

def visible_cells(
    blocked: NDArray[np.uint8],
    *,
    cell_m: float,
    corner_m: tuple[float, float],
    origin_m: tuple[float, float],
    yaw_rad: float,
    horizontal_fov_rad: float,
    range_m: float,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]: ...
def number_instances(
    instances: NDArray[np.int32] | RunImage,
    is_detectable: NDArray[np.bool_],
    *,
    min_area_px: int,
    max_box_fraction: float,
) -> tuple[RunImage, list[int]]: ...
def renumber_masks(masks: NDArray[np.int32] | RunImage, numbers: NDArray[np.int32]) -> RunImage:
    """Replace each detection of `(H, W)` masks by its new number, negative for none."""

def draw_normals(seed: int, labels: Sequence[Sequence[str]], *, num_draws: int) -> NDArray[np.float64]:
    """Draw standard normal numbers, `(N, num_draws)`: one row from each named stream."""

def mask_outlines(masks: NDArray[np.int32], depth_m: NDArray[np.float32], *, num_masks: int) -> NDArray[np.float64]:
    """Return `(num_masks, 3)`: sides of each mask's outline, cut sides (something nearer or the border), mean depth."""

def distort_masks(
    masks: NDArray[np.int32], changes: NDArray[np.int32], margins_px: NDArray[np.float64]
) -> NDArray[np.int32]:
    """Grow or shrink masks by their margins, then split, cut and renumber them.

    `changes` is `(N, 8)`: number, number of the rest, whether split by column, first row or column of the rest, then
    top, left, bottom and right that the mask is cut to.
    """

def surface_sites(
    frame: Frame,
    *,
    cell_m: float,
    stride_px: int,
    persistence: float,
    seed: int,
    lasting: Sequence[str],
    passing: Sequence[str],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Find the cells of the world with a surface in view.

    `(N, 2)` row and column, `(N, 5)` depth, latent, two lasting draws, one passing.
    """

def paint_blobs(
    masks: NDArray[np.int32],
    surfaces: NDArray[np.int32],
    blobs: NDArray[np.int64],
    radii_px: NDArray[np.float64],
) -> None:
    """Paint `(N, 3)` row, column, number with `(N, 2)` radii into `masks`, each only over its own surface."""

def noisy_depth(
    depth_m: NDArray[np.float32],
    *,
    sigma_m: float,
    sigma_per_m: float,
    step_per_m: float,
    dropout: float,
    edge_dropout: float,
    max_depth_m: float,
    seed: int,
    labels: Sequence[str],
) -> NDArray[np.float32]: ...
def instance_areas(instances: NDArray[np.int32] | RunImage, num_instances: int) -> NDArray[np.int64]:
    """Count the pixels of each instance, `(N,)`, of an `(H, W)` image: 0 where nothing is, else 1 + index."""

def mask_extents(masks: NDArray[np.int32] | RunImage, *, num_masks: int) -> NDArray[np.int64]:
    """Return `(num_masks, 5)`: pixels, left, top, right, bottom of each mask, right and bottom one past the last."""

def encode_png(rgb: NDArray[np.uint8]) -> bytes:
    """Encode an `(H, W, 3)` image as PNG, without metadata."""

def decode_png(file: bytes) -> NDArray[np.uint8]:
    """Decode the `(H, W, 3)` image of a PNG file; `InvalidArgumentError` if it is damaged, or not RGB of 8 bits."""

# memory

@final
class Frontier:
    """A frontier: a place from which to explore."""

    @property
    def id(self) -> int:
        """Id, never used twice by one map."""

    @property
    def position_m(self) -> tuple[float, float]:
        """View position, `(x, z)`."""

    @property
    def direction_rad(self) -> float:
        """Viewing direction, as a yaw."""

    @property
    def cells(self) -> NDArray[np.int32]:
        """Cells of the region, `(N, 2)` `[row, col]`, row-major."""

@final
class OccupancyMap:
    def __new__(cls, map_frame: MapFrame, config: FrontierConfig) -> OccupancyMap: ...
    def conflicts(
        self, free: NDArray[np.int32], blocked: NDArray[np.int32]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]: ...
    def integrate(
        self,
        free: NDArray[np.int32],
        blocked: NDArray[np.int32],
        *,
        origin_m: tuple[float, float],
        explored_range_m: float,
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]: ...
    def explore_around(self, centre_m: tuple[float, float], radius_m: float) -> None: ...
    def assume_free(self, centre_m: tuple[float, float], radius_m: float) -> None: ...
    def forget(self, cells: NDArray[np.int32]) -> None: ...
    def distances_m(self, start_m: tuple[float, float], targets_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the lengths of the shortest ways over free cells to targets, `(N,)`; `inf` if there is none."""

    def clear(self) -> None: ...
    def clear_frontiers(self) -> None: ...
    def update_frontiers(self, agent_m: tuple[float, float]) -> list[Frontier]: ...
    @property
    def frontiers(self) -> list[Frontier]: ...
    @property
    def cells(self) -> NDArray[np.uint8]: ...
    @property
    def explored(self) -> NDArray[np.bool_]: ...

@final
class ObjectEntry:
    """An object entry at the time of the call that returned it; while it does not change, the same one is returned."""

    @property
    def id(self) -> int:
        """Id, ascending from 1."""

    @property
    def label(self) -> str:
        """Label with the most detections."""

    @property
    def label_counts(self) -> list[tuple[str, int]]:
        """Number of detections by label, in the order of the labels' first detection."""

    @property
    def num_detections(self) -> int:
        """Number of detections that joined the entry."""

    @property
    def confidence(self) -> float:
        """Largest confidence of a detection."""

    @property
    def centre_m(self) -> tuple[float, float, float]:
        """Middle of the box around the points."""

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Edge lengths of the box around the points."""

    @property
    def num_points(self) -> int:
        """Number of points of the cloud."""

    @property
    def feature(self) -> NDArray[np.float32] | None:
        """Unit mean of the detections' features, `(D,)`; it cannot be written to."""

    @property
    def first_seen_stage(self) -> int:
        """Stage of the first detection."""

    @property
    def last_seen_stage(self) -> int:
        """Stage of the last detection."""

    @property
    def last_seen_view(self) -> int:
        """View of the last detection, counted from 1 since the map began."""

@final
class ObjectMap:
    def __new__(cls, config: ObjectMapConfig) -> ObjectMap: ...
    def update(self, view: View) -> tuple[list[int | None], list[int], list[tuple[int, int]]]: ...
    def compare(self, entry_id: int, view: View) -> NDArray[np.float64]: ...
    def visible_shares(
        self, targets_m: NDArray[np.float32], eyes_m: NDArray[np.float64], config: SightConfig
    ) -> NDArray[np.float64]: ...
    def depth_evidence(self, entry_ids: Sequence[int], view: View, config: EvidenceConfig) -> NDArray[np.uint32]: ...
    def in_view(self, view: View, max_distance_m: float) -> list[int]: ...
    def remove_seen_through(self, view: View, config: SeeThroughConfig) -> list[tuple[int, int, int]]: ...
    def num_bytes(self) -> int: ...
    def begin_stage(self, stage: int) -> None: ...
    def remove(self, entry_id: int) -> bool: ...
    def clear(self) -> None: ...
    def entry(self, entry_id: int) -> ObjectEntry | None: ...
    def points_m(self, entry_id: int) -> NDArray[np.float32] | None: ...
    def __len__(self) -> int: ...
    @property
    def num_views(self) -> int: ...
    @property
    def entries(self) -> list[ObjectEntry]: ...

# snapshots

def update_snapshots(
    objects: list[tuple[int, tuple[float, float]]],
    frames: list[list[tuple[int, float]]],
    snapshots: list[tuple[int, list[int]]],
    *,
    agent_m: tuple[float, float],
    reach_m: float,
) -> list[tuple[int, list[int]]]: ...

# planning

@final
class BevMap:
    """UniGoal's map; `evonav.agents.unigoal.bev` has shapes and units."""

    def __new__(cls, centre_m: tuple[float, float], num_categories: int, config: BevConfig) -> BevMap: ...
    def integrate(self, view: View, categories: NDArray[np.int32] | None) -> None: ...
    def cells_of(self, view: View, mask: NDArray[np.bool_]) -> NDArray[np.int32]:
        """Return the cells of the marked pixels `(H, W)` of a view, sorted, each once; at any height and distance."""
    def visit(self, from_m: tuple[float, float], to_m: tuple[float, float]) -> None: ...
    def collide(
        self, position_m: tuple[float, float], yaw_rad: float, *, start: int, length: int, width: int
    ) -> NDArray[np.int32]: ...
    def grown(self, cells: NDArray[np.int32], radius: int) -> NDArray[np.int32]:
        """Return the cells within `radius` cells of some, sorted, each once; those off the map are left out."""
    def frontiers(self, *, obstacle_radius: int, min_cells: int) -> NDArray[np.int32]: ...
    def choose_frontier(
        self,
        agent_m: tuple[float, float],
        goal_m: tuple[float, float] | None,
        *,
        frontier_obstacle_radius: int,
        min_cells: int,
        min_distance_m: float,
        span_m: float,
        path_obstacle_radius: int,
        margin: int,
    ) -> tuple[tuple[int, int], float, float | None, float] | None:
        """Return `[row, col]`, length of the path from the agent and from the goal, and score."""

    def plan(
        self,
        agent_m: tuple[float, float],
        goals: NDArray[np.int32],
        *,
        goal_radius: int,
        obstacle_radius: int,
        margin: int,
        circle: int,
        small_circle: int,
    ) -> tuple[float | None, float, tuple[float, float] | None]:
        """Return path length and straight distance to the nearest goal cell, and the point to move to."""

    def category(self, index: int) -> NDArray[np.float32]: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def corner_m(self) -> tuple[float, float]: ...
    @property
    def obstacles(self) -> NDArray[np.bool_]:
        """`(R, C)` copy: True where an obstacle was ever seen."""
    @property
    def explored(self) -> NDArray[np.bool_]:
        """`(R, C)` copy: True where anything was seen, at any height."""
    @property
    def visited(self) -> NDArray[np.bool_]:
        """`(R, C)` copy: True where the agent has been."""
    @property
    def collisions(self) -> NDArray[np.bool_]:
        """`(R, C)` copy: True where moves have failed."""

# camera

def unproject_image(depth_m: NDArray[np.float32], pose: Pose, intrinsics: Intrinsics) -> NDArray[np.float64]:
    """Return the world points `(H, W, 3)` of an `(H, W)` depth image."""

def unproject_masks(
    view: View, masks: NDArray[np.int32] | RunImage, *, num_detections: int, max_points: int
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return the world points `(N, 3)` behind all masks, mask by mask, and the index after each mask's last point."""

def project_points(points_m: NDArray[np.float64], pose: Pose, intrinsics: Intrinsics) -> NDArray[np.float64]:
    """Return column, row and planar depth `(N, 3)` of `(N, 3)` world points; NaN behind the camera."""

# nn

@final
class MiniNetwork:
    """The mini detector's network with its weights."""

    def __new__(cls, weights: bytes) -> MiniNetwork: ...
    @property
    def classes(self) -> list[str]: ...
    def logits(self, rgb: NDArray[np.uint8], depth_m: NDArray[np.float32], horizon_rad: float) -> NDArray[np.float32]:
        """Return `(75, 75, 1 + classes + 2)` logits: background, classes, links to the right and downwards."""

    def detect(
        self,
        rgb: NDArray[np.uint8],
        depth_m: NDArray[np.float32],
        horizon_rad: float,
        *,
        min_cells: int,
        min_confidence: float,
    ) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.float32]]:
        """Return `(H, W)` instance of each pixel or -1; class and confidence of each instance."""

# simulator

@final
class EmbeddedSimulator:
    """One house, instantiated. Points on the ground are `(x, z)`."""

    def __new__(
        cls,
        house_json: str,
        *,
        name: str,
        image_px: tuple[int, int],
        vertical_fov_rad: float,
        clip_m: tuple[float, float],
        camera_height_m: float,
        agent_radius_m: float,
        agent_height_m: float,
        allow_unknown_assets: bool,
        style: str,
    ) -> EmbeddedSimulator: ...
    def apply(self, delta_json: str) -> EmbeddedSimulator: ...
    def change_around(self, delta_json: str, *, agent_m: _Vec2, target_id: str) -> tuple[str, list[str]]:
        """Return the house (JSON) after a change around an agent at `(x, z)`, and the ids of what has to stay.

        What would touch the agent stays, with all that this forces to stay. If the agent would be shut in, or the
        target cut off, everything stays.
        """
    def with_look(self, changes_json: str, *, are_checked: bool) -> EmbeddedSimulator:
        """Return the same house in a random look (`evonav.world.appearance`); unless checked, unknown names are errors.

        It replaces an earlier look; an empty list is the house's own.
        """

    def num_materials(self) -> int:
        """Return the number of materials and assets from which the look's materials were drawn."""

    def house_json(self) -> str: ...
    def room_of(self, x_m: float, z_m: float) -> str | None:
        """Return the id of the room that contains a point, as `House.room_of`."""

    def bodies(self) -> list[tuple[str, str, str, tuple[float, float, float], tuple[float, float, float]]]:
        """Return id, category, kind, centre and size of the box of each body, in instance order."""

    def random_spawn(self, request_json: str) -> tuple[str, list[str]]:
        """Carry out a `SpawnRequest`; return the `HouseDelta` (both JSON) and the ids of objects without a place."""

    def settled(self) -> str:
        """Return the `HouseDelta` (JSON) that lets objects that hang in the air fall."""

    def start(self) -> tuple[tuple[float, float, float], float, float]:
        """Return position, yaw and horizon of the start pose."""

    def render(
        self, pose: Pose, *, rgb: bool, instances: bool
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8] | None, RunImage | None]:
        """Render depth `(H, W)`, colours `(H, W, 3)` and instances `(H, W)`."""

    def render_camera(
        self, view: CameraView, *, rgb: bool, instances: bool
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8] | None, NDArray[np.int32] | None]:
        """Render any view as `render` does; orthographic if it has a half height."""

    def visible_bodies(self, view: CameraView, *, agent_m: tuple[float, float], max_distance_m: float) -> list[int]:
        """Return the indices of the bodies that AI2-THOR calls visible, ascending."""

    def is_free(self, point_m: tuple[float, float]) -> bool: ...
    def is_reachable(self, point_m: tuple[float, float]) -> bool: ...
    def can_move(self, from_m: tuple[float, float], to_m: tuple[float, float]) -> bool: ...
    def blocker(self, from_m: tuple[float, float], to_m: tuple[float, float]) -> int | None: ...
    def is_visible(
        self, from_m: tuple[float, float, float], to_m: tuple[float, float, float], ignored: list[int]
    ) -> bool: ...
    def reachable_positions(self, from_m: tuple[float, float], grid_m: float) -> NDArray[np.float64]:
        """Return the reachable positions, `(N, 2)`."""

    def shortest_path(self, start_m: tuple[float, float], target_m: tuple[float, float]) -> NDArray[np.float64]:
        """Return the corners of the shortest path, `(M, 2)`; `(0, 2)` if there is none."""

    def distances_m(self, start_m: tuple[float, float], targets_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return path lengths `(N,)` to `(N, 2)` targets, `inf` if there is no path."""

    def occupancy(self, cell_m: float) -> tuple[NDArray[np.uint8], tuple[float, float]]:
        """Return the cells `(R, C)` and the corner of the grid."""
    def triangles(self) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.uint8]]:
        """Return corners `(N, 3, 3)`, body indices `(N,)` and colours `(N, 3)` of all surfaces."""

@final
class GeodesicField:
    """Shortest distances to one point of a house."""

    def __new__(cls, simulator: EmbeddedSimulator, source_m: tuple[float, float]) -> GeodesicField: ...
    def distance_m(self, point_m: tuple[float, float]) -> float:
        """Return the distance from a point, `inf` if there is no path."""

@final
class BatchSimulator:
    """B agents, each in its own or a shared house; `evonav_core::simulator::batch` has shapes and units."""

    def __new__(
        cls,
        num_slots: int,
        *,
        image_px: tuple[int, int],
        empty_depth_m: float,
        move_m: float,
        turn_rad: float,
        grid_m: float,
        min_area_px: int,
        num_threads: int,
    ) -> BatchSimulator: ...
    def place(
        self,
        slot: int,
        simulator: EmbeddedSimulator,
        pose: Pose,
        labels: NDArray[np.uint8] | None,
    ) -> None:
        """Put an agent into a house; `labels` `(bodies,)` is the label of each body's pixels, 0 or `None` for none."""

    def aim(self, slot: int, field: GeodesicField | None) -> None:
        """Set the goal of an agent, to which its distances are; without a goal they are `inf`."""

    def step(self, actions: NDArray[np.uint8]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Act, `(B,)`: 0 ahead, 1 left, 2 right, 3 stop. Return which were carried out and the distances after."""

    def plan(self, targets_m: list[tuple[float, float] | None]) -> list[list[tuple[float, float]]]:
        """Return the corners of a path for each agent; none if there is no path or no target."""

    def plan_one(self, slot: int, target_m: tuple[float, float]) -> list[tuple[float, float]]:
        """Return the path of one agent, as `plan`."""

    def follow(self, slot: int, stops: list[tuple[tuple[float, float], float]]) -> int:
        """Put an agent at points with yaws in turn; return the number of points at which it fits."""

    def distance_m(self, slot: int) -> float: ...
    def poses(self) -> NDArray[np.float64]:
        """Poses, `(B, 5)`: x, y, z, yaw and horizon."""

    def render(
        self,
        *,
        depth_m: NDArray[np.float32] | None,
        rgb: NDArray[np.uint8] | None,
        labels: NDArray[np.uint8] | None,
    ) -> None:
        """Write `(B, H, W)` depths, `(B, H, W, 3)` colours and `(B, H, W)` labels."""

def map_spec(house_json: str, *, name: str, cell_m: float) -> tuple[tuple[int, int], tuple[float, float]]:
    """Return shape `(R, C)` and corner `(x, z)` of `EmbeddedSimulator.occupancy`'s grid, without building objects."""

# drawing

def outlines(polygons_m: Sequence[Sequence[_Vec2]]) -> list[str]:
    """Return SVG path data of closed polygons in whole centimetres, relative; z is up the page."""

def label_point(
    polygon_m: Sequence[_Vec2], num: int, *, taken_m: Sequence[tuple[float, float, float, float]], size_m: _Vec2
) -> _Vec2:
    """Return where in a polygon a label stands best, of `num * num` places: over little, far from the edges.

    `taken_m` are boxes that a label of `size_m` should not cover. NaN without corners or places.
    """

# resampling

def draw_counts(state: int, increment: int, *, num_clusters: int, num_resamples: int) -> tuple[NDArray[np.uint8], int]:
    """Draw how often each cluster is in each resample, with replacement: the counts of NumPy's `multinomial`.

    Args:
        state: State of a `np.random.PCG64`.
        increment: Its increment.
        num_clusters: C, the number of clusters and of draws in a resample.
        num_resamples: R.

    Returns:
        `(R, C)` counts, and the state behind them.
    """

# evolution

def default_generation_parameters() -> str:
    """Return the paper's generation parameters (JSON)."""

def generate_task(
    house: House,
    *,
    seed: int,
    label: str,
    parameters_json: str,
    allow_unknown_assets: bool,
    given_json: str = "{}",
) -> tuple[str, list[str], list[bytes]]: ...

# houses from seeds

@final
class HouseMaker:
    """Makes ProcTHOR houses from seeds; it has no state, so threads may share one."""

    def __new__(cls, parameters_json: str) -> HouseMaker:
        """Read parameters (JSON); what is left out has its default. `InvalidArgumentError` names a wrong field."""

    def make(self, seed: int, index: int) -> str:
        """Make the house of a seed and a number, as ProcTHOR JSON of schema 1.0.0: the same one on every call.

        Raises:
            SimulationError: No house passes the checks: the rooms of the parameters hardly fit.
        """

def default_house_parameters() -> str:
    """Return ProcTHOR's parameters of houses (JSON)."""

# validation

def inspect_house(source: House, stage: House, *, touch_m: float, rest_m: float, allow_unknown_assets: bool) -> str:
    """Return findings (JSON): `kind`, `id`, `other_id`, `amount_m`, `is_own` (the source house has the same one)."""

# vectors

def has_wide_vectors() -> bool:
    """Return whether kernels compute with AVX2; not if `EVONAV_NARROW_VECTORS` is set, by which tests compare both."""
