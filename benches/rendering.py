"""Images of bundled houses: the rasteriser against Embree's rays and OpenGL on llvmpipe."""

import os
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benches.table import Row, compare
from evonav.errors import SimulationError
from evonav.house import bundled_houses
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

NOTES = """Bundled houses, 20 poses in each drawn from the reachable positions, field of view 90 degrees, horizon 30.
All draw the same triangles, checked to see the same (depth within 1 mm and instance equal on 99.9% of the pixels).
Embree's time is its ray query alone, rays prepared beforehand; OpenGL's has the matrices, one draw call of one vertex
buffer with back faces culled, and the read-back. `LP_NUM_THREADS=0`: llvmpipe draws in the calling thread.
"""
NUM_HOUSES = 12
POSES_PER_HOUSE = 20

_Call = Callable[[int], tuple[NDArray[np.float32], NDArray[np.int32]]]


@dataclass(frozen=True)
class View:
    """One image to make."""

    house: int
    pose: Pose
    camera_from_world: NDArray[np.float64]
    """`(3, 3)`: right, down, forward."""
    position_m: NDArray[np.float64]


def run() -> list[Row]:
    """Times depth and instances, the same with colours, and both at 640x480."""
    os.environ["LP_NUM_THREADS"] = "0"
    rows: list[Row] = []
    for width_px, height_px in ((300, 300), (640, 480)):
        config = SimulatorConfig(width_px=width_px, height_px=height_px)
        simulators, views = _views(config)
        size = f"{width_px}x{height_px}"
        embree = _Embree(simulators, views, config)
        for rgb in (False, True):
            ours = _ours(simulators, views, rgb=rgb)
            opengl = _OpenGL(simulators, views, config, rgb=rgb)
            _require_same(ours, {"embreex": embree, "moderngl": opengl}, len(views))
            flat = ", flat colours" if rgb else ""
            peers = {
                f"embreex{', no colours' if rgb else ''}": embree,
                f"moderngl on {opengl.name}{flat}": opengl,
            }
            operation = f"depth + instances{' + shaded rgb' if rgb else ''}, {size}"
            rows += compare(operation, ours, peers, len(views), prepare=embree.prepare)
    return rows


def _views(config: SimulatorConfig) -> tuple[list[EmbeddedSimulator], list[View]]:
    random = np.random.default_rng(0)
    simulators, views = [], []
    for number, house in enumerate(bundled_houses(NUM_HOUSES)):
        simulator = EmbeddedSimulator(config)
        simulator.reset(house.to_json(), name=house.name)
        simulators.append(simulator)
        reachable_m = simulator.reachable_positions()
        for index in random.choice(len(reachable_m), POSES_PER_HOUSE):
            x_m, y_m, z_m = reachable_m[index].tolist()
            pose = Pose(x_m, y_m, z_m, yaw_rad=float(random.uniform(0, 2 * np.pi)))
            sin_y, cos_y = np.sin(pose.yaw_rad), np.cos(pose.yaw_rad)
            sin_p, cos_p = np.sin(pose.horizon_rad), np.cos(pose.horizon_rad)
            axes = np.array(
                [
                    [cos_y, 0, -sin_y],
                    [-sin_y * sin_p, -cos_p, -cos_y * sin_p],
                    [sin_y * cos_p, -sin_p, cos_y * cos_p],
                ]
            )
            views.append(View(number, pose, axes, np.array([x_m, config.camera_height_m, z_m])))
    return simulators, views


