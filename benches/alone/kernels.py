"""Single operations beside parts of their work, and beside passes over the same memory."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import faiss
import gymnasium
import numpy as np

import evonav.gym  # noqa: F401 - it registers the environment
from benches import memory
from benches.alone.row import Alone, Figure, in_turn, sums
from evonav import _core
from evonav.house import bundled_houses
from evonav.memory import OccupancyMap
from evonav.sensors.observation import MapFrame
from evonav.sensors.visibility import visible_occupancy
from evonav.speed_benchmark.grid_search import DistanceField, grid_of
from evonav.speed_benchmark.gym import ACTIONS, ENV_ID, SETTINGS
from evonav.speed_benchmark.image_peers import image_peers
from evonav.speed_benchmark.timing import Sampling, cpu_ms, one_core
from evonav.speed_benchmark.views import views_of_houses
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

NUM_HOUSES, LEAST_OF = 6, 5
TINY_PX = 8
NUM_FLOORS, NUM_MAPS, NUM_PLACES = 100, 3, 10
ENVIRONMENTS, NUM_ROUNDS = ((2, 256), (64, 16)), 6
"""Numbers of environments, with their steps in a turn, and the number of turns."""
PEER = "peer"


def rows() -> Iterator[str]:
    """The rows of images, memory, navigation and environments."""
    with one_core():
        yield from _images(128, None, "0.05 ms", aim_ms=0.05)
        yield from _images(300, None, "7 times llvmpipe", times=7)
        yield from _images(300, "plain", "4 times llvmpipe", times=4)
        yield from _default_images()
        yield from _frontiers()
        yield from _next_frontiers()
        yield from _objects()
        yield from _distances()
    for num_envs, num_steps in ENVIRONMENTS:
        yield from _environments(num_envs, num_steps)


def _images(side_px: int, style: str | None, aim: str, *, times: int = 1, aim_ms: float | None = None) -> Iterator[str]:
    """An image, the same view in a few pixels, and the same arrays filled."""
    rgb = style is not None
    config = SimulatorConfig(width_px=side_px, height_px=side_px, **({"style": style} if style else {}))
    simulators, views = views_of_houses(config, NUM_HOUSES)
    shape = (side_px, side_px)
    arrays = [np.empty(shape, np.float32), np.empty(shape, np.int32), *([np.empty((*shape, 3), np.uint8)] * rgb)]
    calls: dict[str, Callable[[int], object]] = {
        "image": lambda number: simulators[views[number].house].render_camera(views[number].camera, rgb=rgb),
        "tiny": lambda number: simulators[views[number].house].render_camera(tiny[number], rgb=rgb),
        "filled": lambda _: [array.fill(1) for array in arrays],
    }
    tiny = [replace(view.camera, width_px=TINY_PX, height_px=TINY_PX) for view in views]
    if aim_ms is None:
        ((_, drawn),) = image_peers(Sampling(peers=("moderngl",)), simulators, views, config, rgb=rgb).items()
        calls[PEER] = drawn
    found = in_turn(calls, len(views), least_of=LEAST_OF)
    aims = [one / times for one in found[PEER]] if aim_ms is None else [aim_ms] * len(views)
    work = f"depth + instances{f' + colours, {style}' if style else ''}, {side_px}x{side_px}"
    yield from Figure(work, found["image"], aim, aims).rows(
        Alone(f"the same views in {TINY_PX}x{TINY_PX} pixels", found["tiny"], "filling polygons, images"),
        Alone("the arrays filled with one number by NumPy", found["filled"], "all drawing"),
        Alone("both", sums(found["tiny"], found["filled"]), "depth tests: which surface each pixel shows"),
    )


def _default_images() -> Iterator[str]:
    """Textures and light come on top of plain colours."""
    config = SimulatorConfig(style="default")
    simulators, views = views_of_houses(config, NUM_HOUSES)
    flat, _ = views_of_houses(replace(config, style="plain"), NUM_HOUSES)

    def draw(of: Sequence[EmbeddedSimulator], *, rgb: bool) -> Callable[[int], object]:
        return lambda number: of[views[number].house].render_camera(views[number].camera, rgb=rgb)

    calls = {"default": draw(simulators, rgb=True), "plain": draw(flat, rgb=True), "depth": draw(flat, rgb=False)}
    found = in_turn(calls, len(views), least_of=LEAST_OF)
    aim_ms = [2.5 * one for one in found["depth"]]
    work, aim = "depth + instances + colours, default, 300x300", "2.5 times depth + instances"
    yield from Figure(work, found["default"], aim, aim_ms).rows(
        Alone("the same views in plain colours", found["plain"], "textures, light, shadows, edges"),
        Alone("depth + instances", found["depth"], "all colours"),
    )


def _frontiers() -> Iterator[str]:
    """Frontiers of a whole map, and passes over it."""
    seen = memory.explored_floor()
    free, explored = (seen.cells == 1).astype(np.uint8), seen.explored
    unexplored = (~explored).astype(np.uint8)
    listed = [frontier.cells for frontier in seen.update_frontiers(memory.AGENT_M)]
    little = OccupancyMap(MapFrame(*free.shape, 0.1, (0.0, 0.0)))
    _look(little, 0)

    def update(of: OccupancyMap) -> Callable[[int], object]:
        return lambda _: (of.clear_frontiers(), of.update_frontiers(memory.AGENT_M))

    calls = {
        "all": update(seen),
        PEER: lambda _: memory.frontiers_opencv(free, unexplored, memory.AGENT_CELL),
        "little": update(little),
        "lists": lambda _: [cells.copy() for cells in listed],
        "pass": lambda _: np.packbits(explored),
    }
    found = in_turn(calls, NUM_FLOORS, least_of=LEAST_OF)
    aim_ms = [one / 20 for one in found[PEER]]
    yield from Figure("frontiers, 400x400", found["all"], "20 times OpenCV", aim_ms).rows(
        Alone("a map of this size after one view", found["little"], "all but one room's regions"),
        Alone("a pass over the explored cells (NumPy's packbits)", found["pass"], "all computing"),
        Alone("the regions' cells copied", found["lists"], "finding them"),
    )


def _look(at: OccupancyMap, number: int) -> None:
    """Adds a view of the floor, one of 40 directions."""
    pose = Pose(memory.AGENT_M[0], 0.0, memory.AGENT_M[1], 2 * np.pi * number / 40)
    at.integrate(visible_occupancy(FLOOR, pose, SimulatorConfig().intrinsics, 3.0), memory.AGENT_M)


FLOOR = memory.floor()


def _next_frontiers() -> Iterator[str]:
    """Frontiers after a view more, and again without one."""
    seen = memory.explored_floor()
    seen.update_frontiers(memory.AGENT_M)

    def update(_: int) -> object:
        return seen.update_frontiers(memory.AGENT_M)

    next_ms, same_ms = [], []
    for number in range(NUM_FLOORS):
        _look(seen, number)
        next_ms.append(cpu_ms(update, number))
        same_ms.append(cpu_ms(update, number))
    yield from Figure("frontiers after one view more", next_ms, "0.03 ms", [0.03] * len(next_ms)).rows(
        Alone("the same call without a view more", same_ms, "what a view changes")
    )


def _objects() -> Iterator[str]:
    """One view of 20 objects into a map of 100."""
    view, looks = memory.frame(), memory.looks_at_boxes()
    maps = [memory.full_map(looks) for _ in range(NUM_MAPS)]
    config, num, entry = maps[0].config, len(view.detections.labels), maps[0].entries[0].id
    stored = memory.clouds_of(maps[0])
    faiss.omp_set_num_threads(1)
    masks = view.detections.masks
    calls = {
        "update": lambda number: maps[number].update(view),
        PEER: lambda _: memory.associate_open3d(stored, view, config),
        "detections": lambda number: maps[number].compare(entry, view),
        "points": lambda _: _core.unproject_masks(view, masks, num_detections=num, max_points=config.max_points),
    }
    found = in_turn(calls, NUM_MAPS)
    work = "object memory, 20 masks, 100 entries, 0.01 m"
    aim_ms = [min(1.5, one / 600) for one in found[PEER]]
    yield from Figure(work, found["update"], "1.5 ms and 600 times Open3D + faiss", aim_ms).rows(
        Alone("its detections, compared with one entry", found["detections"], "the other entries, merging"),
        Alone("the points of its masks", found["points"], "voxels, clusters, all entries"),
    )


def _distances() -> Iterator[str]:
    """Distances from a place to all reachable positions, and walks over them."""
    random, simulators, fields, starts = np.random.default_rng(0), [], [], []
    for house, one in enumerate(bundled_houses(NUM_HOUSES)):
        simulators.append(EmbeddedSimulator())
        simulators[-1].reset(one.to_json())
        grid = grid_of(one.to_json())
        fields.append((grid, DistanceField(grid)))
        reachable_m = simulators[-1].reachable_positions()
        starts += [(house, tuple(place)) for place in random.choice(reachable_m, NUM_PLACES).tolist()]
    targets_m = [one.reachable_positions() for one in simulators]
    ground_m = [[(x_m, z_m) for x_m, _, z_m in targets.tolist()] for targets in targets_m]
    can_move = [one.core.can_move for one in simulators]

    def of_house(call: Callable[[int, Any], object]) -> Callable[[int], object]:
        return lambda number: call(*starts[number])

    calls = {
        "all": of_house(lambda house, place: simulators[house].path_lengths_m(place, targets_m[house])),
        PEER: of_house(lambda house, place: fields[house][1](fields[house][0].cell(place))),
        "walk": of_house(lambda house, place: simulators[house].core.reachable_positions(place[::2], 0.25)),
        "lines": of_house(lambda house, place: [can_move[house](place[::2], one) for one in ground_m[house]]),
        "straight": of_house(lambda house, place: np.linalg.norm(targets_m[house] - place, axis=1)),
    }
    found = in_turn(calls, len(starts), least_of=LEAST_OF)
    aim_ms = [one / 5 for one in found[PEER]]
    yield from Figure("distances to all reachable positions", found["all"], "5 times SciPy", aim_ms).rows(
        Alone("the core's walk over these positions", found["walk"], "lengths: shortest ways around corners"),
        Alone("a straight walk to each, by a call from Python", found["lines"], "ways around corners"),
        Alone("straight distances by NumPy", found["straight"], "all obstacles"),
    )


def _environments(num_envs: int, num_steps: int) -> Iterator[str]:
    """Steps of a vector environment, and its images alone."""
    random = np.random.default_rng(0)
    actions = random.choice(4, p=ACTIONS, size=(NUM_ROUNDS, num_steps, num_envs))
    own = gymnasium.make_vec(ENV_ID, num_envs=num_envs, num_threads=2, **SETTINGS)
    sync = gymnasium.make_vec(ENV_ID, num_envs=num_envs, vectorization_mode="sync", **SETTINGS)
    for envs in (own, sync):
        envs.reset(seed=0)
        envs.step(actions[0, 0])

    def steps(envs: Any) -> Callable[[int], object]:  # noqa: ANN401 - of any kind
        return lambda number: [envs.step(one) for one in actions[number]]

    calls = {
        "steps": steps(own),
        "sync": steps(sync),
        "images": lambda _: [own.unwrapped.observations() for _ in range(num_steps)],
    }
    found = {name: [one / num_steps for one in times_ms] for name, times_ms in in_turn(calls, NUM_ROUNDS).items()}
    own.close()
    sync.close()
    aim_ms = [one / 3 for one in found["sync"]]
    work = f"a step of a vector environment of {num_envs}, 128x128 depth"
    yield from Figure(work, found["steps"], "3 times Gymnasium's sync", aim_ms).rows(
        Alone("its observations again: the images drawn", found["images"], "moves, rewards, new houses")
    )
