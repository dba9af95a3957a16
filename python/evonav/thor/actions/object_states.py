"""Change the state of objects. Records show all states, images only those of doors.

The shape of furniture is one solid block, so an open fridge is drawn closed.
"""

from collections.abc import Collection, Mapping
from typing import Any

from pydantic import BaseModel

from evonav.thor import edits, objects
from evonav.thor.actions import object_queries
from evonav.thor.actions.registry import ActionError, action
from evonav.thor.engine import Engine
from evonav.thor.scene import Scene


@action("OpenObject")
def open_object(
    engine: Engine,
    *,
    objectId: str | None = None,
    x: float | None = None,
    y: float | None = None,
    forceAction: bool = False,
    openness: float = 1.0,
    **unused: Any,  # noqa: ANN401
) -> None:
    """Open an object to a degree of 0 to 1."""
    record = _target(engine, objectId, x, y, forceAction)
    if not 0 <= openness <= 1:
        raise ActionError("openness must be in [0.0:1.0]")
    _require(record, "openable", f"{record['objectId']} is not an Openable object")
    _set(engine.scene, [record["objectId"]], {"openness": openness})


@action("CloseObject")
def close_object(
    engine: Engine,
    *,
    objectId: str | None = None,
    x: float | None = None,
    y: float | None = None,
    forceAction: bool = False,
    **unused: Any,  # noqa: ANN401
) -> None:
    """Close an object."""
    open_object(engine, objectId=objectId, x=x, y=y, forceAction=forceAction, openness=0.0)


@action("ToggleObjectOn")
def toggle_object_on(
    engine: Engine,
    *,
    objectId: str | None = None,
    x: float | None = None,
    y: float | None = None,
    forceAction: bool = False,
) -> None:
    """Switch an object on."""
    _toggle(engine, _target(engine, objectId, x, y, forceAction), is_on=True)


@action("ToggleObjectOff")
def toggle_object_off(
    engine: Engine,
    *,
    objectId: str | None = None,
    x: float | None = None,
    y: float | None = None,
    forceAction: bool = False,
) -> None:
    """Switch an object off."""
    _toggle(engine, _target(engine, objectId, x, y, forceAction), is_on=False)


@action("DirtyObject")
def dirty_object(engine: Engine, *, objectId: str, forceAction: bool = False) -> None:
    """Make an object dirty."""
    _flip(engine, _target(engine, objectId, None, None, forceAction), "isDirty", "dirtyable", "CanBeDirty", value=True)


@action("CleanObject")
def clean_object(engine: Engine, *, objectId: str, forceAction: bool = False) -> None:
    """Make an object clean."""
    _flip(engine, _target(engine, objectId, None, None, forceAction), "isDirty", "dirtyable", "CanBeDirty", value=False)


@action("CookObject")
def cook_object(engine: Engine, *, objectId: str, forceAction: bool = False) -> None:
    """Cook an object."""
    _flip(engine, _target(engine, objectId, None, None, forceAction), "isCooked", "cookable", "CanBeCooked", value=True)


@action("FillObjectWithLiquid")
def fill_object_with_liquid(
    engine: Engine, *, objectId: str, fillLiquid: str = "water", forceAction: bool = False
) -> None:
    """Fill an object with water, coffee or wine."""
    if fillLiquid not in ("water", "coffee", "wine"):
        raise ActionError(f"{fillLiquid} is not a valid Liquid Type")
    record = _target(engine, objectId, None, None, forceAction)
    _flip(engine, record, "isFilledWithLiquid", "canFillWithLiquid", "CanBeFilled", value=True)
    _set(engine.scene, [objectId], {"fillLiquid": fillLiquid})


@action("EmptyLiquidFromObject")
def empty_liquid_from_object(engine: Engine, *, objectId: str, forceAction: bool = False) -> None:
    """Empty an object."""
    record = _target(engine, objectId, None, None, forceAction)
    _flip(engine, record, "isFilledWithLiquid", "canFillWithLiquid", "CanBeFilled", value=False)


class ObjectStates(BaseModel):
    """The objects that `SetObjectStates` changes, and their new state."""

    objectType: str | None = None
    stateChange: str | None = None
    """The flag that the objects must have: `toggleable` and the like."""
    isOpen: bool = False
    isToggled: bool = False
    isFilledWithLiquid: bool = False
    isDirty: bool = False
    isCooked: bool = False


# The state that belongs to a flag, and its key in the house file.
_SETTABLE = {
    "openable": ("isOpen", "openness"),
    "toggleable": ("isToggled", "isOn"),
    "canFillWithLiquid": ("isFilledWithLiquid", "isFilledWithLiquid"),
    "dirtyable": ("isDirty", "isDirty"),
    "cookable": ("isCooked", "isCooked"),
}


@action("SetObjectStates")
def set_object_states(
    engine: Engine,
    *,
    SetObjectStates: ObjectStates,
    **unused: Any,  # noqa: ANN401
) -> None:
    """Set one state of all objects that have it, or of those of a type; no object breaks or is cut."""
    wanted = SetObjectStates
    if wanted.stateChange is None:
        raise ActionError("SetObjectStates needs a stateChange, and takes an objectType")
    if wanted.stateChange not in _SETTABLE:
        raise ActionError(f"stateChange {wanted.stateChange} is not one of {', '.join(_SETTABLE)}")
    state, key = _SETTABLE[wanted.stateChange]
    value = getattr(wanted, state)
    chosen = [
        record["objectId"]
        for record in objects.static_records(engine.scene)
        if record[wanted.stateChange] and wanted.objectType in (None, record["objectType"])
    ]
    _set(engine.scene, chosen, {key: float(value) if key == "openness" else value})


def _target(
    engine: Engine, object_id: str | None, x: float | None, y: float | None, force_action: bool
) -> objects.Record:
    """Return the object of an action, named by id or by its place in the image."""
    if object_id is None:
        if x is None or y is None:
            raise ActionError("objectId, or x and y, must be given")
        object_id, _ = object_queries.object_at(engine, x, y)
    record = objects.record_of(engine.scene, object_id)
    if not force_action:
        seen = objects.visible_ids(engine.scene, engine.agent, engine.settings.visibilityDistance)
        if object_id not in seen:
            raise ActionError("NullReferenceException: Target object not found within the specified visibility.")
    return record


def _require(record: objects.Record, flag: str, message: str) -> None:
    if not record[flag]:
        raise ActionError(message)


def _toggle(engine: Engine, record: objects.Record, *, is_on: bool) -> None:
    _require(record, "toggleable", f"{record['objectId']} is not toggleable")
    if record["isToggled"] == is_on:
        way = "on" if is_on else "off"
        raise ActionError(f"can't toggle object {way} if it's already {way}!")
    _set(engine.scene, [record["objectId"]], {"isOn": is_on})


def _flip(engine: Engine, record: objects.Record, state: str, flag: str, name: str, *, value: bool) -> None:
    _require(record, flag, f"{record['objectId']} does not have {name} property!")
    if record[state] == value:
        raise ActionError(f"{record['objectId']} already has {state} {value}")
    _set(engine.scene, [record["objectId"]], {state: value})


def _set(scene: Scene, object_ids: Collection[str], values: Mapping[str, object]) -> None:
    """Write states into the house file, the source of records and images."""
    with edits.editing(scene) as house:
        for entry in [entry for entry, _ in objects.placed_objects(house)] + [*house.get("doors", ())]:
            if entry["id"] in object_ids:
                entry.update(values)
