"""A controlled analysis made up by hand: outcomes by arm."""

from made_up_run import OLD_TABLE_M, entry, floor_plan, stage_record

from evonav.controlled.layout import Arm, ControlledOptions, ControlledRecord, run_of, write_controlled
from evonav.evaluation.records.encoded import encode_stage
from evonav.evaluation.records.schema import EndState, TransitionRecord
from evonav.evaluation.records.store import RunStore
from evonav.tasks.dataset import SourceFile

S, F = EndState.SUCCESS, EndState.FAILURE
PAIRS = {  # by agent: fixed, evolved
    "fu": ([S, S, S, S, S, F], [F, F, F, S, S, F]),
    "stage-reset": ([S, S, S, F, F, F], [S, S, F, F, F, F]),
}


def write_analysis(folder, kind, arms, outcomes, *, num_tasks=6, stages=(2,)):
    """Runs of made-up outcomes: by agent, a list of states for each arm."""
    tasks = tuple(f"task-{i}" for i in range(num_tasks))
    for number, arm in enumerate(arms):
        with RunStore(run_of(folder, arm.name), create=True) as store:
            store.set_meta("agents", list(outcomes))
            store.set_meta("num_stages", dict.fromkeys(tasks, 2))
            store.set_meta("config", {"protocol": {"success_radius_m": 2.0}})
            for agent, states in outcomes.items():
                for i, state in enumerate(states[number][:num_tasks]):
                    for record in made_up(agent, i, state, is_evolved=number > 0, stages=stages):
                        store.add_stage(encode_stage(record, wall_s=1.0, cpu_s=0.5))
                        plan = floor_plan(record.task_id, 1 if number == 0 else record.stage)
                        store.add_floor_plan(plan.task_id, plan.stage, plan.model_dump_json())
    record = ControlledRecord(
        generator="evonav test",
        sources=(SourceFile(name="houses", sha256="0" * 64),),
        limit=None,
        options=ControlledOptions(kind=kind, rates=tuple(arm.evolve_probability for arm in arms)),
        task_ids=tasks,
        num_attempts=num_tasks,
        rejections=(),
    )
    folder.mkdir(exist_ok=True)
    write_controlled(record, folder)
    return folder


def made_up(agent, index, state, *, is_evolved, stages):
    """The walk, and the stage that counts; where the scene evolved, the target moves in even tasks only."""
    walk = stage_record(agent, f"task-{index}", 1, S)
    walk = walk.model_copy(update={"state": EndState.GUIDED, "spl": None, "soft_spl": None, "has_stopped": False})
    stale = entry("Plate", (OLD_TABLE_M[0] + 0.3, 0.8, OLD_TABLE_M[2]), is_stale=True)
    is_misled = is_evolved and state is F and agent == "fu"
    made = [walk]
    for stage in stages:
        record = stage_record(agent, f"task-{index}", stage, state, chosen=stale if is_misled else None)
        update = {"house": f"house-{index}"}
        if not is_evolved:
            target = {"is_relocated": False, "is_relocated_now": False, "first_position_m": None}
            update |= {"transition": TransitionRecord(), "target": record.target.model_copy(update=target)}
        elif index % 2:
            update["target"] = record.target.model_copy(update={"is_relocated_now": False, "is_relocated": False})
        made.append(record.model_copy(update=update))
    return made


ARMS = (Arm(name="fixed", evolve_probability=0.0), Arm(name="evolved", evolve_probability=1.0))
