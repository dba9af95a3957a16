from made_up_run import entry, stage_record

from evonav.evaluation.records.schema import EndState
from evonav.report.tables.causes import sentence

AT_TARGET_M = (2.3, 0.8, 2.0)


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
    errored = stage_record("fu", "t", 1, EndState.ERRORED)
    assert sentence(errored) == "Errored (simulation): the floor <gave> way"
    not_run = stage_record("fu", "t", 1, EndState.NOT_RUN).model_copy(update={"error": None})
    assert sentence(not_run) == "Not run."
