"""Times, ratios and intervals of rows; the JSON of a section; what counts as worse than before."""

import json
import os

import numpy as np
import pytest

from evonav.errors import InvalidArgumentError, StoreError
from evonav.speed_benchmark.run import (
    Speeds,
    against,
    markdown_of,
    read_speeds,
    run_section,
    speed_table,
    table_of,
    write_speeds,
)
from evonav.speed_benchmark.timing import MODULES, Row, Sampling, compare, one_core, rows_of

HOUSES = [f"house {number // 4}" for number in range(12)]


def work(amount):
    return sum(index * index for index in range(amount))


def test_a_slower_peer_has_a_ratio_above_one_and_a_faster_one_below():
    peers = {"slower": lambda _: work(60_000), "faster": lambda _: work(2_000)}
    slower, faster = compare("squares", lambda _: work(15_000), peers, HOUSES)
    assert slower.peer == "slower"
    assert slower.ms == faster.ms > 0
    assert 2.5 < slower.ratio < 6.5
    assert faster.ratio < 0.5
    assert slower.ratio_ci95[0] <= slower.ratio <= slower.ratio_ci95[1]
    assert slower.peer_ms == pytest.approx(slower.ratio * slower.ms, rel=0.3)
    assert slower.n == 12


def test_rows_are_medians_by_pairs_and_by_house():
    ours_ms = [1.0, 2.0, 3.0, 4.0, 5.0, 100.0]
    houses = ["a", "a", "a", "b", "b", "b"]
    (row,) = rows_of("x", ours_ms, {"double": [2 * ms for ms in ours_ms]}, houses, {"p95 ms": 7.0})
    assert (row.ms, row.peer_ms, row.ratio) == (3.5, 7.0, 2.0)
    assert row.ms_by_house == {"a": 2.0, "b": 5.0}
    assert row.ms_ci95 == (2.0, 5.0), "of two houses, either may be drawn twice"
    assert row.ratio_ci95 is None, "all ratios are the same"
    assert row.facts == {"p95 ms": 7.0}
    (alone,) = rows_of("x", ours_ms, {}, houses)
    assert (alone.peer, alone.ratio) == (None, None)
    (one,) = rows_of("x", ours_ms, {}, ["a"] * 6)
    assert one.ms_ci95 is None


def test_every_input_is_prepared_and_measured_as_often_as_asked():
    prepared, measured, told = [], [], []
    sampling = Sampling(repeats=3, on_progress=lambda *news: told.append(news))
    compare("x", measured.append, {}, HOUSES, sampling=sampling, calls=2, prepare=prepared.append)
    warm_up = 1
    assert len(prepared) == 3 * 12 + warm_up
    assert np.bincount(measured).tolist() == [7, *[6] * 11]
    assert told[-1] == (36, 36, "x")


def test_peers_that_are_not_installed_are_left_out_or_named_with_their_extra(monkeypatch):
    monkeypatch.setitem(MODULES, "embreex", "no_such_module_at_all")
    sampling = Sampling()
    assert sampling.chosen(["embreex", "sync"]) == ["sync"]
    assert "evonav[bench]" in sampling.left_out["embreex"]
    with pytest.raises(StoreError, match=r"pip install 'evonav\[bench\]'"):
        Sampling(peers=["embreex"]).chosen(["embreex", "sync"])
    with pytest.raises(InvalidArgumentError, match="no peer 'x' here; there are sync"):
        Sampling(peers=["x"]).chosen(["sync"])
    assert Sampling(peers=[]).chosen(["sync"]) == []
    with pytest.raises(InvalidArgumentError, match="repeats = 0"):
        Sampling(repeats=0)


def test_the_core_is_given_back():
    if not hasattr(os, "sched_getaffinity"):
        pytest.skip("this system does not bind processes to cores")
    before = os.sched_getaffinity(0)
    with one_core():
        assert len(os.sched_getaffinity(0)) == 1
    assert os.sched_getaffinity(0) == before
    with pytest.raises(KeyboardInterrupt), one_core():
        raise KeyboardInterrupt
    assert os.sched_getaffinity(0) == before


class Squares:
    NAME, TITLE, NOTES = "squares", "Squares", "How it was measured."

    @staticmethod
    def measure(sampling, factor=1.0):
        times_ms = [factor * ms for ms in (1.0, 1.1, 5.0, 5.2)]
        yield from rows_of("x", times_ms, {"peer": [8.0] * 4}, ["a", "a", "b", "b"])
        yield from rows_of("y", [2.0] * 4, {}, ["a", "a", "b", "b"], {"load": 1.5})


def test_figures_are_written_read_and_shown(tmp_path):
    speeds = run_section(Squares, Sampling())
    file, markdown = write_speeds(speeds, tmp_path, markdown_of(speeds))
    assert read_speeds(file) == speeds
    assert json.loads(file.read_text())["rows"][0]["ms"] == speeds.rows[0].ms == pytest.approx(3.05)
    assert "| x | 3.05 |" in markdown.read_text()
    table = table_of(speeds)
    assert table.columns == ("row", "ms p50", "95%", "peer", "its ms", "ratio", "ratio 95%", "load")
    assert speeds.machine in table.notes[0]
    assert speed_table("t", [Row(operation="y", ms=2.0, n=1)]).columns == ("row", "ms p50")


def test_a_file_that_is_none_is_named(tmp_path):
    with pytest.raises(StoreError, match="cannot be read"):
        read_speeds(tmp_path / "nowhere.json")
    file = tmp_path / "other.json"
    file.write_text("{}")
    with pytest.raises(StoreError, match=r'other.json: missing "section"; expected a speed.json'):
        read_speeds(file)


def test_a_doubled_time_is_worse_though_houses_differ_by_more_than_that():
    before, same, doubled = (run_section(Squares, Sampling(), factor=factor) for factor in (1.0, 1.1, 2.0))
    assert not any(change.is_worse for change in against(before, same))
    x, y = against(before, doubled)
    assert (x.name, x.is_worse, y.is_worse) == ("x, ms", True, False)
    assert str(x) == "x, ms: 3.05 -> 6.1 (2.00 times as much)"
    assert not any(change.is_worse for change in against(doubled, before))


def test_on_another_machine_only_ratios_are_compared():
    before = run_section(Squares, Sampling()).model_copy(update={"machine": "another"})
    (change,) = against(before, run_section(Squares, Sampling(), factor=2.0))
    assert (change.name, change.is_worse) == ("x, over peer", True)
    assert isinstance(before, Speeds)
    with pytest.raises(InvalidArgumentError, match="'other' cannot be compared with those of 'squares'"):
        against(before.model_copy(update={"section": "other"}), before)


def test_a_change_must_be_worse_in_houses_than_chance_explains():
    houses = [f"house {number}" for number in range(6)]

    def speeds(**by_house_ms):
        rows = [Row(operation=name, ms=ms, ms_by_house=by_house, n=6) for name, (ms, by_house) in by_house_ms.items()]
        return run_section(Squares, Sampling()).model_copy(update={"rows": rows})

    noisy = (1.4, dict(zip(houses, [0.5, 2.0, 0.4, 3.0, 0.6, 2.5], strict=True)))
    steady, before = ((ms, dict.fromkeys(houses, ms)) for ms in (1.4, 1.0))
    verdicts = against(speeds(noisy=before, steady=before), speeds(noisy=noisy, steady=steady, new=steady))
    assert [(change.name, change.is_worse) for change in verdicts] == [("noisy, ms", False), ("steady, ms", True)]
