"""Encode a finished stage once, as the text that workers send and the store keeps."""

import json
from collections.abc import Mapping
from dataclasses import dataclass

from pydantic import ValidationError

from evonav.evaluation.metrics.stage_metrics import encode_metrics
from evonav.evaluation.records.costs import StageCosts
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import EndState, StageFailure, StageRecord
from evonav.records import sentence_of


@dataclass(frozen=True, slots=True)
class EncodedStage:
    """A finished stage as the store writes it. Nobody needs to parse its texts on the way."""

    agent: str
    task_id: str
    stage: int
    state: EndState
    record: str
    """The validated record as JSON."""
    metrics: str
    """The metrics of the record as JSON (`encode_metrics`)."""
    wall_s: float
    cpu_s: float
    costs: Mapping[str, int | float] | None = None
    """The measured costs by field of `StageCosts`; `None` if nothing was measured."""
    failure: StageFailure | None = None
    """The reason why the stage is errored; `None` if it is not."""
    floor_plan: str | None = None
    """The floor plan of the stage's house as JSON; `None` if another episode of the task sends it."""

    @property
    def key(self) -> tuple[str, str, int]:
        """Agent, task and stage."""
        return self.agent, self.task_id, self.stage

    @property
    def label(self) -> str:
        """Agent, task and stage, for people."""
        return f"{self.agent} {self.task_id}/{self.stage}"

    @property
    def is_scored(self) -> bool:
        """True if the stage counts in rates."""
        return self.state.is_scored


def encode_stage(
    record: StageRecord,
    *,
    wall_s: float,
    cpu_s: float,
    costs: StageCosts | None = None,
    traceback: str = "",
    floor_plan: FloorPlan | None = None,
) -> EncodedStage:
    """Validate a record, derive its metrics, and encode both.

    Args:
        record: The whole record, with its trace. It may have been made by `model_copy`, which does not validate.
        costs: All costs of the stage, if they were measured.
        floor_plan: The floor plan of the stage's house, if it is to be stored.

    Raises:
        ValidationError: The record is not valid.
    """
    valid = StageRecord.model_validate(record)
    failure = None
    if valid.state is EndState.ERRORED and valid.error is not None:
        failure = StageFailure(valid.stage, valid.error.kind, valid.error.message, traceback)
    return EncodedStage(
        agent=valid.agent,
        task_id=valid.task_id,
        stage=valid.stage,
        state=valid.state,
        record=valid.model_dump_json(),
        metrics=encode_metrics(valid),
        wall_s=wall_s,
        cpu_s=cpu_s,
        costs=None if costs is None else {k: v for k, v in vars(costs).items() if v is not None},
        failure=failure,
        floor_plan=None if floor_plan is None else floor_plan.model_dump_json(),
    )


def invalid_record(text: str, error: ValidationError) -> str:
    """Name a record that cannot be read, and its first wrong field with its value, in one sentence.

    Args:
        error: The error of the model that read it.
    """
    try:
        key = json.loads(text)
        name = f"the record of {key['agent']}, {key['task_id']}, stage {key['stage']}"
    except (ValueError, TypeError, KeyError):
        name = "a record"
    return f"{name} is not valid: {sentence_of(error)}"
