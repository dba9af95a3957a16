"""Results are aggregated over houses, written, read, and compared with earlier ones."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from evonav.errors import StoreError
from evonav.memory_benchmark.aggregate import METRICS, against, estimates, ratios
from evonav.memory_benchmark.metrics.costs import Percentiles, Sample, Size
from evonav.memory_benchmark.metrics.counts import BeliefScore, ChangeCounts, QueryCounts, UpdateCounts
from evonav.memory_benchmark.metrics.spells import Clocks, Spell
from evonav.memory_benchmark.records import (
    BenchmarkResult,
    MemoryFailure,
    Speed,
    StreamResult,
    read_result,
)
from evonav.statistics import BeforeAfter

HOUSES = ("a", "b", "c", "d", "e", "f")
COUNTS = UpdateCounts(
    removals=10, removals_done=8, additions=4, additions_done=3, moves=5, moves_done=1, standing=200, false_forgets=2,
    entries=50, right_entries=40, seen=60, seen_remembered=45, remembered=40, duplicates=4,
    gone=ChangeCounts(2, 2, 0), come=ChangeCounts(4, 0, 2),
)  # fmt: skip


def times(ms: float) -> Percentiles:
    return Percentiles(100, ms, ms, 2 * ms, 3 * ms, 4 * ms)


def stream(house: str, ms: float = 1.0, kind: str = "S1", clears_after: int | None = 3) -> StreamResult:
    spell = Spell("evident", 0, Clocks(clears_after or 9, 1.5, 1.0, 4), is_over=clears_after is not None)
    late = Spell("evident", 1, Clocks(20, 10.0, 8.0, 9), is_over=house == "a")
    return StreamResult(
        stream=f"{kind}/{house}/0",
        kind=kind,
        house=house,
        hosting="here",
        num_frames=100,
        num_visits=4,
        num_changes=2,
        speed=Speed(
            observe_cpu=times(ms),
            observe_wall=times(ms),
            locate_cpu=None,
            locate_wall=None,
            visit_wall_max_ms=0.1,
            real_time_factor=500.0,
            slope_per_100_entries_ms=0.2 * ms,
            slope_per_1000_frames_ms=None,
            samples=(Sample(1.0, 2.0, ms),),
        ),
        size=Size(40, 40_000, 1000.0, 0.5, 3.0, 90.0),
        update=COUNTS,
        spells=(spell, late),
        belief=BeliefScore(n=4, squared_error=1.0, log_loss=2.0, bins=[[4.0, 2.0, 1.0], *[[0.0, 0.0, 0.0]] * 9]),
        queries={"before": QueryCounts(10, 5, 8, 6.5)},
    )


def result(**memories: list[StreamResult]) -> BenchmarkResult:
    return BenchmarkResult(machine="a machine with 2 cores", memories=memories)


def test_figures_of_known_counts() -> None:
    found = estimates([stream(house) for house in HOUSES])
    values = {name: estimate.value for name, estimate in found.items()}
    assert values["observe_cpu_p95_ms"] == pytest.approx(2.0)
    assert values["observe_cpu_max_ms"] == pytest.approx(4.0)
    assert values["slope_per_100_entries_ms"] == pytest.approx(0.2)
    assert values["removal_recall"] == pytest.approx(0.8)
    assert values["removal_precision"] == pytest.approx(8 / 10)  # 8 right removals and 2 false ones
    assert values["removal_f1"] == pytest.approx(16 / 20)
    assert values["addition_recall"] == pytest.approx(0.75)
    assert values["move_recall"] == pytest.approx(0.2)
    assert values["false_forgets"] == pytest.approx(1.0)  # of 100
    assert values["duplicates"] == pytest.approx(10.0)
    assert values["precision"] == pytest.approx(0.8)
    assert values["recall"] == pytest.approx(0.75)
    assert values["change_f1"] == pytest.approx(12 / 16)
    assert values["disappeared_f1"] == pytest.approx(4 / 6)
    assert values["appeared_f1"] == pytest.approx(8 / 10)
    assert values["half_life_frames"] == 3.0  # half of twelve spells end at 3 frames
    assert values["half_life_s"] == 1.5
    assert values["never_cleared"] == pytest.approx(100 * 5 / 12)
    assert values["brier"] == pytest.approx(0.25)
    assert values["nll"] == pytest.approx(0.5)
    assert values["ece"] == pytest.approx(0.25)
    assert values["hit_at_1_before"] == pytest.approx(50.0)
    assert values["mrr_before"] == pytest.approx(65.0)
    assert "hit_at_1_after" not in values
    assert "locate_cpu_p50_ms" not in values
    assert found["half_life_frames"].num_clusters == 6
    assert set(values) <= METRICS.keys()


def test_intervals_are_over_houses() -> None:
    streams = [stream(house, ms=1.0 + index) for index, house in enumerate(HOUSES)]
    estimate = estimates(streams)["observe_cpu_p50_ms"]
    assert estimate.value == pytest.approx(3.5)
    assert estimate.ci95 is not None
    low, high = estimate.ci95
    assert 1.0 < low < 3.5 < high < 6.0
    assert estimates([stream("a")])["observe_cpu_p50_ms"].ci95 is None


def test_half_life_that_is_not_reached_is_infinite() -> None:
    found = estimates([stream(house, clears_after=None) for house in HOUSES])
    assert found["half_life_frames"].value == math.inf
    assert found["never_cleared"].value == pytest.approx(100 * 11 / 12)


def test_failed_streams_have_no_part_in_figures() -> None:
    failed = stream("a").model_copy(
        update={"failure": MemoryFailure(kind="died", message="died", frame=3), "update": None, "spells": ()}
    )
    mine = [failed, *[stream(house) for house in HOUSES[1:]]]
    assert estimates(mine)["removal_recall"].num_clusters == 5
    assert estimates([failed]) == {}


def test_figures_of_one_kind() -> None:
    mine = [stream("a", ms=1.0), stream("a", ms=9.0, kind="S7")]
    assert estimates(mine, "S7")["observe_cpu_p50_ms"].value == pytest.approx(9.0)
    assert estimates(mine, "S3") == {}


def test_ratios_to_the_baseline_are_paired_by_stream() -> None:
    never = [stream(house, ms=2.0) for house in HOUSES]
    mine = [stream(house, ms=3.0) for house in (*HOUSES, "more")]
    found = ratios(mine, never)
    assert found["observe_cpu_p95_ms"].value == pytest.approx(1.5)
    assert found["bytes_per_entry"].value == pytest.approx(1.0)
    assert "locate_cpu_p50_ms" not in found


def test_result_is_read_as_it_was_written(tmp_path: Path) -> None:
    whole = result(mine=[stream("a")])
    path = tmp_path / "result.json"
    path.write_text(whole.model_dump_json())
    assert read_result(path) == whole
    assert read_result(path).memories["mine"][0].spells[0].lasted.frames == 3


def test_files_that_are_no_results(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    with pytest.raises(StoreError, match="cannot be read"):
        read_result(path)
    path.write_text(result(mine=[stream("a")]).model_dump_json())
    data = json.loads(path.read_text())
    data["memories"]["mine"][0]["num_frames"] = "many"
    path.write_text(json.dumps(data))
    with pytest.raises(StoreError, match=r"result.json: memories.mine.0.num_frames = 'many'"):
        read_result(path)
    data["schema_version"] = 99
    path.write_text(json.dumps(data))
    with pytest.raises(StoreError, match="schema_version = 99"):
        read_result(path)


def compared(now: list[StreamResult], before: list[StreamResult], scale: float = 1.0) -> dict[str, BeforeAfter]:
    """Compare two results; the machine of the new one is `scale` times slower."""
    never, slower = ([stream(house, ms=ms) for house in HOUSES] for ms in (1.0, scale))
    differences = against(result(never=slower, mine=now), result(never=never, mine=before))
    return {one.name.removeprefix("mine: "): one for one in differences if one.name.startswith("mine: ")}


def test_nothing_is_worse_than_itself() -> None:
    same = [stream(house, clears_after=None) for house in HOUSES]
    assert not any(one.is_worse for one in compared(same, same).values())


def test_worse_figures_are_found() -> None:
    worse = replace(COUNTS, removals_done=4)
    now = [stream(house).model_copy(update={"update": worse}) for house in HOUSES]
    found = compared(now, [stream(house) for house in HOUSES])
    assert {name for name, one in found.items() if one.is_worse} == {
        "removal_recall",
        "removal_precision",
        "removal_f1",
    }
    assert found["removal_recall"].before == pytest.approx(0.8)
    assert found["removal_recall"].now == pytest.approx(0.4)
    assert not any(one.is_worse for one in compared([stream(house) for house in HOUSES], now).values())


def test_difference_within_the_houses_is_no_verdict() -> None:
    now = [
        stream(house).model_copy(update={"update": replace(COUNTS, removals_done=8 + (1 if index % 2 else -1))})
        for index, house in enumerate(HOUSES)
    ]
    found = compared(now, [stream(house) for house in HOUSES])
    assert not found["removal_recall"].is_worse


def test_time_is_compared_relative_to_the_baseline() -> None:
    before = [stream(house) for house in HOUSES]
    slower_machine = compared([stream(house, ms=3.0) for house in HOUSES], before, scale=3.0)
    assert not slower_machine["observe_cpu_p95_ms"].is_worse
    slower_memory = compared([stream(house, ms=3.0) for house in HOUSES], before)
    assert slower_memory["observe_cpu_p95_ms"].is_worse
    assert slower_memory["observe_cpu_p95_ms"].now == pytest.approx(3.0)
    noise = compared([stream(house, ms=1.2) for house in HOUSES], before)
    assert not noise["observe_cpu_p95_ms"].is_worse


def test_new_failure_is_worse() -> None:
    failed = stream("a").model_copy(update={"failure": MemoryFailure(kind="raised", message="raises", frame=1)})
    found = compared([failed, *[stream(house) for house in HOUSES[1:]]], [stream(house) for house in HOUSES])
    assert found["failed_streams"].is_worse
    assert (found["failed_streams"].before, found["failed_streams"].now) == (0, 1)
