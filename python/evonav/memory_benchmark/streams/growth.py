"""Plan tours of houses side by side, until a number of objects has been seen (S7)."""

from itertools import cycle, islice

from evonav._core import House
from evonav.house.files import stream_houses
from evonav.memory_benchmark.streams.evidence import visible_px
from evonav.memory_benchmark.streams.plan import PlannedScene, StreamPlan
from evonav.memory_benchmark.streams.spec import MIN_ROOMS, StreamSpec, source_of
from evonav.memory_benchmark.streams.visits import generator_of, walk_in
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.world.embedded import EmbeddedSimulator

GAP_M = 5.0
"""Free space between two houses, more than the range of evidence."""
MAX_TOURS = 200
"""Number of houses after which a stream ends, however few objects there are to see."""
_GROUND_TRUTH = GroundTruthPerception()


def growth_houses(spec: StreamSpec, first: House) -> list[House]:
    """Return a house, and after it all others of its file with at least three rooms, in an order drawn by the seed."""
    others = [
        one
        for one in stream_houses(source_of(spec.house))
        if len(one.rooms) >= MIN_ROOMS and one.to_json() != first.to_json()
    ]
    order = generator_of("S7", spec.house_name, spec.seed, "houses").permutation(len(others))
    return [first, *(others[index] for index in order)]


def growth(spec: StreamSpec, houses: list[House]) -> StreamPlan:
    """Plan one long visit that goes from house to house, from the first again after the last.

    An object is seen at the first frame in which ground-truth perception reports it in the range of evidence.
    """
    plan, seen, right_m = StreamPlan([], []), set[str](), 0.0
    simulator = EmbeddedSimulator(spec.camera, allow_unknown_assets=spec.allow_unknown_assets)
    for number, house in enumerate(cycle(houses)):
        house_json = house.to_json()
        simulator.reset(house_json)
        left_m = min(body.centre_m[0] - body.size_m[0] / 2.0 for body in simulator.objects)
        end_m = max(body.centre_m[0] + body.size_m[0] / 2.0 for body in simulator.objects)
        prefix = f"{number}/"
        plan.scenes.append(PlannedScene(house_json, (right_m - left_m, 0.0), prefix))
        right_m += end_m - left_m + GAP_M
        for pose in islice(walk_in(spec, house_json, None, f"house {number}"), spec.frames_a_visit):
            plan.add(number, 1, [pose])
            frame = simulator.render(pose, rgb=False)
            least_px = _GROUND_TRUTH.min_px(frame)
            seen |= {prefix + one for one, px in visible_px(frame, simulator.objects).items() if px >= least_px}
            if len(seen) >= spec.max_objects:
                return plan
        if len(plan.scenes) > MAX_TOURS:
            break
    return plan
