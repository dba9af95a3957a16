"""A run made up by hand: two rooms, a table that moves with its plate. Never results, only input of tests."""

from collections.abc import Callable, Sequence
from pathlib import Path

from evonav.agents.agent import NavigateTo, Stop
from evonav.drawing.plan import ObjectFootprint, OpeningFootprint, RoomFootprint
from evonav.evaluation.records.encoded import encode_stage
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import (
    EndState,
    EntryRecord,
    ErrorKind,
    GoalRecord,
    Relocation,
    RoundRecord,
    StageError,
    StageRecord,
    TargetRecord,
    TransitionRecord,
)
from evonav.evaluation.records.store import RunStore
from evonav.world.pose import Pose

WriteRun = Callable[..., Path]

OLD_TABLE_M = (2.0, 0.4, 2.0)
NEW_TABLE_M = (7.0, 0.4, 3.0)


def pose(x_m: float, z_m: float) -> Pose:
    return Pose(x_m, 0.9, z_m, 0.5, 0.0)


def box(object_id: str, category: str, centre_m: tuple[float, float, float], x_m: float, z_m: float) -> ObjectFootprint:
    x, _, z = centre_m
    corners = ((-x_m, -z_m), (x_m, -z_m), (x_m, z_m), (-x_m, z_m))
    polygon_m = tuple((x + dx / 2, z + dz / 2) for dx, dz in corners)
    return ObjectFootprint(
        object_id=object_id, category=category, centre_m=centre_m, size_m=(x_m, 0.4, z_m), polygon_m=polygon_m
    )


def floor_plan(task_id: str, stage: int) -> FloorPlan:
    x, y, z = OLD_TABLE_M if stage == 1 else NEW_TABLE_M
    return FloorPlan(
        task_id=task_id,
        house=f"house-of-{task_id}",
        stage=stage,
        rooms=(
            RoomFootprint(room_id="room|1", room_type="Kitchen", polygon_m=((0, 0), (0, 4), (5, 4), (5, 0))),
            RoomFootprint(room_id="room|2", room_type="LivingRoom", polygon_m=((5, 0), (5, 4), (9, 4), (9, 0))),
        ),
        # The inner wall comes once a side, as in ProcTHOR.
        walls=(
            ((0, 0), (0, 4)),
            ((0, 4), (9, 4)),
            ((9, 4), (9, 0)),
            ((9, 0), (0, 0)),
            ((5, 0), (5, 4)),
            ((5, 4), (5, 0)),
        ),
        openings=(
            OpeningFootprint(kind="door", from_m=(5, 1), to_m=(5, 2)),
            OpeningFootprint(kind="window", from_m=(0, 1), to_m=(0, 2)),
        ),
        objects=(
            box("fridge", "Fridge", (0.5, 0.9, 3.5), 0.8, 0.8),
            box("table", "DiningTable", (x, y, z), 1.6, 1.0),
            box("plate", "Plate", (x + 0.3, 0.8, z), 0.2, 0.2),
        ),
    )


def entry(label: str, centre_m: tuple[float, float, float], *, is_stale: bool) -> EntryRecord:
    return EntryRecord(
        entry_id=7, label=label, centre_m=centre_m, size_m=(0.2, 0.1, 0.2), num_detections=3, is_stale=is_stale
    )


def rounds(num: int, chosen: EntryRecord | None, *, has_stopped: bool) -> tuple[RoundRecord, ...]:
    return tuple(
        RoundRecord(
            round=i,
            pose=pose(1.0 + i, 1.0),
            action=Stop() if has_stopped and i == num - 1 else NavigateTo((2.0 + i, 1.0)),
            path_m=((1.0 + i, 1.0),) if has_stopped and i == num - 1 else ((1.0 + i, 1.0), (2.0 + i, 1.0)),
            is_action_success=True,
            is_target_visible=False,
            choice="object 7" if chosen is not None else "frontier 1",
            chosen_entry=chosen,
            num_entries=1,
            num_frontiers=2,
            counters={},
            details={},
        )
        for i in range(num)
    )


