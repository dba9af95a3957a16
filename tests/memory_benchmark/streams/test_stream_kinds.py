"""What happens in each kind of stream, on a small bundled house."""

import gc
import itertools
import types
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from stream_digest import digest

from evonav.evaluation.episode.staleness import EVIDENCE_RANGE_M
from evonav.memory_benchmark.protocol import MemoryFrame, StreamInfo
from evonav.memory_benchmark.streams import make_stream
from evonav.memory_benchmark.streams.glances import MAX_GLANCES
from evonav.memory_benchmark.streams.spec import StreamSpec
from evonav.memory_benchmark.truth import FrameTruth, TrueChange
from evonav.tasks.language import STRUCTURE_TYPES
from evonav.world.simulator import Frame, SceneObject

HOUSE = "bundled:4"
SMALL = StreamSpec("S0", HOUSE, frames_a_visit=30)


def small(kind: str, **values) -> StreamSpec:
    return replace(SMALL, kind=kind, **values)


def steps_of(stream):
    """Lengths in metres and turns in degrees from each frame to the next of the same visit."""
    for (before, visit), (after, next_visit) in itertools.pairwise(
        (frame.view.pose, frame.visit) for frame, _ in stream.frames()
    ):
        if visit == next_visit:
            way_m = np.hypot(after.x_m - before.x_m, after.z_m - before.z_m)
            yield way_m, abs((after.yaw_deg - before.yaw_deg + 180.0) % 360.0 - 180.0)


def test_a_static_stream_is_one_walk_through_all_rooms():
    stream = make_stream(small("S0", frames_a_visit=120))
    assert not stream.changes
    assert (stream.kind, stream.house, stream.name) == ("S0", "bundled-0004", "S0/bundled-0004/0")
    frames = list(stream.frames())
    assert [frame.index for frame, _ in frames] == list(range(120))
    assert [frame.time_s for frame, _ in frames] == [index / 2.0 for index in range(120)]
    assert {frame.visit for frame, _ in frames} == {1}
    assert all(way_m <= 0.5 + 1e-9 and turn_deg <= 60.0 for way_m, turn_deg in steps_of(stream))
    seen = set().union(*(truth.visible_px for _, truth in frames))
    assert len(seen) > 0.5 * len(frames[0][1].objects)
    assert not any(truth.empty_px for _, truth in frames)
    assert frames[0][1].objects is frames[-1][1].objects
    assert not {body.category for body in frames[0][1].objects} & set(STRUCTURE_TYPES)


def test_views_are_posed_depth_with_detections_and_no_colours_unless_asked_for():
    frame, truth = next(make_stream(SMALL).frames())
    assert frame.view.depth_m.shape == (300, 300)
    assert frame.view.depth_m.dtype == np.float32
    assert frame.view.rgb is None
    assert set(frame.view.detections.labels) <= set(make_stream(SMALL).info.labels)
    assert len(frame.view.detections.labels) == len(truth.detected_ids) == frame.view.detections.masks.max() + 1
    coloured, _ = next(make_stream(SMALL, rgb=True).frames())
    assert coloured.view.rgb.shape == (300, 300, 3)
    assert np.array_equal(coloured.view.depth_m, frame.view.depth_m)


