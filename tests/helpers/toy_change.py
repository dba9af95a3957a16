"""Changes of the toy house during a stage."""

import json
from dataclasses import replace

from toy_house import OBJECTS, stage_case

from evonav.evaluation.episode.spec import HouseChange
from evonav.evaluation.records.schema import ChangeDuringStage, Relocation, TransitionRecord


def changing_stage(stage, target_id, at_round, moves, **options):
    """A stage of the toy house during which objects move before the views of a round: id -> centre."""
    case = stage_case(stage, target_id, **options)
    were = {key: (options.get("moves") or {}).get(key, OBJECTS[key][1]) for key in OBJECTS}
    relocations = tuple(
        Relocation(object_id=key, category=OBJECTS[key][0], from_m=were[key], to_m=place)
        for key, place in moves.items()
    )
    steps = [
        {"id": key, "position_m": place, "rotation_deg": (0.0, 0.0, 0.0), "parent": None}
        for key, place in moves.items()
    ]
    record = ChangeDuringStage(round=at_round, change=TransitionRecord(mode="SALIENT_OBJECT", relocations=relocations))
    delta_json = json.dumps({"moves": steps, "removed": [], "added": [], "states": []})
    return replace(case, change=HouseChange(record, delta_json, moves.get(target_id, case.target.position_m)))
