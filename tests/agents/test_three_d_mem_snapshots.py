"""Snapshots follow the views and entries that they are made of."""

import math
from types import SimpleNamespace

from evonav.agents.three_d_mem.agent import SnapshotMemory
from evonav.memory.views import Seen, StoredView, ViewStore
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics


def look(views, *entry_ids):
    """Keeps a view of entries; `None` is a detection that was filtered out."""
    seen = tuple(Seen(entry_id, "Thing", 1.0, 100, (0, 0, 10, 10)) for entry_id in entry_ids)
    view = StoredView(len(views.views), 1, 0, Pose(0, 0, 0, 0), Intrinsics(30, 30, math.pi / 2), seen, None)
    views.views.append(view)


def entries(*ids, spacing_m=0.5):
    return [SimpleNamespace(id=i, centre_m=(spacing_m * i, 0.5, 0.0)) for i in ids]


def found(memory):
    return {snapshot.view.id: set(snapshot.entry_ids) for snapshot in memory.snapshots}


def test_views_without_an_entry_are_no_frames():
    views, memory = ViewStore(), SnapshotMemory(4.0)
    look(views, None)
    look(views)
    look(views, 1, None, 2)
    memory.update(views, entries(1, 2), (0.0, 0.0))
    assert (found(memory), len(memory._frames)) == ({2: {1, 2}}, 1)


def test_a_later_view_of_more_entries_takes_over_near_ones():
    views, memory = ViewStore(), SnapshotMemory(4.0)
    look(views, 1)
    memory.update(views, entries(1, 2), (0.0, 0.0))
    look(views, 1, 2)
    memory.update(views, entries(1, 2), (0.0, 0.0))
    assert found(memory) == {1: {1, 2}}


def test_far_entries_stay_in_their_snapshot():
    views, memory = ViewStore(), SnapshotMemory(4.0)
    look(views, 1)
    memory.update(views, entries(1), (0.0, 0.0))
    look(views, 1, 2)
    memory.update(views, entries(1, 2), (0.0, 50.0))
    assert found(memory) == {0: {1}, 1: {2}}
    memory.update(views, entries(1, 2), (0.0, 3.0))
    assert found(memory) == {1: {1, 2}}


def test_frames_follow_an_entry_that_became_another():
    views, memory = ViewStore(), SnapshotMemory(4.0)
    look(views, 1, 2)
    look(views, 3)
    memory.update(views, entries(1, 2, 3), (0.0, 0.0))
    views.follow([(3, 1)])
    memory.update(views, entries(1, 2), (0.0, 0.0))
    assert (found(memory), len(memory._frames)) == ({0: {1, 2}}, 2)
    # All three views show what is now entry 2.
    views.follow([(1, 2)])
    look(views, 2, 4)
    memory.update(views, entries(2, 4), (0.0, 0.0))
    assert (found(memory), len(memory._frames)) == ({2: {2, 4}}, 3)


def test_frames_and_snapshots_of_vanished_entries_go():
    views, memory = ViewStore(), SnapshotMemory(4.0)
    look(views, 1, 2)
    look(views, 3)
    memory.update(views, entries(1, 2, 3), (0.0, 0.0))
    memory.update(views, entries(1), (0.0, 90.0))
    assert (found(memory), len(memory._frames)) == ({0: {1}}, 1)
    memory.update(views, [], (0.0, 0.0))
    assert (found(memory), len(memory._frames)) == ({}, 0)
    look(views, 5)
    memory.update(views, entries(5), (0.0, 0.0))
    assert found(memory) == {2: {5}}
