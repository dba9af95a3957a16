"""A map that a view contradicts is made again."""

import numpy as np
import pytest
from cup_views import a_view

from evonav.agents.explorer import Explorer, ExplorerConfig
from evonav.agents.navigator import NavigationTarget, Navigator, NavigatorConfig
from evonav.sensors.observation import MapFrame, Observation
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics


def view_of(free=(), blocked=()):
    """A view that saw these cells."""
    cells = [np.array(sorted(part), np.int32).reshape(-1, 2) for part in (free, blocked)]
    pose, depth_m = Pose(0.05, 1.5, 0.05, 0.0), np.full((2, 2), np.inf)
    return a_view(depth_m, pose=pose, free=cells[0], blocked=cells[1], intrinsics=Intrinsics(2, 2, 1.0))


def saw(*views):
    return Observation(views, Pose(0.05, 0.9, 0.05, 0.0), is_action_success=True, num_rounds_left=9)


BLOCK = [(row, col) for row in range(20, 25) for col in range(20, 25)]


@pytest.mark.parametrize(
    ("config", "contradicting", "is_rebuilt"),
    [
        ({}, BLOCK[:1], True),
        ({"min_conflict_cells": 2}, BLOCK[:1], False),  # two views of one cell are one cell
        ({"min_conflict_cells": 2}, BLOCK[:2], True),
        ({"min_conflict_cells": None}, BLOCK, False),
        ({"conflict_margin_cells": 1}, BLOCK[:10], False),  # two rows have no inner cell
        ({"conflict_margin_cells": 1}, BLOCK, True),
        ({"conflict_margin_cells": 1, "min_conflict_cells": 10}, BLOCK, False),  # nine of twenty-five are inner ones
        ({"conflict_margin_cells": 3}, BLOCK, False),
    ],
)
@pytest.mark.parametrize("is_freed", [True, False])
def test_conflicts_are_cells_that_contradict_the_map(config, contradicting, is_rebuilt, is_freed):
    explorer = Explorer(MapFrame(40, 40, 0.1, (0.0, 0.0)), ExplorerConfig(**config))
    elsewhere = [(30, 30)]
    first = view_of(elsewhere, BLOCK) if is_freed else view_of([*elsewhere, *BLOCK])
    second = view_of(contradicting) if is_freed else view_of(blocked=contradicting)
    assert not explorer.observe(saw(first))
    assert explorer.observe(saw(second, second)) == is_rebuilt
    assert explorer.counters["conflicts"] == is_rebuilt
    assert (explorer.map.cells[30, 30] == 0) == is_rebuilt  # the whole map goes, not the contradicting cells alone
    row, col = contradicting[0]
    assert explorer.map.cells[row, col] == (1 if is_freed else 2)  # the last observation wins either way


@pytest.mark.parametrize("is_contradicted", [True, False])
def test_a_commitment_ends_with_the_map_that_it_was_made_on(is_contradicted):
    navigator = Navigator(MapFrame(40, 40, 0.1, (0.0, 0.0)), NavigatorConfig())
    navigator.observe(saw(view_of(BLOCK)))
    navigator.target = NavigationTarget(1, (2.0, 2.0), (2.5, 2.5))
    navigator.observe(saw(view_of(blocked=BLOCK[:1]) if is_contradicted else view_of(BLOCK[:1])))
    assert (navigator.target is None) == is_contradicted