def _ours(simulators: list[EmbeddedSimulator], views: list[View], *, rgb: bool) -> _Call:
    def call(number: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        view = views[number]
        frame = simulators[view.house].render(view.pose, rgb=rgb)
        if frame.instances is None:
            raise SimulationError("no instances in a frame that was asked for them")
        return frame.depth_m, frame.instances

    return call


class _Embree:
    """Embree's closest hits, one ray a pixel."""

    def __init__(self, simulators: list[EmbeddedSimulator], views: list[View], config: SimulatorConfig) -> None:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh

        self.views, self.shape = views, (config.height_px, config.width_px)
        self.scenes, self.ids = [], []
        for simulator in simulators:
            triangles_m, bodies, _ = simulator.triangles()
            scene = rtcore_scene.EmbreeScene()
            TriangleMesh(scene, triangles_m.astype(np.float32))
            self.scenes.append(scene)
            self.ids.append(np.append(bodies + 1, 0).astype(np.int32))  # -1, nothing hit, is the last
        cols, rows = np.meshgrid(np.arange(config.width_px) + 0.5, np.arange(config.height_px) + 0.5)
        focal_px = simulators[0].intrinsics.focal_px
        right, down = (cols - config.width_px / 2) / focal_px, (rows - config.height_px / 2) / focal_px
        # Of length 1 along the optical axis, so that Embree's distance is planar depth.
        self.local = np.stack([right, down, np.ones_like(cols)], axis=-1).reshape(-1, 3)

    def prepare(self, number: int) -> None:
        """Not timed: the rays of a view."""
        view = self.views[number]
        self.directions = np.ascontiguousarray(self.local @ view.camera_from_world, dtype=np.float32)
        self.origins = np.tile(view.position_m.astype(np.float32), (len(self.local), 1))

    def __call__(self, number: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        house = self.views[number].house
        hits = self.scenes[house].run(self.origins, self.directions, output=1)
        instances = self.ids[house][hits["primID"]]
        return hits["tfar"].reshape(self.shape), instances.reshape(self.shape)


class _OpenGL:
    """One pass into a float, an integer and, if wanted, a colour target, then read back."""

    _VERTEX = """#version 330
        uniform mat3 axes; uniform vec3 eye; uniform vec2 scale; uniform vec2 range;
        in vec3 position; in int body; in vec3 colour;
        flat out int f_body; flat out vec3 f_colour; out float f_depth;
        void main() {
            vec3 local = axes * (position - eye);
            f_body = body; f_colour = colour; f_depth = local.z;
            // Rows run down in memory, so the image is drawn upside down.
            gl_Position = vec4(scale * local.xy, range.x * local.z + range.y, local.z);
        }"""
    _FRAGMENT = """#version 330
        flat in int f_body; flat in vec3 f_colour; in float f_depth;
        layout(location = 0) out float depth; layout(location = 1) out int body; %s
        void main() { depth = f_depth; body = f_body; %s }"""

    def __init__(
        self, simulators: list[EmbeddedSimulator], views: list[View], config: SimulatorConfig, *, rgb: bool
    ) -> None:
        import moderngl

        self.views, self.rgb, self.size = views, rgb, (config.width_px, config.height_px)
        self.context = moderngl.create_standalone_context(backend="egl")
        self.name = self.context.info["GL_RENDERER"]
        colour = ("layout(location = 2) out vec4 rgb;", "rgb = vec4(f_colour, 1.0);") if rgb else ("", "")
        self.program = self.context.program(self._VERTEX, self._FRAGMENT % colour)
        focal_px, near_m, far_m = simulators[0].intrinsics.focal_px, 0.1, 100.0
        self.program["scale"].value = (2 * focal_px / config.width_px, 2 * focal_px / config.height_px)
        self.program["range"].value = (
            (far_m + near_m) / (far_m - near_m),
            -2 * far_m * near_m / (far_m - near_m),
        )
        self.arrays = [self._upload(simulator) for simulator in simulators]
        targets = [(1, "f4"), (1, "i4"), (3, "f1")][: 3 if rgb else 2]
        textures = [self.context.texture(self.size, n, dtype=dtype) for n, dtype in targets]
        self.frame = self.context.framebuffer(textures, self.context.depth_renderbuffer(self.size))
        self.context.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        shape = self.size[::-1]
        self.depth_m = np.empty(shape, np.float32)
        self.ids = np.empty(shape, np.int32)
        self.colours = np.empty((*shape, 3), np.uint8)

    def _upload(self, simulator: EmbeddedSimulator) -> object:
        triangles_m, bodies, colours = simulator.triangles()
        record = np.dtype([("position", "f4", 3), ("body", "i4"), ("colour", "f4", 3)])
        vertices = np.empty((len(bodies), 3), record)
        vertices["position"] = triangles_m
        vertices["body"] = bodies[:, None] + 1
        vertices["colour"] = colours[:, None] / 255.0
        buffer = self.context.buffer(vertices.tobytes())
        names = [n for n in ("position", "body", "colour") if n in self.program]
        skip = "3f 1i 3f" if "colour" in names else "3f 1i 3x4"
        return self.context.vertex_array(self.program, [(buffer, skip, *names)])

    def __call__(self, number: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        view = self.views[number]
        self.program["axes"].write(view.camera_from_world.T.astype("f4").tobytes())
        self.program["eye"].value = tuple(view.position_m)
        self.frame.use()
        self.frame.clear(red=np.inf)
        self.arrays[view.house].render()
        self.frame.read_into(self.depth_m, components=1, attachment=0, dtype="f4")
        self.frame.read_into(self.ids, components=1, attachment=1, dtype="i4")
        if self.rgb:
            self.frame.read_into(self.colours, components=3, attachment=2, dtype="f1", alignment=1)
        return self.depth_m, self.ids


def _require_same(ours: _Call, peers: dict[str, _Call], num_views: int) -> None:
    """A comparison of different pictures would mean nothing."""
    for name, peer in peers.items():
        num_same = num_pixels = 0
        for number in range(0, num_views, 7):
            if isinstance(peer, _Embree):
                peer.prepare(number)
            depth_m, ids = ours(number)
            peer_depth_m, peer_ids = peer(number)
            is_near = np.isclose(depth_m, peer_depth_m, rtol=0.0, atol=1e-3)
            is_same = (ids == peer_ids) & (is_near | (ids == 0))
            num_same, num_pixels = num_same + int(is_same.sum()), num_pixels + is_same.size
        if num_same < 0.999 * num_pixels:
            raise SimulationError(f"{name} sees something else: {num_same} of {num_pixels} pixels agree")
