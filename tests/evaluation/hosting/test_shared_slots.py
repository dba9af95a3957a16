"""Arrays in memory that two processes share: they arrive as they are, and what an agent keeps never changes."""

import mmap
import os
import subprocess
import sys
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evonav._core import RunImage
from evonav.agents.hosting.requests import read_request, write_request
from evonav.agents.hosting.shared_slots import LEAST_BYTES, NUM_SLOTS, SharedSlots
from evonav.evaluation.hosting.channel import SharedBlock
from evonav.sensors.observation import Detections, Observation, View, VisibleOccupancy
from evonav.world.pose import Pose
from evonav.world.run_images import unexpanded
from evonav.world.simulator import Intrinsics

LARGE = LEAST_BYTES // 4
"""Number of float32 in a request whose arrays are not copied."""
KINDS = ("<f4", ">f4", "<i4", "|u1", "|b1", "<f8")
SHAPES = ((), (3,), (0, 2), (5, 4), (2, 3, 4), (LARGE,), (2, LARGE))


@dataclass(frozen=True)
class Shown:
    """An array of a round, and what the agent does with it."""

    kind: str
    shape: tuple[int, ...]
    layout: str
    is_writable: bool
    then: str

    def array(self, rng):
        found = rng.integers(0, 100, (*self.shape, 2)).astype(self.kind)[..., 0]
        if self.layout != "gaps":
            found = np.array(found, order=self.layout)
        found.flags.writeable = self.is_writable
        return found


ROUNDS = st.lists(
    st.lists(
        st.builds(
            Shown,
            st.sampled_from(KINDS),
            st.sampled_from(SHAPES),
            st.sampled_from(["C", "F", "gaps"]),
            st.booleans(),
            st.sampled_from(["drop", "drop", "keep", "keep a part", "change"]),
        ),
        max_size=4,
    ),
    max_size=12,
)


@given(ROUNDS, st.integers(0, 2**32 - 1), st.booleans())
def test_arrays_arrive_as_they_are_and_belong_to_the_agent(rounds, seed, saves_memory):
    rng = np.random.default_rng(seed)
    with closing(SharedBlock(saves_memory=saves_memory)) as block:
        slots, kept = SharedSlots(block.descriptor), []
        for wanted in rounds:
            sent = [one.array(rng) for one in wanted]
            copies = [array.copy("K") for array in sent]
            seen = slots.arrays(block.write(sent))
            for one, array, copy in zip(wanted, seen, copies, strict=True):
                assert np.array_equal(array, copy)
                assert (array.dtype, array.flags.writeable) == (copy.dtype, one.is_writable)
                assert array.flags.fnc == copy.flags.fnc
                if one.then == "change" and one.is_writable:
                    array[...] = 1
                elif one.then == "keep":
                    kept.append((array, copy))
                elif one.then == "keep a part":
                    kept.append((array.ravel("K")[:1].view(), copy.ravel("K")[:1]))
            assert all(np.array_equal(array, copy) for array, copy in zip(sent, copies, strict=True) if array.size)
            seen = array = None
            block.free = slots.free
            assert all(np.array_equal(array, copy) for array, copy in kept)


@pytest.fixture
def sides():
    with closing(SharedBlock()) as block:
        yield block, SharedSlots(block.descriptor)


def shown(sides, number, size=LARGE):
    """Show an array of the number, in the slot that the agent has named last."""
    block, slots = sides
    (array,) = slots.arrays(block.write([np.full(size, number, np.float32)]))
    return array


def answer(sides):
    block, slots = sides
    block.free = slots.free


@pytest.mark.parametrize("num_kept", [0, 1])
def test_nothing_is_copied_for_an_agent_that_keeps_little(sides, num_kept):
    kept = []
    for number in range(10):
        kept.append(shown(sides, number))
        assert kept[-1].base is not None
        kept = kept[len(kept) - num_kept :]
        answer(sides)


