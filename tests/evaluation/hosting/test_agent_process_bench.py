"""The bench of agents' processes runs: nothing else calls it until its figures are wanted."""

import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.mark.slow
def test_a_round_is_measured_with_any_number_of_views(monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    bench = importlib.import_module("benches.agent_process")
    monkeypatch.setattr(bench, "NUM_ROUNDS", 3)
    monkeypatch.setattr(bench, "NUMS_OF_VIEWS", (0, 2))
    _, _, *rows = bench._rounds()
    assert [row.split("|")[1].strip() for row in rows] == ["0", "2"]
    assert all(float(row.split("|")[3].split()[0]) > 0.0 for row in rows)
