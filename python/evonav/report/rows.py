"""A stage as one row of plain values."""

from collections.abc import Sequence
from dataclasses import dataclass

from evonav.evaluation.records import StageRecord
from evonav.evaluation.store import RunStore
from evonav.report.causes import cause_of


@dataclass(frozen=True, slots=True)
class StageRow:
    """One stage of one agent."""

    agent: str
    task_id: str
    house: str
    stage: int
    state: str
    success: bool | None
    spl: float | None
    soft_spl: float | None
    terminal_distance_m: float | None
    path_length_m: float | None
    reference_length_m: float | None
    start_distance_m: float | None
    num_rounds: int
    has_stopped: bool
    cause: str | None
    mode: str
    category: str
    stratum: str
    num_stages: int


def stage_rows(store: RunStore, agents: Sequence[str] | None = None) -> list[StageRow]:
    """Rows of a run."""
    return [
        _row(record)
        for agent in (agents if agents is not None else (None,))
        for record in store.records(agent, is_brief=True)
    ]


def _row(record: StageRecord) -> StageRow:
    cause = cause_of(record)
    stratum = "stage_1" if record.stage == 1 else "relocated" if record.target.is_relocated else "not_relocated"
    return StageRow(
        agent=record.agent,
        task_id=record.task_id,
        house=record.house,
        stage=record.stage,
        state=record.state.value,
        success=record.state.value == "success" if record.is_scored else None,
        spl=record.spl,
        soft_spl=record.soft_spl,
        terminal_distance_m=record.terminal_distance_m,
        path_length_m=record.path_length_m,
        reference_length_m=record.reference_length_m,
        start_distance_m=record.start_distance_m,
        num_rounds=record.num_rounds,
        has_stopped=record.has_stopped,
        cause=None if cause is None else cause.value,
        mode="first" if record.stage == 1 else record.transition.kind,
        category=record.target.category,
        stratum=stratum,
        num_stages=record.num_stages,
    )
