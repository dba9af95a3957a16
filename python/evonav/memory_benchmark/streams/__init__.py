"""The streams of the memory benchmark: fixed, seeded and rendered while they are read (docs/memory-benchmark.md)."""

import json
from dataclasses import asdict, replace

from evonav._core import House
from evonav.memory_benchmark.streams.glances import glances
from evonav.memory_benchmark.streams.growth import growth, growth_houses
from evonav.memory_benchmark.streams.plan import StreamPlan, cached_plan
from evonav.memory_benchmark.streams.rendered import RenderedStream
from evonav.memory_benchmark.streams.spec import StreamSpec, read_house
from evonav.memory_benchmark.streams.visits import during_visit, visits
from evonav.tasks.records import sha256_of


def make_stream(spec: StreamSpec, *, rgb: bool = False) -> RenderedStream:
    """Return a stream; its plan comes from the cache folder, or is made and stored there.

    Args:
        rgb: Whether frames have colours, which cost more than the rest.

    Raises:
        HouseError: The house cannot be read, or gives no stream of this kind.
    """
    return RenderedStream(spec, plan_of(spec), rgb=rgb)


def plan_of(spec: StreamSpec) -> StreamPlan:
    """Return a stream's plan, from the cache folder if it is there.

    Raises:
        HouseError: The house cannot be read, or gives no stream of this kind.
    """
    house = read_house(spec.house)
    # Errors of perception change neither houses nor walks.
    decides = asdict(replace(spec, kind=spec.walk_kind, perception=""))
    houses = growth_houses(spec, house) if spec.kind == "S7" else [house]
    digests = sha256_of(json.dumps([one.to_json() for one in houses]).encode())
    return cached_plan({"spec": decides, "houses": digests}, lambda: make_plan(spec, house))


def make_plan(spec: StreamSpec, house: House) -> StreamPlan:
    """Make the plan of a stream that begins in a house, without the cache.

    Raises:
        HouseError: The house gives no stream of this kind.
    """
    if spec.kind == "S7":
        return growth(spec, growth_houses(spec, house))
    return {"S6": glances, "S9": during_visit}.get(spec.kind, visits)(spec, house)
