"""A folder of the benchmark: a record for each memory and stream, kept over commands, and the tables made of them."""

import json
from pathlib import Path

import pytest

from evonav.component import Component
from evonav.errors import InvalidArgumentError, StoreError
from evonav.memory_benchmark.benchmark import MEMORIES, PEERS, NamedMemory, benchmark, named_memories, record_path
from evonav.memory_benchmark.report import memory_tables, scores, text_of, write_memory_report
from evonav.memory_benchmark.run import MeasureSettings
from evonav.memory_benchmark.streams.spec import StreamSpec
from evonav.statistics import Estimate

SPECS = [StreamSpec("S1", f"bundled:{number}", 0, 64, 48, frames_a_visit=30) for number in (4, 9)]
HERE = MeasureSettings(own_process=False)
OWN = """
class Own:
    def reset(self, info): self.num = 0
    def visit(self, time_s): pass
    def observe(self, frame):
        self.num += 1
        {extra}
    def entries(self): return []
"""


def run(memories, out, specs=SPECS, **options):
    told: list[tuple[int, int, str]] = []
    result, failures = benchmark(
        memories,
        specs,
        out,
        settings=options.pop("settings", HERE),
        num_workers=0,
        on_progress=lambda *news: told.append(news),
        **options,
    )
    return result, failures, told


def own(tmp_path, extra="pass"):
    file = tmp_path / f"memory_of_{tmp_path.name}.py"  # no two modules of a process may share a name
    file.write_text(OWN.format(extra=extra))
    return NamedMemory("own", Component(f"{file}:Own"))


def test_the_same_command_goes_on_where_it_ended(tmp_path: Path):
    out = tmp_path / "out"
    first, _, told = run(named_memories(["never"]), out, SPECS[:1])
    assert told[-1] == (1, 1, SPECS[0].name)
    assert [stream.stream for stream in first.memories["never"]] == [SPECS[0].name]
    path = record_path(out, "never", SPECS[0].name)
    written = path.stat().st_mtime_ns
    both, failures, told = run(named_memories(["never", "numpy-list"]), out)
    assert told[0] == (1, 4, "")
    assert path.stat().st_mtime_ns == written
    assert {memory: len(streams) for memory, streams in both.memories.items()} == {"never": 2, "numpy-list": 2}
    assert failures == []
    path.unlink()  # of one memory: the other one's stays
    again, _, told = run(named_memories(["never", "numpy-list"]), out)
    assert told[0] == (3, 4, "")
    assert again.memories["never"][0].digest == both.memories["never"][0].digest


def test_a_memory_that_was_edited_is_measured_again(tmp_path: Path):
    out = tmp_path / "out"
    run([own(tmp_path)], out, SPECS[:1])
    *_, told = run([own(tmp_path)], out, SPECS[:1])
    assert told == [(1, 1, "")]
    *_, told = run([own(tmp_path, extra="self.num += 2")], out, SPECS[:1])
    assert told[0] == (0, 1, "")


def test_a_memory_that_fails_is_a_result_and_a_stream_that_cannot_be_made_is_not(tmp_path: Path):
    out = tmp_path / "out"
    broken = own(tmp_path, extra="raise ValueError('no more')")
    nowhere = StreamSpec("S1", str(tmp_path / "nowhere.json"), 0, 64, 48)
    measured, ((memory, stream, why),), _ = run([broken], out, [SPECS[0], nowhere])
    assert (memory, stream) == ("own", nowhere.name)
    assert "nowhere.json" in why
    assert measured.memories["own"][0].failure.kind == "raised"
    table = next(table for table in memory_tables(measured) if table.title == "Failures")
    assert table.rows[0][:3] == ("own", SPECS[0].name, "raised")
    assert "no more" in table.rows[0][4]
    assert memory_tables(measured)[0].rows[0][:2] == ("own", "0 (1 failed)")


def test_another_configuration_is_refused(tmp_path: Path):
    out = tmp_path / "out"
    run(named_memories(["numpy-list"]), out, SPECS[:1])
    with pytest.raises(StoreError, match="every"):
        run(named_memories(["numpy-list"]), out, SPECS[:1], settings=MeasureSettings(own_process=False, every=5))
    (out / "memory.json").write_text("{}")
    with pytest.raises(StoreError, match=r'memory\.json: missing "identity"; expected a header'):
        run(named_memories(["numpy-list"]), out, SPECS[:1])


def test_a_damaged_record_is_named(tmp_path: Path):
    out = tmp_path / "out"
    run(named_memories(["numpy-list"]), out, SPECS[:1])
    path = record_path(out, "numpy-list", SPECS[0].name)
    path.write_text("{")
    with pytest.raises(StoreError, match="delete it to measure it again"):
        run(named_memories(["numpy-list"]), out, SPECS[:1])


def test_mistakes_in_names_are_told(tmp_path: Path):
    with pytest.raises(InvalidArgumentError, match="no memory 'nevr': expected one of never, "):
        named_memories(["nevr"])
    assert [memory.name for memory in named_memories([])] == list(MEMORIES)
    assert set(MEMORIES) & set(PEERS) == set()
    with pytest.raises(InvalidArgumentError, match="a memory is named twice"):
        run(named_memories(["never", "never"]), tmp_path)
    with pytest.raises(InvalidArgumentError, match="no stream to measure"):
        run(named_memories(["never"]), tmp_path, [])


def test_the_report_has_the_figures_of_the_records(tmp_path: Path):
    out = tmp_path / "out"
    measured, *_ = run(named_memories(["never", "last-wins"]), out)
    found = scores(measured)
    assert found["never"]["p95_over_baseline"].value == 1.0
    for memory, streams in measured.memories.items():
        counts = [stream.update for stream in streams]
        expected = 100 * sum(one.false_forgets for one in counts) / sum(one.standing for one in counts)
        assert found[memory]["false_forgets"].value == pytest.approx(expected)
    page = write_memory_report(measured, out, num_missing=3)
    text = page.read_text()
    assert "3 records of those asked for are missing" in text
    table = memory_tables(measured)[0]
    assert [row[0] for row in table.rows] == ["never", "last-wins"]
    p95 = text_of(found["last-wins"]["observe_cpu_p95_ms"], digits=2)
    assert p95 in text
    assert p95 in (out / "summary.md").read_text().replace("\\", "")
    assert json.loads((out / "result.json").read_text())["memories"].keys() == {"never", "last-wins"}


def test_infinite_and_missing_values_are_words():
    assert text_of(None) == "–"
    assert text_of(Estimate(float("inf"), (3.0, float("inf")), 5, 2)) == "not reached [3.0, ∞]"
    assert text_of(Estimate(0.5, None, 5, 1), 100.0) == "50.0 [–]"