def test_small_requests_are_copied_and_keep_no_slot(sides):
    kept = []
    for number in range(10):
        kept.append(shown(sides, number, LARGE // 2))
        answer(sides)
        assert sides[0].free == 0
    assert [array[0] for array in kept] == list(range(10))


def test_who_keeps_everything_has_it_in_its_own_memory(sides):
    kept = []
    for number in range(10):
        kept.append(shown(sides, number))
        answer(sides)
    assert [array.base is None for array in kept] == [False] * (NUM_SLOTS - 1) + [True] * (11 - NUM_SLOTS)
    assert [array[0] for array in kept] == list(range(10))
    assert os.fstat(sides[0].descriptor).st_blocks * 512 <= NUM_SLOTS * LARGE * 4 + 4096
    del kept[1], kept[0]
    answer(sides)
    assert shown(sides, 10).base is not None


def test_slots_grow(sides):
    for number, size in enumerate([LARGE, 40 * LARGE, 3 * LARGE, 41 * LARGE]):
        array = shown(sides, number, size)
        assert (array[0], array[-1], array.size) == (number, number, size)
        del array
        answer(sides)


@pytest.mark.skipif(not hasattr(mmap, "MADV_REMOVE"), reason="only Linux gives back a part of a file's memory")
def test_memory_that_a_smaller_request_leaves_is_given_back():
    with closing(SharedBlock(saves_memory=True)) as block:
        sides = block, SharedSlots(block.descriptor)
        for size in (LARGE, 40 * LARGE, 3 * LARGE, 3 * LARGE - 1, 41 * LARGE, LARGE):
            assert shown(sides, size % 7, size)[-1] == size % 7
            answer(sides)
            assert 0 <= os.fstat(block.descriptor).st_blocks * 512 - size * 4 < 2 * mmap.PAGESIZE, size


FORKING = """
import os, sys
import numpy as np
from evonav.agents.hosting.shared_slots import LEAST_BYTES, SharedSlots
from evonav.evaluation.hosting.channel import SharedBlock

block = SharedBlock()
slots = SharedSlots(block.descriptor)
os.register_at_fork(before=slots.part)
(array,) = slots.arrays(block.write([np.zeros(LEAST_BYTES, np.uint8)]))
array[0] = 1
to_parent, from_child = os.pipe(), os.pipe()
pid = os.fork()
if pid == 0:
    array[1] = 2
    os.write(to_parent[1], b"x")
    os.read(from_child[0], 1)
    os._exit(int(array[:4].tolist() != [1, 2, 0, 0]))
os.read(to_parent[0], 1)
assert array[:4].tolist() == [1, 0, 0, 0], array[:4]
array[2] = 3
if os.fork() == 0:  # does not undo what was written since the first one
    os._exit(int(array[:4].tolist() != [1, 0, 3, 0]))
assert os.wait()[1] == 0
assert array[:4].tolist() == [1, 0, 3, 0], array[:4]
del array  # the first child still has it
for _ in range(5):
    block.free = slots.free
    slots.arrays(block.write([np.full(LEAST_BYTES, 9, np.uint8)]))
os.write(from_child[1], b"x")
assert os.wait()[1] == 0
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_child_and_its_parent_have_arrays_of_their_own():
    subprocess.run([sys.executable, "-c", FORKING], check=True, timeout=60.0)


def observed(rng, *, num_views=2, features=None, rgb=None):
    def view(number):
        return View(
            pose=Pose(*rng.random(5)),
            intrinsics=Intrinsics(4, 3, 1.5),
            depth_m=rng.random((3, 4), dtype=np.float32),
            detections=Detections(np.full((3, 4), number), ("Mug",), rng.random(1, dtype=np.float32), features),
            occupancy=VisibleOccupancy(np.full((5, 2), number), np.full((0, 2), number)),
            rgb=rgb,
        )

    feature = None if features is None else features[0]
    return Observation(tuple(map(view, range(num_views))), Pose(*rng.random(5)), True, 3, False, True, feature)


class OddView(View):
    """A view of a type that nobody knows here."""


class OddObservation(Observation):
    """The same of an observation."""


@pytest.mark.parametrize("num_views", [0, 1, 3])
@pytest.mark.parametrize("how", ["plain", "runs", "everything", "odd views", "odd arrays", "odd"])
def test_observations_are_read_as_written(sides, how, num_views):
    rng = np.random.default_rng(0)
    features, rgb = rng.random((2, 7), dtype=np.float32), rng.integers(0, 9, (3, 4, 3), np.uint8)
    seen = observed(rng, num_views=num_views, **({"features": features, "rgb": rgb} if how == "everything" else {}))
    if how == "odd views":
        odd = [OddView(*(getattr(view, name) for name in View.__dataclass_fields__)) for view in seen.views[1:]]
        seen = replace(seen, views=(*seen.views[:1], *odd))
    elif how == "runs":
        masks = unexpanded(RunImage.of(np.array([[0, 0, -1, -1], [0, 0, 0, 0], [-1, 0, -1, 0]], np.int32)))
        detections = Detections(masks, ("Mug",), rng.random(1, dtype=np.float32))
        seen = replace(seen, views=tuple(replace(view, detections=detections) for view in seen.views))
    elif how == "odd arrays":
        detections = Detections(np.ma.masked_array([1, 2]), ["Mug"], (0.5,), np.array([None, "x"]))
        seen = replace(seen, views=tuple(replace(view, detections=detections) for view in seen.views))
    elif how == "odd":
        seen = OddObservation(*(getattr(seen, name) for name in Observation.__dataclass_fields__))
    block, slots = sides
    number, operation, (read,) = read_request(write_request(7, "act", (seen,), block.write), slots.arrays)
    assert (number, operation) == (7, "act")
    assert all((type(view.detections.stored_masks) is RunImage) == (how == "runs") for view in read.views)
    assert (type(read), repr(read), list(map(type, read.views))) == (
        type(seen),
        repr(seen),
        list(map(type, seen.views)),
    )
    for one, other in zip((seen, *seen.views), (read, *read.views), strict=True):
        assert told(one) == told(other)


def told(thing):
    """Return all that there is to a thing of dataclasses and arrays, as a text."""
    if hasattr(thing, "__dataclass_fields__"):
        return f"{type(thing).__name__}({[told(getattr(thing, name)) for name in thing.__dataclass_fields__]})"
    if isinstance(thing, np.ndarray):
        return f"{type(thing).__name__} {thing.dtype} {thing.tolist()}"
    return str([told(one) for one in thing]) if isinstance(thing, tuple | list) and thing else repr(thing)


def test_other_requests_may_have_arrays_anywhere(sides):
    block, slots = sides
    images = [np.arange(12, dtype=np.uint8).reshape(4, 3), np.zeros((0, 3)), np.asfortranarray(np.ones((4, 3)))]
    request = write_request(1, "make", ("path", {"images": images}), block.write)
    number, operation, (path, options) = read_request(request, slots.arrays)
    assert (number, operation, path) == (1, "make", "path")
    assert told(options["images"]) == told(images)
    assert all(image.flags.writeable for image in options["images"])