@pytest.mark.parametrize("kind", ["S1", "S2", "S3"])
def test_the_papers_modifications_happen_between_four_visits(kind):
    stream = make_stream(small(kind))
    starts = [frame.index for frame, _ in stream.frames() if frame.index % 30 == 0]
    assert [frame.visit for frame, _ in stream.frames()] == [1 + index // 30 for index in range(120)]
    assert {change.kind for change in stream.changes} == {"moved"}
    assert {change.frame for change in stream.changes} == set(starts[1:])
    times_s = [frame.time_s for frame, _ in stream.frames()]
    assert times_s[30] - times_s[29] == 4 * 3600.0
    for change in stream.changes:
        assert np.linalg.norm(np.subtract(change.before.centre_m, change.after.centre_m)) > 0.05
        assert change.label == change.before.category == change.after.category


def test_more_moves_when_a_room_is_shuffled_than_when_one_object_moves():
    numbers = [len(make_stream(small(kind, frames_a_visit=2)).changes) for kind in ("S1", "S3")]
    assert numbers[0] < numbers[1]


def test_the_truth_follows_the_changes():
    stream = make_stream(small("S3"))
    present: dict[str, SceneObject] | None = None
    for frame, truth in stream.frames():
        now = {body.id: body for body in truth.objects}
        for change in stream.changes:
            if change.frame == frame.index and present is not None:
                assert present.get(change.object_id) == change.before
                assert now.get(change.object_id) == change.after
        present = now
    assert any(truth.empty_px for _, truth in stream.frames())


def test_things_come_and_go():
    stream = make_stream(small("S4"))
    kinds = Counter(change.kind for change in stream.changes)
    assert kinds.keys() == {"added", "removed"}
    assert all((change.before is None) == (change.kind == "added") for change in stream.changes)
    assert all((change.after is None) == (change.kind == "removed") for change in stream.changes)


def test_ten_visits_of_daily_activities():
    stream = make_stream(small("S5", frames_a_visit=4))
    assert [frame.visit for frame, _ in stream.frames()] == [1 + index // 4 for index in range(40)]
    assert stream.changes


def test_a_changed_place_is_glanced_at():
    stream = make_stream(small("S6", frames_a_visit=40))
    old = {number for number, change in enumerate(stream.changes) if change.before is not None}
    counts: Counter[tuple[int, object]] = Counter()
    moved: set[str] = set()
    for index, (_, visible, empty) in enumerate(stream.evidence(range_m=np.inf)):
        moved |= {change.object_id for change in stream.changes if change.frame == index and change.after is not None}
        visit = stream.plan.frames[index].visit
        counts.update((visit, place) for place in empty)
        counts.update((visit, one) for one in visible if one in moved)
    assert counts
    assert set(counts.values()) <= set(range(1, MAX_GLANCES + 1))
    assert {place for _, place in counts if isinstance(place, int)} <= old
    num_frames = Counter(frame.visit for frame in stream.plan.frames)
    assert num_frames[1] == 40
    assert all(0 < num_frames[visit] <= 40 for visit in (2, 3, 4))


def test_growth_ends_when_so_many_objects_have_been_seen():
    seen: set[str] = set()
    numbers = []
    for frame, truth in make_stream(small("S7", max_objects=120, frames_a_visit=40)).frames():
        assert frame.visit == 1
        seen |= {one for one, number in truth.visible_px.items() if number >= 90}
        numbers.append(len(seen))
    assert numbers[-1] >= 120 > numbers[-2]


def test_houses_side_by_side_do_not_overlap():
    stream = make_stream(small("S7", max_objects=120, frames_a_visit=40))
    _, truth = next(stream.frames())
    extents: dict[str, list[float]] = {}
    for body in truth.objects:
        reach = extents.setdefault(body.id.partition("/")[0], [np.inf, -np.inf])
        reach[0] = min(reach[0], body.centre_m[0] - body.size_m[0] / 2)
        reach[1] = max(reach[1], body.centre_m[0] + body.size_m[0] / 2)
    assert len(extents) == len(stream.plan.scenes) > 1
    for (_, right), (left, _) in itertools.pairwise(sorted(extents.values())):
        assert left - right > EVIDENCE_RANGE_M
    assert len({body.id for body in truth.objects}) == len(truth.objects)


def test_perception_errs_in_s8_and_the_truth_does_not():
    plain = list(make_stream(small("S2")).frames())
    poor = list(make_stream(small("S8", perception="noisy:poor")).frames())
    assert [truth.visible_px for _, truth in plain] == [truth.visible_px for _, truth in poor]
    assert plain[0][0].view.pose == poor[0][0].view.pose
    assert plain[-1][0].view.pose != poor[-1][0].view.pose
    found = [one for _, truth in poor for one in truth.detected_ids]
    assert None in found
    assert any(one is not None for one in found)
    assert all(None not in truth.detected_ids for _, truth in plain)


def test_noisy_perfect_is_ground_truth():
    for (one, _), (other, _) in zip(
        make_stream(SMALL).frames(), make_stream(replace(SMALL, perception="noisy:perfect")).frames(), strict=True
    ):
        assert np.array_equal(one.view.detections.masks, other.view.detections.masks)
        assert one.view.detections.labels == other.view.detections.labels


@pytest.mark.parametrize("seed", [0, 1])
def test_things_move_during_the_visit_in_view_or_not(seed):
    stream = make_stream(small("S9", seed=seed))
    (moment,) = {change.frame for change in stream.changes}
    assert 24 <= moment <= 36
    assert {frame.visit for frame, _ in stream.frames()} == {1}
    assert len(stream.plan.frames) == 60
    truths = [truth for _, truth in stream.frames()]
    assert truths[moment - 1].objects != truths[moment].objects
    assert all(way_m <= 1.0 for way_m, _ in steps_of(stream))
    places = {change.object_id for change in stream.changes}
    in_view = any(truths[at].visible_px.keys() & places for at in (moment - 1, moment)) or truths[moment].empty_px
    assert bool(in_view) == (seed % 2 == 0)


@pytest.mark.parametrize("kind", ["S1", "S6", "S8", "S9"])
def test_a_stream_is_the_same_whenever_it_is_read(kind, tmp_path, monkeypatch):
    spec = small(kind, frames_a_visit=8, perception="noisy:poor" if kind == "S8" else "gt")
    stream = make_stream(spec)
    first = digest(stream)
    assert first == digest(stream)
    monkeypatch.setenv("EVONAV_CACHE", str(tmp_path))
    assert first == digest(make_stream(spec))
    assert first != digest(make_stream(replace(spec, seed=1)))


def test_a_small_stream_has_the_digest_that_it_had():
    spec = StreamSpec("S3", HOUSE, frames_a_visit=6)
    assert digest(make_stream(spec)) == "d6f70f97bb0e065014467a1d245a96d11102343a5b606485984acab6c661f7b8"


def reachable(root):
    """Everything that the garbage collector and the bases of arrays lead to, code left out."""
    code = (type, types.ModuleType, types.FunctionType, types.BuiltinFunctionType, types.MethodType)
    seen, pending = {}, [root]
    while pending:
        thing = pending.pop()
        if id(thing) in seen or isinstance(thing, code):
            continue
        seen[id(thing)] = thing
        pending.extend(gc.get_referents(thing))
        if isinstance(thing, np.ndarray) and thing.base is not None:
            pending.append(thing.base)
        pending.extend(getattr(thing, slot, None) for slot in getattr(type(thing), "__slots__", ()))
    return list(seen.values())


@pytest.mark.parametrize("perception", ["gt", "noisy:poor"])
def test_a_memory_cannot_reach_the_truth(perception):
    stream = make_stream(small("S2", frames_a_visit=3, perception=perception))
    ids = {body.id for _, truth in stream.frames() for body in truth.objects}
    for frame, _ in stream.frames():
        for root in (frame, stream.info):
            found = reachable(root)
            assert isinstance(root, MemoryFrame | StreamInfo)
            assert not [one for one in found if isinstance(one, SceneObject | TrueChange | FrameTruth | Frame)]
            assert not ids & {one for one in found if isinstance(one, str)}
            instances = [one for one in found if isinstance(one, np.ndarray) and one.dtype == np.int32 and one.size > 9]
            assert all(image.max() < len(frame.view.detections.labels) for image in instances)
