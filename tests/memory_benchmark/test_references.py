"""The reference memories: each does what the protocol asks, on a real simulated house and on hand-made views."""

import math
from dataclasses import replace

import numpy as np
import pytest

import evonav
from evonav.errors import InvalidArgumentError
from evonav.memory_benchmark.benchmark import MEMORIES
from evonav.memory_benchmark.protocol import MemoryFrame, StreamInfo
from evonav.memory_benchmark.references import NumpyList, ObjectMapMemory
from evonav.sensors.observation import Detections, View, VisibleOccupancy
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

INTRINSICS = Intrinsics(60, 60, math.pi / 2)
INFO = StreamInfo(INTRINSICS, ("Cup", "Bowl"), 2.0)
DAY_S = 86400.0


def a_frame(index: int, *labelled: tuple[str, int], time_s: float | None = None) -> MemoryFrame:
    """A wall 2.4 m ahead with squares of 10 pixels before it, each with a label and its first column."""
    depth, masks = np.full((60, 60), 2.4, np.float32), np.full((60, 60), -1, np.int32)
    for number, (_, col) in enumerate(labelled):
        depth[25:35, col : col + 10], masks[25:35, col : col + 10] = 2.0, number
    labels = tuple(label for label, _ in labelled)
    found = Detections(masks, labels, np.full(len(labels), 0.8, np.float32))
    none = np.zeros((0, 2), np.int32)
    view = View(Pose(0.0, 1.5, 0.0, 0.0, 0.0), INTRINSICS, depth, found, VisibleOccupancy(none, none))
    return MemoryFrame(index, 0.5 * index if time_s is None else time_s, 1, view)


@pytest.mark.parametrize("name", MEMORIES)
def test_a_reference_remembers_a_house_and_says_where_things_are(name: str) -> None:
    simulator = evonav.Simulator(evonav.load_houses()[2])
    memory = MEMORIES[name].create()
    views = []
    for _ in range(12):
        views.append(simulator.look(rgb=False))
        simulator.step("TURN_LEFT")
    memory.reset(StreamInfo(views[0].intrinsics, (), 2.0))
    for visit in (1, 2):
        memory.visit((visit - 1) * DAY_S)
        for index, view in enumerate(views):
            number = (visit - 1) * len(views) + index
            memory.observe(MemoryFrame(number, (visit - 1) * DAY_S + 0.5 * index, visit, view))
    entries = memory.entries()
    labels = {label for view in views for label in view.detections.labels}
    assert len(entries) >= 3
    assert {entry.label for entry in entries} <= labels
    for entry in entries:
        assert entry.first_seen_s is not None
        assert entry.last_seen_s is not None
        assert 0.0 <= entry.first_seen_s <= entry.last_seen_s
        assert entry.last_seen_s >= DAY_S
        assert all(math.isfinite(value) for value in (*entry.centre_m, *entry.size_m))
        assert min(entry.size_m) >= 0.0
        places = memory.locate(entry.label, len(entries))  # type: ignore[attr-defined]  # all references can
        assert entry.centre_m in [place.position_m for place in places]
    assert memory.locate("Unicorn", 5) == []  # type: ignore[attr-defined]
    assert memory.num_bytes() > 100 * len(entries)  # type: ignore[attr-defined]
    assert (entries[0].p_present is not None) == (name == "bayes")
    memory.reset(StreamInfo(views[0].intrinsics, (), 2.0))
    assert list(memory.entries()) == []


def test_the_same_frames_make_the_same_entries() -> None:
    def entries(name: str) -> object:
        memory = MEMORIES[name].create()
        memory.reset(INFO)
        for index in range(6):
            memory.observe(a_frame(index, ("Cup", 10), ("Bowl", 30 + index)))
        return memory.entries()

    for name in MEMORIES:
        assert entries(name) == entries(name)


def test_the_times_are_those_of_the_frames_that_support_an_entry() -> None:
    memory = ObjectMapMemory("never")
    memory.reset(INFO)
    for index in range(2, 5):
        memory.observe(a_frame(index, ("Cup", 10)))
    memory.observe(a_frame(5))
    (entry,) = memory.entries()
    assert (entry.first_seen_s, entry.last_seen_s) == (1.0, 2.0)
    assert entry.confidence == pytest.approx(0.8)


def test_what_a_rule_forgets_is_no_entry_any_more() -> None:
    memory = ObjectMapMemory("failed-look")
    memory.reset(INFO)
    memory.observe(a_frame(0, ("Cup", 10)))
    memory.observe(a_frame(1, ("Cup", 10)))
    memory.observe(a_frame(2, ("Cup", 40)))
    (entry,) = memory.entries()
    assert entry.centre_m[0] > 0.5
    assert len(memory.locate("Cup", 5)) == 1


def test_an_unknown_rule_or_option_is_refused_at_once() -> None:
    with pytest.raises(InvalidArgumentError, match="did you mean `bayes`"):
        ObjectMapMemory("baies")
    with pytest.raises(InvalidArgumentError, match="no option"):
        ObjectMapMemory("bayes", rate=1.0)


def test_the_most_probable_place_comes_first() -> None:
    memory = ObjectMapMemory("bayes", min_p=0.0)
    memory.reset(INFO)
    for index in range(3):
        memory.observe(a_frame(index, ("Cup", 5)))
    for index in range(3, 5):
        memory.observe(a_frame(index, ("Cup", 40)))
    first, second = memory.locate("Cup", 5)
    assert first.position_m[0] > second.position_m[0]
    assert first.score > 0.9 > second.score
    assert memory.locate("Cup", 1) == [first]


def test_the_list_joins_a_detection_to_the_nearest_entry_of_its_label_within_half_a_metre() -> None:
    memory = NumpyList()
    memory.reset(INFO)
    memory.observe(a_frame(0, ("Cup", 5), ("Bowl", 20)))
    memory.observe(a_frame(1, ("Cup", 11)))  # 0.4 m to the right
    cup, bowl = memory.entries()
    assert (cup.label, bowl.label) == ("Cup", "Bowl")
    assert (cup.first_seen_s, cup.last_seen_s, bowl.last_seen_s) == (0.0, 0.5, 0.0)
    assert cup.centre_m[0] == pytest.approx((16 - 30) / 30 * 2.0)
    assert cup.size_m[0] == pytest.approx(9 / 30 * 2.0)
    memory.observe(a_frame(2, ("Cup", 45)))
    assert [entry.label for entry in memory.entries()] == ["Cup", "Bowl", "Cup"]
    assert memory.locate("Cup", 1)[0].position_m[0] > 0.0  # the one seen last


def test_the_list_leaves_out_detections_without_a_depth() -> None:
    memory = NumpyList()
    memory.reset(INFO)
    frame = a_frame(0, ("Cup", 5))
    frame.view.depth_m[:] = np.inf
    memory.observe(replace(frame))
    assert memory.entries() == []
