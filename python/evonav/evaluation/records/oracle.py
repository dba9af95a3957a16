"""Convert a task's oracle data to the parts of records that describe target and hidden change."""

from evonav.evaluation.records.schema import ChangeDuringStage, Relocation, TargetRecord, TransitionRecord
from evonav.tasks import Task
from evonav.tasks.oracle import Evolution, OracleStage


def target_record(task: Task, stage: int) -> TargetRecord:
    """Return the target of a stage.

    Args:
        stage: 1-based.
    """
    target = task.oracle(stage).target
    first_m = next(
        (
            change.from_position_m
            for evolution in task.evolutions_before(stage)
            for change in evolution.changes
            if change.id == target.id and change.is_relocated
        ),
        None,
    )
    return TargetRecord(
        object_id=target.id,
        category=target.category,
        position_m=target.position_m,
        room_id=target.room_id,
        is_relocated=target.is_relocated_ever,
        is_relocated_now=target.is_relocated_now,
        first_position_m=first_m,
    )


def during_record(oracle: OracleStage) -> ChangeDuringStage | None:
    """Return the change during a stage as its record has it before the stage; `None` without one."""
    if oracle.during is None:
        return None
    return ChangeDuringStage(round=oracle.during.round, change=transition_record(oracle.during.evolution))


def transition_record(evolution: Evolution) -> TransitionRecord:
    """Return a hidden change."""
    is_evolved = evolution.outcome == "evolved"
    return TransitionRecord(
        mode=evolution.mode if is_evolved else None,
        room_id=evolution.room_id if is_evolved else None,
        num_added=len(evolution.additions),
        num_removed=len(evolution.removals),
        num_states=len(evolution.states),
        relocations=tuple(
            Relocation(
                object_id=change.id,
                category=change.category,
                from_m=change.from_position_m,
                to_m=change.to_position_m,
            )
            for change in evolution.changes
            if change.is_relocated
        ),
    )
