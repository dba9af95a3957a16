"""Views of bundled houses, and the renderers that draw them: ours, Embree's rays, and OpenGL on llvmpipe."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.component import optional_module
from evonav.errors import SimulationError
from evonav.house import bundled_houses
from evonav.speed_benchmark.timing import INSTALL, Sampling
from evonav.world.camera import CameraView, camera_axes
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

POSES_PER_HOUSE = 20

Images = tuple[NDArray[np.float32], NDArray[np.int32]]
"""Depth and instances."""
Renderer = Callable[[int], Images]
"""Draws the view of a number."""


@dataclass(frozen=True)
class RenderedView:
    """One image to make."""

    house: int
    """Number of the house's simulator."""
    name: str
    """Name of the house."""
    camera: CameraView
    camera_from_world: NDArray[np.float64]
    """`(3, 3)`: right, down, forward."""
    position_m: NDArray[np.float64]


def views_of_houses(config: SimulatorConfig, num_houses: int) -> tuple[list[EmbeddedSimulator], list[RenderedView]]:
    """Return a simulator a house, and 20 views in each from reachable positions, always the same."""
    random = np.random.default_rng(0)
    simulators, views = [], []
    for number, house in enumerate(bundled_houses(num_houses)):
        simulator = EmbeddedSimulator(config)
        simulator.reset(house.to_json(), name=house.name)
        simulators.append(simulator)
        reachable_m = simulator.reachable_positions()
        for index in random.choice(len(reachable_m), POSES_PER_HOUSE):
            x_m, y_m, z_m = reachable_m[index].tolist()
            pose = Pose(x_m, y_m, z_m, yaw_rad=float(random.uniform(0, 2 * np.pi)))
            axes = camera_axes(pose) * [[1.0], [-1.0], [1.0]]  # down, where its own point up
            camera = CameraView(
                replace(pose, y_m=config.camera_height_m),
                config.width_px,
                config.height_px,
                config.intrinsics.vertical_fov_rad,
                config.near_m,
                config.far_m,
            )
            position_m = np.array(camera.pose.position_m)
            views.append(RenderedView(number, house.name or str(number), camera, axes, position_m))
    return simulators, views


def our_renderer(simulators: Sequence[EmbeddedSimulator], views: Sequence[RenderedView], *, rgb: bool) -> Renderer:
    """Return what draws a view with evonav's rasteriser."""

    def call(number: int) -> Images:
        view = views[number]
        images = simulators[view.house].render_camera(view.camera, rgb=rgb)
        if images.instances is None:
            raise SimulationError("no instances in images that were asked for them")
        return images.depth_m, images.instances

    return call


def image_peers(
    sampling: Sampling,
    simulators: Sequence[EmbeddedSimulator],
    views: Sequence[RenderedView],
    config: SimulatorConfig,
    *,
    rgb: bool,
) -> "dict[str, Embree | OpenGL]":
    """Return the peers that are to be run, by name; one that cannot start is left out, unless it was named.

    Raises:
        StoreError: A named peer is not installed.
    """
    peers: dict[str, Embree | OpenGL] = {}
    for name in sampling.chosen(("embreex", "moderngl")):
        if name == "embreex":
            peers[f"embreex{', no colours' if rgb else ''}"] = Embree(simulators, views, config)
            continue
        try:
            opengl = OpenGL(simulators, views, config, rgb=rgb)
        except Exception as error:  # drivers and window systems fail in many ways
            if sampling.peers is not None:
                raise
            sampling.left_out[name] = f"it cannot start: {error}"
            continue
        peers[f"moderngl on {opengl.name}{', flat colours' if rgb else ''}"] = opengl
    return peers


class Embree:
    """Embree's closest hits, one ray a pixel."""

    def __init__(
        self, simulators: Sequence[EmbeddedSimulator], views: Sequence[RenderedView], config: SimulatorConfig
    ) -> None:
        rtcore_scene = optional_module("embreex.rtcore_scene", "the peer embreex needs its library", INSTALL)
        meshes = optional_module("embreex.mesh_construction", "the peer embreex needs its library", INSTALL)
        self.views, self.shape = views, (config.height_px, config.width_px)
        self.scenes, self.ids = [], []
        for simulator in simulators:
            triangles_m, bodies, _ = simulator.triangles()
            scene = rtcore_scene.EmbreeScene()
            meshes.TriangleMesh(scene, triangles_m.astype(np.float32))
            self.scenes.append(scene)
            self.ids.append(np.append(bodies + 1, 0).astype(np.int32))  # -1, nothing hit, is the last
        cols, rows = np.meshgrid(np.arange(config.width_px) + 0.5, np.arange(config.height_px) + 0.5)
        focal_px = simulators[0].intrinsics.focal_px
        right, down = (cols - config.width_px / 2) / focal_px, (rows - config.height_px / 2) / focal_px
        # Of length 1 along the optical axis, so that Embree's distance is planar depth.
        self.local = np.stack([right, down, np.ones_like(cols)], axis=-1).reshape(-1, 3)

    def prepare(self, number: int) -> None:
        """Make the rays of a view."""
        view = self.views[number]
        self.directions = np.ascontiguousarray(self.local @ view.camera_from_world, dtype=np.float32)
        self.origins = np.tile(view.position_m.astype(np.float32), (len(self.local), 1))

    def __call__(self, number: int) -> Images:
        """Return the closest hits."""
        house = self.views[number].house
        hits = self.scenes[house].run(self.origins, self.directions, output=1)
        instances = self.ids[house][hits["primID"]]
        return hits["tfar"].reshape(self.shape), instances.reshape(self.shape)


class OpenGL:
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
        self,
        simulators: Sequence[EmbeddedSimulator],
        views: Sequence[RenderedView],
        config: SimulatorConfig,
        *,
        rgb: bool,
    ) -> None:
        os.environ["LP_NUM_THREADS"] = "0"  # llvmpipe draws in the calling thread
        moderngl = optional_module("moderngl", "the peer moderngl needs its library", INSTALL)
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

    def _upload(self, simulator: EmbeddedSimulator) -> Any:  # noqa: ANN401 - a vertex array of moderngl
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

    def prepare(self, number: int) -> None:
        """Do nothing; the matrices are part of drawing."""

    def __call__(self, number: int) -> Images:
        """Draw and read back."""
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
