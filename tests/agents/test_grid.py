"""Grids of cells, beside their definitions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from evonav.agents.grid import NO_GROUP, CoarseFrame, eroded, grown, numbered
from evonav.sensors.observation import MapFrame


def test_a_coarse_cell_holds_the_cells_of_the_map_in_its_area():
    coarse = CoarseFrame.over(MapFrame(rows=5, cols=4, cell_m=0.125, corner_m=(0.0, 0.0)))
    cells = np.arange(20, dtype=np.uint8).reshape(5, 4)
    blocks = coarse.taken(cells, rest=99)
    assert blocks.shape == (4, 3, 2)
    assert sorted(blocks[:, 1, 1].tolist()) == [10, 11, 14, 15]
    assert sorted(blocks[:, 2, 0].tolist()) == [16, 17, 99, 99]  # beyond the last row


def groups_naive(cells, min_cells):
    """Flood fill, cell by cell."""
    groups, number = np.full(cells.shape, NO_GROUP, np.int32), 0
    seen = np.zeros(cells.shape, bool)
    for start in map(tuple, np.argwhere(cells)):
        if seen[start]:
            continue
        group, seen[start] = [start], True
        for row, col in group:
            for after in ((row - 1, col), (row + 1, col), (row, col - 1), (row, col + 1)):
                is_inside = 0 <= after[0] < cells.shape[0] and 0 <= after[1] < cells.shape[1]
                if is_inside and cells[after] and not seen[after]:
                    seen[after] = True
                    group.append(after)
        if len(group) >= min_cells:
            for cell in group:
                groups[cell] = number
            number += 1
    return groups


@given(seed=st.integers(0, 2**32 - 1), share=st.sampled_from([0.2, 0.55, 0.9]), min_cells=st.integers(1, 6))
def test_groups_are_those_of_a_flood_fill(seed, share, min_cells):
    cells = np.random.default_rng(seed).random((13, 17)) < share
    assert (numbered(cells, min_cells) == groups_naive(cells, min_cells)).all()


@given(seed=st.integers(0, 2**32 - 1), depth=st.integers(0, 3), steps=st.integers(0, 5))
def test_erosion_and_growth_are_those_of_their_definitions(seed, depth, steps):
    draws = np.random.default_rng(seed)
    floor = draws.random((12, 15)) < 0.85
    padded = np.pad(floor, depth)
    naive = [[padded[r : r + 2 * depth + 1, c : c + 2 * depth + 1].all() for c in range(15)] for r in range(12)]
    assert (eroded(floor, depth) == np.array(naive)).all()
    seeds = np.where((draws.random((12, 15)) < 0.05) & floor, 1, NO_GROUP).astype(np.int32)
    reached = {tuple(cell) for cell in np.argwhere(seeds == 1)}
    for _ in range(steps):
        reached |= {
            (r + dr, c + dc)
            for r, c in reached
            for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0))
            if 0 <= r + dr < 12 and 0 <= c + dc < 15 and floor[r + dr, c + dc]
        }
    assert {tuple(cell) for cell in np.argwhere(grown(seeds, floor, steps) == 1)} == reached


def test_where_two_groups_meet_the_larger_number_wins():
    row = np.array([[0, NO_GROUP, 1, NO_GROUP, NO_GROUP, 0]], np.int32)
    assert grown(row, np.ones((1, 6), np.bool_), 1).tolist() == [[0, 1, 1, 1, 0, 0]]
    assert grown(row, np.zeros((1, 6), np.bool_), 1).tolist() == row.tolist()
