"""Describe a stage of a task in words: the change before it, its goal, and the goals that were refused."""

from collections import Counter
from collections.abc import Callable

from evonav.counted import counted
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.report.tables.table import mode_words
from evonav.tasks.language import noun_of
from evonav.tasks.oracle import Evolution, OracleStage

OUTCOMES = {
    "first_stage": "The first stage: the house as in its file.",
    "not_triggered": "Nothing changed before this stage.",
    "no_room": "A change was drawn, but no room could take one.",
    "no_placement": "A change was drawn, but nothing could be moved",
    "evolved": "",
}
FAILURES = {
    "nothing_movable": "the room holds nothing that moves",
    "no_free_place": "no free place was found",
    "cuts_off": "every free place would have cut something off",
}


def stage_facts(floor_plan: FloorPlan, oracle: OracleStage) -> list[tuple[str, str]]:
    """Name and value of what a stage's page lists."""
    nouns = {item.object_id: noun_of(item.category) for item in floor_plan.objects}
    rooms = room_namer(floor_plan)
    target, evolution = oracle.target, oracle.evolution
    others = f", {len(target.same_category_ids)} more of its kind" if target.same_category_ids else ", the only one"
    where = f" on the {nouns.get(target.support_id, target.support_id)}" if target.support_id else ""
    moved = (
        "moved just now" if target.is_relocated_now else "moved earlier" if target.is_relocated_ever else "never moved"
    )
    facts = [
        ("target", f"{noun_of(target.category)} {target.id}{where}, {rooms(target.room_id)}{others}; {moved}"),
        ("reference", f"{oracle.reference_path_length_m:.1f} m, {oracle.reference_visible_px} px of the target seen"),
    ]
    if oracle.state.transition_room_id is not None:
        facts.append(("transition room", rooms(oracle.state.transition_room_id)))
    if oracle.rejections:
        refused = [f"{nouns.get(item.id, item.id)} ({item.reason.replace('_', ' ')})" for item in oracle.rejections]
        facts.append(("goals refused", ", ".join(refused)))
    if oracle.during is not None:
        where = "the target moves" if oracle.during.is_target_relocated else "the target stays"
        sentence = change_sentence(floor_plan, oracle.during.evolution)
        facts.append((f"during the stage, round {oracle.during.round}", f"{sentence} {where.capitalize()}."))
    lists = {
        "found no place": evolution.unmoved_ids,
        "would have cut something off": evolution.blocking_ids,
        "stand closer than usual": evolution.crowded_ids,
        "rearranged": evolution.rearranged_ids,
    }
    for name, ids in lists.items():
        if ids:
            facts.append((name, ", ".join(f"{nouns.get(i, '')} {i}".strip() for i in ids)))
    if evolution.room_weights:
        weights = (f"{rooms(weight.room_id)} {weight.weight:g}" for weight in evolution.room_weights)
        facts.append(("rooms' weights", ", ".join(weights)))
    return facts


def change_sentence(floor_plan: FloorPlan, evolution: Evolution) -> str:
    """Describe what changed before a stage, in one sentence."""
    text = OUTCOMES[evolution.outcome]
    if evolution.outcome == "no_placement":
        text += f": {FAILURES[evolution.failure]}." if evolution.failure else "."
    if evolution.outcome == "evolved" and evolution.mode is not None:
        room = room_namer(floor_plan)(evolution.room_id or "")
        moved = f"{counted(len(evolution.changes), 'object')} moved"
        if evolution.changes:
            farthest = max(evolution.changes, key=lambda change: (change.displacement_m, change.id))
            moved += f", farthest the {noun_of(farthest.category)}, by {farthest.displacement_m:.1f} m"
        text = f"{mode_words(evolution.mode).capitalize()} in the {room}: {moved}."
    extra = [
        (len(evolution.additions), "came"),
        (len(evolution.removals), "went"),
        (len(evolution.states), "opened, closed or switched"),
    ]
    more = ", ".join(f"{num} {what}" for num, what in extra if num)
    return f"{text} By extensions: {more}.".strip() if more else text


def move_rows(floor_plan: FloorPlan, evolution: Evolution) -> list[tuple[str, ...]]:
    """List moved objects, the farthest first: object, id, distance, turn, old and new support, cause."""
    nouns = {item.object_id: noun_of(item.category) for item in floor_plan.objects}
    rows: list[tuple[str, ...]] = []
    for change in sorted(evolution.changes, key=lambda change: (-change.displacement_m, change.id)):
        turn_deg = (change.to_rotation_deg[1] - change.from_rotation_deg[1]) % 360.0
        supports = (change.from_support_id, change.to_support_id)
        stood, stands = (nouns.get(support, support) if support else "floor" for support in supports)
        on = stood if supports[0] == supports[1] else f"{stood} to {stands}"
        turn = f"{turn_deg:.0f}°"
        noun = noun_of(change.category)
        rows.append((noun, change.id, f"{change.displacement_m:.2f} m", turn, on, change.cause or ""))
    for what, records in (("came", evolution.additions), ("went", evolution.removals)):
        for record in records:
            support = nouns.get(record.support_id or "", "floor")
            rows.append((noun_of(record.category), record.id, what, "", support, record.cause))
    rows += [
        (noun_of(s.category), s.id, f"{s.field} {s.before:g} to {s.after:g}", "", "", s.cause) for s in evolution.states
    ]
    return rows


def room_namer(floor_plan: FloorPlan) -> Callable[[str], str]:
    """Return a function that names rooms: their type, with the room's number where several are of that type."""
    types = Counter(room.room_type for room in floor_plan.rooms)
    names = {}
    for room in floor_plan.rooms:
        number = room.room_id.rsplit("|", 1)[-1]
        names[room.room_id] = noun_of(room.room_type) + (f" {number}" if types[room.room_type] > 1 else "")
    return lambda room_id: names.get(room_id, room_id)
