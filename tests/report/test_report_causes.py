import pytest
from made_up_run import entry, stage_record

from evonav.evaluation.records.schema import EndState, EntryRecord
from evonav.report.tables.causes import Cause, cause_of, sentence

AT_TARGET_M = (2.3, 0.8, 2.0)
ELSEWHERE_M = (8.0, 0.8, 1.0)


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        (None, Cause.NO_OBJECT),
        (entry("Plate", AT_TARGET_M, is_stale=True), Cause.STALE_ENTRY),
        (entry("Mug", AT_TARGET_M, is_stale=False), Cause.WRONG_CATEGORY),
        (entry("Plate", ELSEWHERE_M, is_stale=False), Cause.WRONG_INSTANCE),
        (entry("Plate", AT_TARGET_M, is_stale=False), Cause.STOPPED_SHORT),
    ],
)
def test_a_stop_is_judged_by_what_it_stopped_at(chosen: EntryRecord | None, expected: Cause) -> None:
    record = stage_record("fu", "t", 1, EndState.FAILURE, chosen=chosen)
    assert cause_of(record) is expected
    assert sentence(record).endswith(", 3.5 m away.")


@pytest.mark.parametrize(
    ("num_visible", "entries", "expected"),
    [
        (0, [], Cause.NEVER_IN_VIEW),
        (2, [], Cause.NOT_REMEMBERED),
        (2, [entry("Plate", ELSEWHERE_M, is_stale=False)], Cause.NOT_REMEMBERED),
        (2, [entry("Plate", AT_TARGET_M, is_stale=False)], Cause.NOT_APPROACHED),
    ],
)
def test_a_spent_budget_is_judged_by_what_was_seen(
    num_visible: int, entries: list[EntryRecord], expected: Cause
) -> None:
    record = stage_record("fu", "t", 1, EndState.FAILURE, has_stopped=False, num_visible=num_visible, entries=entries)
    assert cause_of(record) is expected


def test_success_has_no_cause_and_errors_speak_for_themselves() -> None:
    assert cause_of(stage_record("fu", "t", 1, EndState.SUCCESS)) is None
    assert cause_of(stage_record("fu", "t", 1, EndState.ERRORED)) is Cause.HARNESS_ERROR
    assert sentence(stage_record("fu", "t", 1, EndState.ERRORED)) == "Errored (simulation): the floor <gave> way"
    assert cause_of(stage_record("fu", "t", 1, EndState.NOT_RUN)) is Cause.NOT_RUN


def test_sentences_name_what_was_stopped_at() -> None:
    stale = entry("SideTable", AT_TARGET_M, is_stale=True)
    assert sentence(stage_record("fu", "t", 1, EndState.FAILURE, chosen=stale)) == (
        "Stopped at a stale entry (side table), 3.5 m away."
    )
    assert sentence(stage_record("fu", "t", 1, EndState.SUCCESS)) == "Stopped at it, 1.0 m away."
    late = stage_record("fu", "t", 1, EndState.SUCCESS, has_stopped=False)
    assert sentence(late) == "There when the rounds ran out, 1.0 m away."
    lost = stage_record("fu", "t", 1, EndState.FAILURE).model_copy(update={"stop_reason": "nothing to go to"})
    assert sentence(lost) == "Stopped without an object (nothing to go to), 3.5 m away."
