"""Change the state of objects. Records show all states.

Images show doors open, and objects whose shape has a door or a lid, such as fridges, laptops and boxes.
"""

from collections.abc import Callable, Collection, Mapping
from typing import Any

from pydantic import BaseModel

from evonav.thor import edits, objects
from evonav.thor.actions.object_queries import target
from evonav.thor.actions.registry import ActionError, Arguments, action
from evonav.thor.engine import Engine
from evonav.thor.scene import Scene


class _Target(Arguments):
    """The object of an action, named by its id or by its place in the image."""

    objectId: str | None = None
    x: float | None = None
    y: float | None = None
    forceAction: bool = False

    def record(self, engine: Engine) -> objects.Record:
        return target(engine, self.objectId, self.x, self.y, is_far_allowed=self.forceAction)


class _Closing(_Target, extra="allow"):
    """The arguments of `CloseObject`."""


class _Opening(_Closing):
    """The arguments of `OpenObject`."""

    openness: float = 1.0


@action("OpenObject")
def open_object(engine: Engine, given: _Opening) -> None:
    """Open an object to a degree of 0 to 1."""
    record = given.record(engine)
    if not 0 <= given.openness <= 1:
        raise ActionError("openness must be in [0.0:1.0]")
    _require(record, "openable", f"{record['objectId']} is not an Openable object")
    _set(engine.scene, [record["objectId"]], {"openness": given.openness})


@action("CloseObject")
def close_object(engine: Engine, given: _Closing) -> None:
    """Close an object."""
    open_object(engine, _Opening(**given.model_dump(), openness=0.0))


def _toggler(way: str) -> Callable[..., None]:
    """Return the action that switches an object `on` or `off`."""

    def toggle(engine: Engine, given: _Target) -> None:
        record = given.record(engine)
        _require(record, "toggleable", f"{record['objectId']} is not toggleable")
        if record["isToggled"] == (way == "on"):
            raise ActionError(f"can't toggle object {way} if it's already {way}!")
        _set(engine.scene, [record["objectId"]], {"isOn": way == "on"})

    return toggle


action("ToggleObjectOn")(_toggler("on"))
action("ToggleObjectOff")(_toggler("off"))


def _flipper(flag: str, property_name: str, state: str, *, value: bool) -> Callable[..., None]:
    """Return the action that gives a state to an object with a flag, which messages call by AI2-THOR's name."""

    def flip(engine: Engine, *, objectId: str, forceAction: bool = False) -> None:
        record = target(engine, objectId, is_far_allowed=forceAction)
        _require(record, flag, f"{objectId} does not have {property_name} property!")
        if record[state] == value:
            raise ActionError(f"{objectId} already has {state} {value}")
        _set(engine.scene, [objectId], {state: value})

    return flip


action("DirtyObject")(_flipper("dirtyable", "CanBeDirty", "isDirty", value=True))
action("CleanObject")(_flipper("dirtyable", "CanBeDirty", "isDirty", value=False))
action("CookObject")(_flipper("cookable", "CanBeCooked", "isCooked", value=True))
_fill = _flipper("canFillWithLiquid", "CanBeFilled", "isFilledWithLiquid", value=True)
action("EmptyLiquidFromObject")(_flipper("canFillWithLiquid", "CanBeFilled", "isFilledWithLiquid", value=False))


@action("FillObjectWithLiquid")
def fill_object_with_liquid(
    engine: Engine, *, objectId: str, fillLiquid: str = "water", forceAction: bool = False
) -> None:
    """Fill an object with water, coffee or wine."""
    if fillLiquid not in ("water", "coffee", "wine"):
        raise ActionError(f"{fillLiquid} is not a valid Liquid Type")
    _fill(engine, objectId=objectId, forceAction=forceAction)
    _set(engine.scene, [objectId], {"fillLiquid": fillLiquid})


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


def _require(record: objects.Record, flag: str, message: str) -> None:
    if not record[flag]:
        raise ActionError(message)


def _set(scene: Scene, object_ids: Collection[str], values: Mapping[str, object]) -> None:
    """Write states into the house file, the source of records and images."""
    with edits.editing(scene) as house:
        for entry in [entry for entry, _ in objects.placed_objects(house)] + [*house.get("doors", ())]:
            if entry["id"] in object_ids:
                entry.update(values)
