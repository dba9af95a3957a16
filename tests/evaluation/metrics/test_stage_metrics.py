from dataclasses import fields

import pytest
from made_up_stage import entry, made_up_record, taken

from evonav.evaluation.metrics.stage_metrics import StageMetrics, metrics_of
from evonav.evaluation.metrics.stage_rows import read_stage_metrics
from evonav.evaluation.records.costs import StageCosts
from evonav.evaluation.records.encoded import encode_stage
from evonav.evaluation.records.schema import EndState, MemoryRecord, MovedObjectRecord, StaleEntryRecord
from evonav.evaluation.records.store import RunStore


def memory(num_entries=4, num_right=3, num_held=2, num_seen=4, num_seen_held=1):
    return MemoryRecord(
        num_entries=num_entries,
        num_right=num_right,
        num_held=num_held,
        num_seen=num_seen,
        num_seen_held=num_seen_held,
        position_error_m=0.1,
    )


def store_of(tmp_path, *records, costs=None):
    with RunStore(tmp_path, create=True) as store:
        for record in records:
            store.add_stage(encode_stage(record, wall_s=2.0, cpu_s=1.0, costs=costs))
    return RunStore(tmp_path)


def test_visits_of_stale_entries_are_runs_of_rounds_with_one_chosen():
    old, older = entry(is_stale=True), entry(entry_id=8, is_stale=True)
    trace = [taken(i, chosen) for i, chosen in enumerate([None, old, old, older, entry(), old, None])]
    row = metrics_of(made_up_record(trace=tuple(trace)))
    assert (row.num_stale_visits, row.num_stale_rounds, row.stale_path_m) == (3, 4, 2.0)


def test_evidence_is_told_in_rounds_and_metres():
    trace = tuple(taken(i, step_m=0.5 if i else 0.25) for i in range(6))
    record = made_up_record(
        trace=trace,
        memory_at_end=memory(),
        stale_entries=(
            StaleEntryRecord(label="Mug", centre_m=(0, 0, 0), evident_round=0, cleared_round=2),
            StaleEntryRecord(label="Mug", centre_m=(0, 0, 0), evident_round=1, cleared_round=1),
            StaleEntryRecord(label="Mug", centre_m=(0, 0, 0), evident_round=4),
            StaleEntryRecord(label="Mug", centre_m=(0, 0, 0)),
        ),
        moved_objects=(MovedObjectRecord(object_id="a", seen_round=1, found_round=5), MovedObjectRecord(object_id="b")),
    )
    row = metrics_of(record)
    assert (row.num_stale_at_start, row.num_stale_evident, row.num_stale_cleared) == (4, 3, 2)
    assert (row.rounds_to_clear, row.metres_to_clear) == (1.0, pytest.approx((0.75 + 0.0) / 2))
    assert (row.num_moved, row.num_moved_seen, row.num_moved_found) == (2, 1, 1)
    assert (row.rounds_to_find, row.metres_to_find) == (4.0, 2.0)


def test_memory_is_told_as_precision_and_recall():
    entries = (entry(), entry(is_stale=True), entry(), entry())
    row = metrics_of(made_up_record(entries=entries, memory_at_start=memory(5, 1), memory_at_end=memory()))
    assert (row.precision, row.recall, row.num_duplicates, row.num_seen_objects) == (0.75, 0.25, 1, 4)
    assert (row.precision_at_start, row.recall_at_start, row.num_stale_entries) == (0.2, 0.25, 1)
    blank = metrics_of(made_up_record(memory_at_end=memory(0, 0, 0, 0, 0)))
    assert (blank.precision, blank.recall, blank.num_entries) == (None, None, 0)


def test_entries_of_doors_and_windows_are_in_no_measure_of_memory():
    structures = (entry("Window"), entry("Doorway", is_stale=True), entry("Doorframe"))
    entries = (entry(), entry(is_stale=True))
    alone, among = (
        metrics_of(made_up_record(entries=shown, memory_at_end=memory())) for shown in (entries, structures + entries)
    )
    assert (among.num_entries, among.num_stale_entries, among.precision) == (2, 1, 0.5)
    assert among == alone


