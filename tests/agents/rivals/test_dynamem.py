"""DynaMem in the words of its rule: points that depth sees through go, and old places are looked at again."""

import math

import numpy as np
import pytest
from cup_views import a_view
from hypothesis import given
from hypothesis import strategies as st
from toy_episode import rounds_of
from toy_house import CHAIR_AWAY, stage_case

from evonav.agents.agent import Stop
from evonav.agents.rivals.dynamem import DynaMem, DynaMemConfig, LastSeen, _grown
from evonav.memory import OccupancyMap
from evonav.memory.occupancy import BLOCKED, FREE
from evonav.sensors.observation import MapFrame, VisibleOccupancy

FRAME = MapFrame(rows=20, cols=30, cell_m=0.1, corner_m=(0.0, 0.0))
DEPTH = np.ones((6, 6), np.float32)


def all_cells(rows, cols):
    return np.stack(np.meshgrid(rows, cols, indexing="ij"), axis=-1).reshape(-1, 2).astype(np.int32)


def room(right=15):
    """A map whose free floor is rows 2 to 17 and columns 2 up to `right`, with walls on all sides but the right."""
    occupancy = OccupancyMap(FRAME)
    free = all_cells(range(2, 18), range(2, right))
    walls = np.concatenate(
        [all_cells((1, 18), range(1, right)), all_cells(range(1, 19), (1,))],
    )
    occupancy.integrate(VisibleOccupancy(free, walls), (1.0, 1.0))
    return occupancy, free, walls


def test_a_stored_point_that_the_depth_sees_through_is_deleted_and_the_agent_does_not_stop_there():
    agent = DynaMem()
    stages = stage_case(1, "Chair|1"), stage_case(2, "Chair|1", moves=CHAIR_AWAY, mode="SALIENT_OBJECT")
    _, rounds = rounds_of(agent, *stages)
    chairs = {1: set(), 2: set()}
    for stage, belief, _, _ in rounds:
        chairs[stage] |= {one.entry_id for one in belief.entries if one.label == "Chair"}
    assert chairs[1]
    assert not chairs[1] & chairs[2]  # the first look of stage 2 sees through the old place
    stop = rounds[-1]
    assert isinstance(stop[3], Stop)
    assert stop[2].chosen_entry.entry_id in chairs[2]


def test_what_was_never_seen_comes_first_and_then_what_was_seen_long_ago():
    seen = LastSeen(FRAME, DynaMemConfig())
    seen.see(a_view(DEPTH, free=[(0, 0), (0, 1)]))
    for _ in range(30):
        seen.see(a_view(DEPTH, free=[(0, 1)]))
    values = seen.values()
    assert values[5, 5] == 1.0
    assert values[0, 0] == pytest.approx(1 / (1 + math.exp(-0.1 * (30 - 10))), abs=1 / 200)
    assert values[0, 1] < values[0, 0] < 1.0


def test_a_place_seen_ten_views_ago_is_worth_one_half():
    seen = LastSeen(FRAME, DynaMemConfig())
    seen.see(a_view(DEPTH, free=[(3, 3)]))
    for _ in range(10):
        seen.see(a_view(DEPTH))
    assert seen.values()[3, 3] == 0.5


def test_it_goes_to_the_nearest_edge_of_the_floor_that_it_never_saw():
    occupancy, free, walls = room()
    seen = LastSeen(FRAME, DynaMemConfig())
    seen.see(a_view(DEPTH, free=free, blocked=walls))
    found = seen.best_edge(occupancy, (1.0, 1.0))
    assert found.value == 1.0
    assert found.face_m == pytest.approx((1.55, 0.95)) or found.face_m == pytest.approx((1.55, 1.05))
    assert found.position_m[0] == pytest.approx(1.45)


