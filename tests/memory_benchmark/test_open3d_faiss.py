"""The peer made of Open3D and faiss takes the same detections for the same things as our object map does."""

from collections import Counter
from importlib.util import find_spec
from itertools import islice

import pytest

from evonav.errors import StoreError
from evonav.memory_benchmark import open3d_faiss
from evonav.memory_benchmark.open3d_faiss import Open3DFaissMemory
from evonav.memory_benchmark.references import ObjectMapMemory
from evonav.memory_benchmark.run import MeasureSettings, measure
from evonav.memory_benchmark.streams import make_stream
from evonav.memory_benchmark.streams.spec import StreamSpec

HAS_PEER = find_spec("open3d") is not None and find_spec("faiss") is not None
NUM_FRAMES = 24


@pytest.mark.skipif(HAS_PEER, reason="the extra `bench` is installed")
def test_without_the_extra_the_memory_names_it():
    open3d_faiss._open3d.cache_clear()
    with pytest.raises(StoreError, match=r"pip install 'evonav\[bench\]'"):
        Open3DFaissMemory()
    stream = make_stream(StreamSpec("S6", "bundled:4", 0, 64, 48))
    failure = measure(Open3DFaissMemory, stream, MeasureSettings(own_process=False)).failure
    assert failure is not None
    assert failure.kind == "load"


@pytest.mark.skipif(not HAS_PEER, reason="needs the extra `bench`")
def test_it_associates_as_the_object_map_does():
    stream = make_stream(StreamSpec("S0", "bundled:4", 0, 160, 120, frames_a_visit=NUM_FRAMES))
    ours, theirs = ObjectMapMemory("never"), Open3DFaissMemory()
    for memory in (ours, theirs):
        memory.reset(stream.info)
    pairs: Counter[tuple[int, int]] = Counter()
    num_one_sided = 0
    for frame, _ in islice(stream.frames(), NUM_FRAMES):
        update = ours.map.update(frame.view)
        theirs.observe(frame)
        for our_id, their_id in zip(update.entry_ids, theirs.entry_ids, strict=True):
            if our_id is not None and their_id is not None:
                pairs[our_id, their_id] += 1
            num_one_sided += (our_id is None) != (their_id is None)
    num = sum(pairs.values())
    assert num > 50
    assert num_one_sided < 0.1 * num
    best = {our_id: max(count for (one, _), count in pairs.items() if one == our_id) for our_id, _ in pairs}
    assert sum(best.values()) >= 0.95 * num
    assert 0.8 < len(theirs.entries()) / len(ours.map.entries) < 1.25
    assert theirs.num_bytes() > 0
    label = theirs.entries()[0].label
    assert theirs.locate(label, 3)
    theirs.reset(stream.info)
    assert theirs.entries() == []