@pytest.mark.parametrize(
    ("has_stopped", "is_visible", "box_m", "expected"),
    [(True, True, 1.0, True), (True, True, 1.01, False), (False, True, 0.5, False), (True, False, 0.5, False)],
)
def test_strict_success_takes_a_stop_nearness_and_sight(has_stopped, is_visible, box_m, expected):
    trace = (taken(0, is_target_visible=True), taken(1, is_target_visible=is_visible))
    record = made_up_record(trace=trace, has_stopped=has_stopped, terminal_box_distance_m=box_m)
    assert metrics_of(record).is_strict_success is expected


def test_ring_spl_leaves_out_stages_that_start_within_the_radius():
    assert metrics_of(made_up_record(EndState.SUCCESS, reference_ring_m=2.5)).ring_spl == 0.5
    assert metrics_of(made_up_record(EndState.SUCCESS, reference_ring_m=6.0)).ring_spl == 1.0
    assert metrics_of(made_up_record(reference_ring_m=2.5)).ring_spl == 0.0
    assert metrics_of(made_up_record(EndState.SUCCESS, reference_ring_m=0.0)).ring_spl is None


def test_other_radii_are_read_off_the_terminal_distance(tmp_path):
    with store_of(tmp_path, made_up_record(), made_up_record(EndState.ERRORED, stage=2, error="agent")) as store:
        row, errored = read_stage_metrics(store)
    assert [row.is_success_at(radius_m) for radius_m in (2.0, 3.0, 3.1)] == [False, False, True]
    assert errored.is_success_at(9.0) is None
    assert not errored.is_scored


def test_counters_are_told_a_stage_and_begin_anew_with_the_agent(tmp_path):
    def stage(number, decisions, **fields):
        counters = {"decisions": decisions, "failed_decisions": decisions // 2}
        return made_up_record(stage=number, trace=(taken(0, counters=counters),), **fields)

    with store_of(tmp_path, stage(1, 4), stage(2, 10), stage(3, 3, memory_lost_at=3)) as store:
        rows = read_stage_metrics(store)
    assert [row.num_decisions for row in rows] == [4, 6, 3]
    assert [row.num_failed_decisions for row in rows] == [2, 3, 1]
    assert [row.num_conflicts for row in rows] == [None, None, None]


def test_what_a_change_made_stale_is_the_precision_before_less_that_after(tmp_path):
    first = made_up_record(entries=(entry(), entry(), entry(), entry(is_stale=True)), memory_at_end=memory())
    second = made_up_record(stage=2, memory_at_start=memory(4, 1), memory_at_end=memory())
    with store_of(tmp_path, first, second) as store:
        rows = read_stage_metrics(store)
    assert [(row.precision_before, row.precision_at_start) for row in rows] == [(None, None), (0.75, 0.25)]


def test_costs_come_from_the_side_table_and_never_from_records(tmp_path):
    costs = StageCosts(agent_wall_s=1.5, input_tokens=7)
    with store_of(tmp_path, made_up_record(), costs=costs) as store:
        (row,) = read_stage_metrics(store)
        assert "1.5" not in next(iter(store.record_texts()))
    assert (row.wall_s, row.cpu_s, row.agent_wall_s, row.input_tokens, row.cost_usd) == (2.0, 1.0, 1.5, 7, None)
    assert row.num_retries == 0


def test_rows_are_flat_and_of_the_agents_asked_for(tmp_path):
    with store_of(tmp_path, made_up_record(agent="a"), made_up_record(agent="b")) as store:
        assert [row.agent for row in read_stage_metrics(store, ["b"])] == ["b"]
        (row, _) = read_stage_metrics(store)
    for field in fields(StageMetrics):
        assert isinstance(getattr(row, field.name), str | int | float | bool | None), field.name
    assert next(field.name for field in fields(StageMetrics)) == "agent"


def test_forgetting_an_episode_forgets_its_metrics(tmp_path):
    with store_of(tmp_path, made_up_record(), made_up_record(stage=2), costs=StageCosts(cost_usd=1.0)) as store:
        store.forget_episode("fu", "t", 2)
        assert [row.stage for row in read_stage_metrics(store)] == [1]
        assert [key for key, _ in store.encoded_metrics()] == list(store.costs()) == [("fu", "t", 1)]
        store.add_stage(encode_stage(made_up_record(stage=2), wall_s=1.0, cpu_s=1.0, costs=StageCosts(cost_usd=2.0)))
        assert read_stage_metrics(store)[1].cost_usd == 2.0
