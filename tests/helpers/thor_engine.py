"""AI2-THOR's engine in this process, in a house; and actions that must succeed, or must fail and change no pose."""

import copy
from typing import Any

from evonav.thor import objects
from evonav.thor.engine import Engine

Json = dict[str, Any]


def engine_in(house: Json | None, **initialize: object) -> Engine:
    """Return an engine in a copy of a house, the agent where the house puts it."""
    engine = Engine()
    do(engine, "Initialize", **initialize)
    if house is not None:
        do(engine, "CreateHouse", house=copy.deepcopy(house))
        start = house.get("metadata", {}).get("agent", {})
        left_out = "standing" if engine.agent.is_locobot else ""
        if start:
            do(engine, "TeleportFull", **{key: value for key, value in start.items() if key != left_out})
    return engine


def do(engine: Engine, action: str, **arguments: object) -> Any:
    """Execute an action that must succeed; return its `actionReturn`."""
    result = engine.execute({"action": action, **arguments})
    assert result.is_success, result
    return result.action_return


def refused(engine: Engine, action: str, **arguments: object) -> str:
    """Execute an action that must fail; return its message."""
    before = engine.agent.pose
    result = engine.execute({"action": action, **arguments})
    assert not result.is_success
    assert "inside the engine" not in result.error_message
    assert engine.agent.pose == before, "a failed action changed the pose"
    return result.error_message


def records(engine: Engine) -> dict[str, Json]:
    """Return the records of all objects by id."""
    return {record["objectId"]: record for record in objects.static_records(engine.scene)}
