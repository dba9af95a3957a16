"""Describe how a stage ended: its record, its cost and, if it failed, why."""

from dataclasses import dataclass

from evonav.evaluation.records.costs import StageCosts
from evonav.evaluation.records.schema import EndState, ErrorKind, StageError, StageFailure, StageRecord


@dataclass(frozen=True, slots=True)
class StageOutcome:
    """A finished stage and its cost."""

    record: StageRecord
    wall_s: float
    cpu_s: float
    traceback: str = ""
    """The traceback of an errored stage."""
    costs: StageCosts | None = None

    @property
    def failure(self) -> StageFailure | None:
        """The reason why the stage is errored; `None` if it is not."""
        record = self.record
        if record.error is None or record.state is not EndState.ERRORED:
            return None
        return StageFailure(record.stage, record.error.kind, record.error.message, self.traceback)


def as_errored(record: StageRecord, kind: ErrorKind, message: str) -> StageRecord:
    """Return the record as that of an errored stage, which has no score."""
    return record.model_copy(
        update={
            "state": EndState.ERRORED,
            "error": StageError(kind=kind, message=message),
            "spl": None,
            "soft_spl": None,
        }
    )


def as_not_run(record: StageRecord, cause: StageError, stage: int) -> StageRecord:
    """Return the record as that of a stage that was not run because stage number `stage` is errored."""
    error = StageError(kind=cause.kind, message=f"stage {stage} is errored: {cause.message}")
    return record.model_copy(update={"state": EndState.NOT_RUN, "error": error})