def stage_record(
    agent: str,
    task_id: str,
    stage: int,
    state: EndState,
    *,
    num_stages: int = 2,
    chosen: EntryRecord | None = None,
    entries: Sequence[EntryRecord] = (),
    has_stopped: bool = True,
    num_visible: int = 0,
    instruction: str = "Please navigate to the plate on the dining table.",
    category: str = "Plate",
) -> StageRecord:
    is_scored = state in (EndState.SUCCESS, EndState.FAILURE)
    is_later = stage > 1
    x, _, z = NEW_TABLE_M if is_later else OLD_TABLE_M
    shift = tuple(b - a for a, b in zip(OLD_TABLE_M, NEW_TABLE_M, strict=True))
    old_plate_m = (OLD_TABLE_M[0] + 0.3, 0.8, OLD_TABLE_M[2])
    new_plate_m = (old_plate_m[0] + shift[0], 0.8, old_plate_m[2] + shift[2])
    relocations = (
        Relocation(object_id="table", category="DiningTable", from_m=OLD_TABLE_M, to_m=NEW_TABLE_M),
        Relocation(object_id="plate", category="Plate", from_m=old_plate_m, to_m=new_plate_m),
    )
    trace = () if state is EndState.NOT_RUN else rounds(4, chosen, has_stopped=has_stopped and is_scored)
    return StageRecord(
        agent=agent,
        task_id=task_id,
        house=f"house-of-{task_id}",
        stage=stage,
        num_stages=num_stages,
        state=state,
        error=None if is_scored else StageError(kind=ErrorKind.SIMULATION, message="the floor <gave> way"),
        goal=GoalRecord(category=category, instruction=instruction, basic_instruction=instruction),
        target=TargetRecord(
            object_id="plate",
            category="Plate",
            position_m=(x + 0.3, 0.8, z),
            room_id="room|1",
            is_relocated=is_later,
            is_relocated_now=stage == 2,
            first_position_m=old_plate_m if is_later else None,
        ),
        transition=TransitionRecord(mode="RETAIN_GROUP", room_id="room|1", relocations=relocations)
        if stage == 2
        else TransitionRecord(),
        requested_start=pose(1.0, 1.0),
        effective_start=pose(1.0, 1.0),
        terminal=pose(4.0, 1.0) if is_scored else None,
        num_rounds=len(trace),
        has_stopped=has_stopped and is_scored,
        start_distance_m=3.0,
        terminal_distance_m=1.0 if state is EndState.SUCCESS else 3.5,
        path_length_m=3.0 if is_scored else None,
        reference_length_m=2.4 if is_scored else None,
        spl=None if not is_scored else 0.8 if state is EndState.SUCCESS else 0.0,
        soft_spl=0.5 if is_scored else None,
        num_target_visible_rounds=num_visible,
        trace=trace,
        entries=tuple(entries),
    )


def record_run(
    run_dir: Path, records: Sequence[StageRecord], num_stages: dict[str, int], agents: Sequence[str]
) -> Path:
    with RunStore(run_dir, create=True) as store:
        store.set_meta("agents", list(agents))
        store.set_meta("num_stages", num_stages)
        store.set_meta("config", {"evonav": "0.1.0", "seed": 3, "protocol": {"success_radius_m": 1.5}})
        for record in records:
            store.add_stage(encode_stage(record, wall_s=1.0, cpu_s=0.5))
            plan = floor_plan(record.task_id, record.stage)
            store.add_floor_plan(plan.task_id, plan.stage, plan.model_dump_json())
    return run_dir


def lettered_run(folder: Path, outcomes: dict[str, str], *, protocol: float = 1.5, seed: int = 3) -> Path:
    """A run of houses of one two-stage task each; an agent's outcomes are letters: `s`, `f`, `e`, or `-` for none."""
    states = {"s": EndState.SUCCESS, "f": EndState.FAILURE, "e": EndState.ERRORED}
    records = [
        stage_record(agent, f"task-{i // 2:02}", i % 2 + 1, states[letter]).model_copy(
            update={"house": f"house-{i // 2:02}"}
        )
        for agent, letters in outcomes.items()
        for i, letter in enumerate(letters)
        if letter != "-"
    ]
    tasks = {f"task-{i:02}": 2 for i in range(max(map(len, outcomes.values())) // 2)}
    record_run(folder, records, tasks, list(outcomes))
    with RunStore(folder) as store:
        store.set_meta("config", {"seed": seed, "tasks": "same", "protocol": {"success_radius_m": protocol}})
    return folder