def test_unseen_cells_by_a_wall_are_taken_for_a_part_of_it():
    occupancy, free, walls = room(right=4)  # two free columns: all unseen cells are within two cells of the walls' ends
    seen = LastSeen(FRAME, DynaMemConfig(padding_cells=20))
    seen.see(a_view(DEPTH, free=free, blocked=walls))
    assert seen.best_edge(occupancy, (0.25, 1.0)).value < 0.5


def test_where_all_is_seen_it_looks_again_at_what_it_saw_longest_ago():
    occupancy, free, walls = room()
    end = all_cells(range(2, 18), (15,))
    occupancy.integrate(VisibleOccupancy(np.empty((0, 2), np.int32), end), (1.0, 1.0))
    seen = LastSeen(FRAME, DynaMemConfig())
    seen.see(a_view(DEPTH, free=free, blocked=np.concatenate([walls, end])))
    for _ in range(5):
        seen.see(a_view(DEPTH, free=free, blocked=walls))  # the end of the room is not looked at any more
    found = seen.best_edge(occupancy, (0.4, 1.0))
    assert found.face_m[0] == pytest.approx(1.55)
    assert found.value < 0.5


def test_a_place_that_was_gone_to_in_vain_counts_as_seen():
    seen = LastSeen(FRAME, DynaMemConfig())
    seen.see(a_view(DEPTH))
    seen.give_up((1.55, 0.95))
    assert seen.values()[9, 15] < 1.0
    seen.be_at((0.5, 0.5))
    assert seen.values()[5, 5] < 1.0
    assert seen.values()[12, 5] == 1.0
    seen.give_up((-5.0, 99.0))  # off the map: the nearest cell


@given(seed=st.integers(0, 2**32 - 1))
def test_the_best_edge_is_that_of_the_definition(seed):
    draws = np.random.default_rng(seed)
    frame = MapFrame(rows=9, cols=11, cell_m=0.1, corner_m=(-0.3, 0.2))
    states = draws.choice([0, FREE, BLOCKED], size=(9, 11), p=[0.3, 0.6, 0.1])
    occupancy = OccupancyMap(frame)
    free, blocked = (np.ascontiguousarray(np.argwhere(states == one).astype(np.int32)) for one in (FREE, BLOCKED))
    occupancy.integrate(VisibleOccupancy(free, blocked), (0.0, 0.0))
    seen = LastSeen(frame, DynaMemConfig(padding_cells=0))
    seen.see(a_view(DEPTH, free=free, blocked=blocked))
    for _ in range(3):
        seen.see(a_view(DEPTH, free=np.argwhere(draws.random((9, 11)) < 0.5)))
    if len(free) == 0:
        assert seen.best_edge(occupancy, (0.0, 0.0)) is None
        return
    row, col = free[draws.integers(len(free))].tolist()
    here_m = (frame.corner_m[0] + (col + 0.5) * 0.1, frame.corner_m[1] + (row + 0.5) * 0.1)
    middles_m = np.array([(-0.3 + (c + 0.5) * 0.1, 0.2 + (r + 0.5) * 0.1) for r, c in free])
    reached = {tuple(one) for one in free[np.isfinite(occupancy.distances_m(here_m, middles_m))]}
    values, best = seen.values(), None
    for r in range(9):
        for c in range(11):
            beside = any((r + dr, c + dc) in reached for dr in (-1, 0, 1) for dc in (-1, 0, 1))
            if beside and (r, c) not in reached:
                key = (values[r, c], -round(math.hypot(r - row, c - col), 6))
                best = key if best is None else max(best, key)
    found = seen.best_edge(occupancy, here_m)
    assert (found is None) == (best is None)
    if found is not None and best is not None:
        assert found.value == best[0]
        assert math.dist(found.face_m, here_m) == pytest.approx(-best[1] * 0.1, abs=1e-6)
        assert math.dist(found.position_m, found.face_m) < 0.15  # it stands beside it


def test_growth_is_by_one_cell_in_eight_directions():
    cells = np.zeros((5, 5), bool)
    cells[2, 2] = True
    assert _grown(cells).sum() == 9
