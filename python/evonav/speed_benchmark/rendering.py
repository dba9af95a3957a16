"""Images of bundled houses: the rasteriser against Embree's rays and OpenGL on llvmpipe."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from evonav.errors import SimulationError
from evonav.speed_benchmark.image_peers import Embree, OpenGL, Renderer, image_peers, our_renderer, views_of_houses
from evonav.speed_benchmark.timing import Row, Sampling, compare
from evonav.world.simulator import SimulatorConfig

NAME, TITLE = "render", "Rendering"
NOTES = """\
Bundled houses, 20 poses in each, 90 degrees. All draw the same triangles, and images are checked to be the same.
Embree's time is its ray query alone; OpenGL's is one draw call and the read-back.
"""
NUM_HOUSES = 12
SIZES_PX = ((300, 300), (640, 480))


def measure(sampling: Sampling) -> Iterator[Row]:
    """Yield the times of depth and instances, and of the same with colours, at 300x300 and 640x480.

    Raises:
        SimulationError: A peer draws something else.
        StoreError: A named peer is not installed.
    """
    for width_px, height_px in SIZES_PX:
        config = SimulatorConfig(width_px=width_px, height_px=height_px)
        simulators, views = views_of_houses(config, sampling.limit or NUM_HOUSES)
        for rgb in (False, True):
            ours = our_renderer(simulators, views, rgb=rgb)
            peers = image_peers(sampling, simulators, views, config, rgb=rgb)
            require_same(ours, peers, len(views))
            operation = f"depth + instances{' + shaded rgb' if rgb else ''}, {width_px}x{height_px}"
            houses = [view.name for view in views]
            yield from compare(operation, ours, peers, houses, sampling=sampling, prepare=prepare_all(peers))


def prepare_all(peers: Mapping[str, Embree | OpenGL]) -> Callable[[int], None]:
    """Return what prepares a view for all peers; not timed."""

    def prepare(number: int) -> None:
        for peer in peers.values():
            peer.prepare(number)

    return prepare


def require_same(ours: Renderer, peers: Mapping[str, Embree | OpenGL], num_views: int) -> None:
    """Check every seventh view, since a comparison of different pictures would mean nothing.

    Raises:
        SimulationError: A peer draws something else.
    """
    for name, peer in peers.items():
        num_same = num_pixels = 0
        for number in range(0, num_views, 7):
            peer.prepare(number)
            depth_m, ids = ours(number)
            peer_depth_m, peer_ids = peer(number)
            is_near = np.isclose(depth_m, peer_depth_m, rtol=0.0, atol=1e-3)
            is_same = (ids == peer_ids) & (is_near | (ids == 0))
            num_same, num_pixels = num_same + int(is_same.sum()), num_pixels + is_same.size
        if num_same < 0.999 * num_pixels:
            raise SimulationError(f"{name} sees something else: {num_same} of {num_pixels} pixels agree")
