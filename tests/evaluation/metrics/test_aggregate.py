import pytest
from made_up_stage import entry, made_up_record, taken

from evonav.evaluation.metrics.aggregate import COSTS, MEMORY, METRICS, STALENESS, SUCCESS, explain
from evonav.evaluation.metrics.navigation import summarise
from evonav.evaluation.metrics.stage_rows import read_stage_metrics
from evonav.evaluation.records.encoded import encode_stage
from evonav.evaluation.records.schema import EndState, StaleEntryRecord
from evonav.evaluation.records.store import RunStore
from evonav.report.tables.metric_tables import measures_table, measures_tables


@pytest.fixture
def run_dir(tmp_path):
    """Two houses: in one the agent believes a stale entry, in the other it succeeds."""
    old = entry(is_stale=True)
    stale = StaleEntryRecord(label="Mug", centre_m=(0.0, 0.0, 0.0), evident_round=0, cleared_round=1)
    unseen = StaleEntryRecord(label="Mug", centre_m=(0.0, 0.0, 0.0))
    with RunStore(tmp_path, create=True) as store:
        for record in (
            made_up_record(trace=(taken(0, old), taken(1)), entries=(old, entry()), house="a", task_id="a"),
            made_up_record(EndState.SUCCESS, entries=(entry(),) * 6, house="b", task_id="b"),
            made_up_record(EndState.ERRORED, error="agent", house="c", task_id="c"),
        ):
            is_a = record.house == "a"
            told = {
                "memory_at_end": None if not record.is_scored else memory(),
                "stale_entries": (stale, unseen) * is_a,
            }
            store.add_stage(encode_stage(record.model_copy(update=told), wall_s=2.0 if is_a else 4.0, cpu_s=1.0))
    return tmp_path


def memory():
    from evonav.evaluation.records.schema import MemoryRecord

    return MemoryRecord(num_entries=2, num_right=1, num_held=1, num_seen=4, num_seen_held=1, position_error_m=0.1)


def values(run_dir, measures):
    with RunStore(run_dir) as store:
        (found,) = explain(read_stage_metrics(store), measures).values()
    return {one.name: estimate for one, estimate in zip(measures, found, strict=True)}


def test_shares_are_of_what_could_have_been_counted(run_dir):
    told = values(run_dir, (*SUCCESS, *STALENESS, *MEMORY, *COSTS))
    assert (told["sr"].value, told["sr"].n, told["sr"].num_clusters) == (0.5, 2, 2)
    assert told["sr"].ci95 == (0.0, 1.0)
    assert (told["sr_1m"].value, told["sr_1.5m"].value, told["sr_3m"].value) == (0.0, 0.5, 0.5)
    # Entries are pooled: 7 of 8 are right, though the stages' means are 1/2 and 1.
    assert told["precision"].value == 7 / 8
    assert (told["stale_evident"].value, told["stale_evident"].n) == (0.5, 1)
    assert told["stale_evident"].ci95 is None  # of one house nothing can be resampled
    assert (told["stale_cleared"].value, told["rounds_to_clear"].value) == (1.0, 1.0)
    assert told["stale_path_share"].value == 0.5 / 10.0
    assert told["strict_sr"].value is None  # the records do not tell
    assert told["wall_s"].value == 3.0


def test_a_rate_has_the_interval_of_the_summary(tmp_path):
    """Widened for few houses: of eight, plain percentiles hold the truth 88 times in 100."""
    states = [EndState.SUCCESS, EndState.FAILURE, EndState.SUCCESS]
    records = [
        made_up_record(states[i % 3 if i < 16 else 0], house=f"house {i // 3}", task_id=f"task {i}") for i in range(24)
    ]
    with RunStore(tmp_path, create=True) as store:
        for record in records:
            store.add_stage(encode_stage(record, wall_s=1.0, cpu_s=1.0))
    told, summary = values(tmp_path, SUCCESS), summarise("fu", _rows(tmp_path), 24)
    assert (told["sr"].num_clusters, told["sr"].value) == (8, summary.sr)
    assert told["sr"].ci95 == told["sr_2m"].ci95 == summary.sr_ci95 is not None
    assert told["spl"].ci95 == pytest.approx(summary.spl_ci95)


def test_tables_leave_out_what_no_agent_has(run_dir):
    table = measures_table(rows := _rows(run_dir), "success")
    names = [row[0] for row in table.rows]
    assert "success (paper), %" in names
    assert "strict success, %" not in names
    assert table.rows[0][1] == "50.0 [0.0, 100.0]"
    assert "fu 2 stages of 2 houses" in table.notes[0]
    assert rows
    assert len(measures_tables(run_dir)) == len(METRICS)


def _rows(run_dir):
    with RunStore(run_dir) as store:
        return read_stage_metrics(store)


def test_the_command_shows_and_writes_the_tables(run_dir, tmp_path_factory):
    from typer.testing import CliRunner

    from evonav.cli import app

    out = tmp_path_factory.mktemp("out") / "measures.md"
    done = CliRunner().invoke(app, ["report", str(run_dir), "--text", "--agent", "fu", "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "| precision at the end, % | 87.5 [50.0, 100.0] |" in out.read_text()
