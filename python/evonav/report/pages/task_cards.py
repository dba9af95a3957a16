"""Show a task on a run's page: its goals, and a map with the outcome of every agent and stage."""

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from evonav.counted import counted
from evonav.drawing.floor_plan import furniture, ground, item_labels, labels, moving_ids
from evonav.drawing.svg import clean, join, slug
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.report.maps.stage_map import task_frame
from evonav.report.maps.text import describe_change, describe_outcome
from evonav.report.maps.trajectory import change, course, rounds
from evonav.report.run import RecordedRun, RecordedTask
from evonav.report.tables.causes import sentence


def task_view(
    run: RecordedRun, task: RecordedTask, prefix: str, hrefs: Mapping[tuple[str, str, int], str]
) -> dict[str, Any]:
    """Draw a task: the house once, what moves once a stage, every agent's stages over them.

    Returns the values of the template: its `goals` are stage, a record that states the goal, what changed before and
    the reference image; its `rows` are an agent and a cell per stage.

    `prefix` begins the ids in the page; `hrefs` link to stages round by round, by agent, task and stage.
    """
    records = list(task.records.values())
    frame = task_frame(task.maps, records)
    shared = list(task.maps.values())
    moving = moving_ids(shared)
    defs = []
    if shared:
        fixed = [item for item in shared[0].objects if item.object_id not in moving]
        defs.append(_shared(prefix, ground(shared[0], frame, moving)))
        defs.append(_shared(f"{prefix}n", labels(shared[0], frame)))
        defs.append(_shared(f"{prefix}f", item_labels(fixed, frame)))
    for stage, floor_plan in task.maps.items():
        items = [item for item in floor_plan.objects if item.object_id in moving]
        recorded = next((record for record in records if record.stage == stage), None)
        changed = "" if recorded is None else change(recorded, task.maps, frame)
        defs.append(_shared(f"{prefix}s{stage}", furniture(items, frame) + changed))
        defs.append(_shared(f"{prefix}f{stage}", item_labels(items, frame)))
    stages = range(1, task.num_stages + 1)

    def cell_of(agent: str, stage: int) -> dict[str, Any]:
        record = task.records.get((agent, stage))
        if record is None:
            cell = {"state": "not_run", "outcome": "no record yet", "sentence": "This stage has no record yet."}
            return {**cell, "facts": "", "rounds": [], "svg": "", "href": None}
        below = _uses(prefix, stage) if stage in task.maps else change(record, task.maps, frame)
        name = clean(f"Map of stage {stage} for {run.names[agent]}")
        opening = Markup('<svg class="map" viewBox="{}" role="img" aria-label="{}">').format(frame.view_box, name)
        drawn = opening + Markup(below + course(record, frame, run.success_radius_m) + "</svg>")  # noqa: S704
        href = hrefs.get((agent, task.task_id, stage))
        return {**stage_cell(record, drawn), "facts": _facts(record), "href": href}

    goals = []
    for stage in stages:
        recorded = next((task.records[agent, stage] for agent in run.agents if (agent, stage) in task.records), None)
        image = task.maps[stage].reference_image if stage in task.maps else None
        goals.append((stage, recorded, "" if recorded is None else describe_change(recorded, task.maps), image))
    return {
        "anchor": slug(task.task_id),
        "task_id": task.task_id,
        "house": records[0].house if records else "",
        "num_rooms": len(shared[0].rooms) if shared else 0,
        "defs": Markup(join(defs)),  # noqa: S704 - our own SVG
        "goals": goals,
        "rows": [(run.names[agent], [cell_of(agent, stage) for stage in stages]) for agent in run.agents],
        "data": filter_data(run, task.task_id),
    }


def stage_cell(record: StageRecord, svg: Markup) -> dict[str, Any]:
    """Return a stage of an agent as templates show it, below its map."""
    return {
        "state": record.state.value,
        "outcome": describe_outcome(record),
        "sentence": sentence(record),
        "rounds": rounds(record.trace),
        "svg": svg,
    }


def _shared(name: str, drawing: str) -> str:
    """Return a group that many pictures show; style rules reach into it from its own root only, hence the class."""
    return f'<g class="map" id="{name}">{drawing}</g>'


def _uses(prefix: str, stage: int) -> str:
    """Return a stage's house from its shared groups; names of furniture (`fine`) are for large pictures."""
    ids = (prefix, f"{prefix}s{stage}", f"{prefix}n")
    fine = (f"{prefix}f", f"{prefix}f{stage}")
    return join([f'<use href="#{name}"/>' for name in ids] + [f'<use class="fine" href="#{name}"/>' for name in fine])


def _facts(record: StageRecord) -> str:
    """Return the numbers of a stage in a line."""
    parts = [counted(record.num_rounds, "round")]
    if record.path_length_m is not None:
        shortest = "" if record.reference_length_m is None else f" (shortest {record.reference_length_m:.1f} m)"
        parts.append(f"walked {record.path_length_m:.1f} m{shortest}")
    parts.append(f"target in view in {counted(record.num_target_visible_rounds, 'round')}")
    num_stale = sum(entry.is_stale for entry in record.entries)
    if record.entries:
        parts.append(f"{counted(len(record.entries), 'entry')}, {num_stale} stale")
    if record.is_snapped:
        parts.append("start moved to the nearest free place")
    if record.transition.is_agent_in_room:
        parts.append("stood in the room as it changed")
    return " · ".join(parts)


def filter_data(run: RecordedRun, task_id: str) -> dict[str, str]:
    """Return the `data-*` attributes of a task that the page's filters use."""
    stages = range(1, run.num_stages[task_id] + 1)
    keys = [(agent, task_id, stage) for agent in run.agents for stage in stages]
    outcomes = {key: run.outcomes[key] for key in keys if key in run.outcomes}
    states = {key: outcome.row.state for key, outcome in outcomes.items()}
    ends = [{states.get((agent, task_id, stage)) for agent in run.agents} for stage in stages]
    causes = sorted({outcome.cause.name for outcome in outcomes.values() if outcome.cause is not None})
    categories = {outcome.category.lower() for outcome in outcomes.values()}
    return {
        "task": slug(task_id),
        "failures": str(sum(state != EndState.SUCCESS for state in states.values())),
        "disagreements": str(sum(EndState.SUCCESS.value in end and len(end) > 1 for end in ends)),
        "causes": " ".join(causes),
        "words": " ".join([task_id.lower(), *sorted(categories)]),
    }
