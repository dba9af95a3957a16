"""A finished stage is validated and encoded once."""

import json
from dataclasses import replace

import pytest
from made_up_stage import made_up_record, taken
from pydantic import ValidationError

from evonav.evaluation.records.costs import StageCosts
from evonav.evaluation.records.encoded import encode_stage
from evonav.evaluation.records.schema import EndState, ErrorKind, RoundRecord, StageError, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.worker import EVENT


def test_a_stage_survives_its_text():
    error = StageError(kind=ErrorKind.CRASH, message="two\nlines")
    record = made_up_record(stage=2).model_copy(update={"state": EndState.ERRORED, "error": error})
    stage = encode_stage(
        record, wall_s=1.5, cpu_s=0.5, costs=StageCosts(cost_usd=2.0, num_questions=3), traceback="a\nb"
    )
    assert EVENT.validate_json(EVENT.dump_json(stage)) == stage
    assert stage.failure is not None
    assert stage.failure.traceback == "a\nb"
    assert repr(EVENT.validate_json(EVENT.dump_json(stage)).costs) == "{'num_questions': 3, 'cost_usd': 2.0}"


def test_a_record_that_was_copied_with_invalid_parts_is_refused():
    record = made_up_record(stage=2)
    wrong_target = record.target.model_copy(update={"position_m": (1.0, "north")})
    for update in ({"stage": 0}, {"path_length_m": "far"}, {"target": wrong_target}):
        with pytest.raises(ValidationError):
            encode_stage(record.model_copy(update=update), wall_s=0.0, cpu_s=0.0)


def test_a_round_is_validated_once_when_it_is_made():
    one = taken(0)
    for wrong in ({"round": 2**63}, {"pose": replace(one.pose, x_m=2e9)}, {"path_m": ((0.0, "north"),)}):
        with pytest.raises(ValidationError):
            RoundRecord.model_validate(dict(one) | wrong)
    assert StageRecord.model_validate(made_up_record(stage=2, trace=(one,))).trace[0] is one


def test_the_store_keeps_the_text_of_the_worker(tmp_path, monkeypatch):
    stage = encode_stage(made_up_record(stage=2).model_copy(update={"path_length_m": 3}), wall_s=0.0, cpu_s=0.0)
    assert json.loads(stage.record)["path_length_m"] == 3.0
    assert '"path_length_m":3.0' in stage.record  # as a validated record is written
    received = EVENT.validate_json(EVENT.dump_json(stage))
    for name in ("model_validate", "model_validate_json", "model_dump_json"):
        monkeypatch.setattr(StageRecord, name, None)
    with RunStore(tmp_path, create=True) as store:
        store.add_stage(received)
        assert list(store.record_texts()) == [stage.record]
        assert [text for _, text in store.encoded_metrics()] == [stage.metrics]
