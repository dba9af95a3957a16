import pytest
from made_up_stage import entry, made_up_record, taken

from evonav.evaluation.metrics.failure_causes import FailureCause, cause_of
from evonav.evaluation.records.schema import EndState

FAR_M = (0.0, 0.8, 4.0)


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        (None, FailureCause.NO_OBJECT),
        (entry(is_stale=True), FailureCause.STALE_ENTRY),
        (entry("Cup", is_stale=True), FailureCause.STALE_ENTRY),
        (entry("Cup"), FailureCause.WRONG_CATEGORY),
        (entry(centre_m=FAR_M), FailureCause.WRONG_INSTANCE),
        (entry(centre_m=(5.0, 3.0, 1.9)), FailureCause.STOPPED_SHORT),
    ],
)
def test_a_stop_is_judged_by_the_entry_it_was_made_at(chosen, expected):
    # What it had chosen before does not matter.
    record = made_up_record(trace=(taken(0, entry("Bed")), taken(1, chosen)), has_stopped=True)
    assert cause_of(record) is expected


@pytest.mark.parametrize(
    ("is_visible", "entries", "chosen", "expected"),
    [
        (False, [entry()], None, FailureCause.NEVER_IN_VIEW),
        (True, [], None, FailureCause.NOT_REMEMBERED),
        (True, [entry(centre_m=FAR_M)], None, FailureCause.NOT_REMEMBERED),
        (True, [entry(is_stale=True)], entry(is_stale=True), FailureCause.NOT_REMEMBERED),
        (True, [entry("Cup")], entry("Cup"), FailureCause.NOT_REMEMBERED),
        (True, [entry()], None, FailureCause.NOT_APPROACHED),
        (True, [entry()], entry(centre_m=FAR_M), FailureCause.NOT_APPROACHED),
        (True, [entry()], entry(), FailureCause.NOT_REACHED),
    ],
)
def test_a_spent_budget_is_judged_by_what_was_seen_known_and_chosen(is_visible, entries, chosen, expected):
    trace = (taken(0, chosen, is_target_visible=is_visible), taken(1))
    assert cause_of(made_up_record(trace=trace, entries=tuple(entries))) is expected


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("reference", FailureCause.NO_PATH),
        ("decision", FailureCause.DECISION_FAILURE),
        ("agent", FailureCause.AGENT_ERROR),
        ("crash", FailureCause.AGENT_ERROR),
        ("timeout", FailureCause.AGENT_ERROR),
        ("simulation", FailureCause.HARNESS_ERROR),
        ("simulator_lost", FailureCause.HARNESS_ERROR),
        ("harness", FailureCause.HARNESS_ERROR),
    ],
)
def test_an_error_is_told_by_whose_it_is(kind, expected):
    assert cause_of(made_up_record(EndState.ERRORED, error=kind)) is expected
    assert cause_of(made_up_record(EndState.NOT_RUN, error=kind)) is FailureCause.NOT_RUN


def test_a_success_has_no_cause():
    assert cause_of(made_up_record(EndState.SUCCESS, trace=(taken(0, entry(is_stale=True)),), has_stopped=True)) is None
