"""The streams of the memory benchmark: fixed, seeded and rendered while they are read (docs/memory-benchmark.md)."""

from evonav.memory_benchmark.streams.digest import digest
from evonav.memory_benchmark.streams.kinds import make_stream
from evonav.memory_benchmark.streams.rendered import RenderedStream
from evonav.memory_benchmark.streams.spec import KINDS, Kind, StreamSpec, reference_specs

__all__ = ["KINDS", "Kind", "RenderedStream", "StreamSpec", "digest", "make_stream", "reference_specs"]
