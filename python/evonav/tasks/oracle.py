"""The evaluator's part of a task: targets and changes. Agents must not import this module."""

from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveInt,
)

from evonav.points import Point2, Point3
from evonav.records import Record, Version
from evonav.tasks.records import Id, PoseRecord, Probability, Sha256

Mode = Literal["SALIENT_OBJECT", "RETAIN_GROUP", "FULL_SHUFFLE"]
"""Modification of a room (paper, Sec. 3.2)."""

Outcome = Literal["first_stage", "not_triggered", "no_room", "no_placement", "evolved"]
"""Outcome of a transition.

`no_room`: every room's weight is 0. `no_placement`: none of the drawn objects could be moved.
"""

Failure = Literal["nothing_movable", "no_free_place", "cuts_off"]
"""Reason that nothing was moved: no movable object, no free place drawn, or only places that cut off other places."""


class Change(Record):
    """One moved object; children of a moved support have entries of their own."""

    id: Id
    category: Id
    from_position_m: Point3
    from_rotation_deg: Point3
    from_support_id: Id | None
    to_position_m: Point3
    to_rotation_deg: Point3
    to_support_id: Id | None
    displacement_m: NonNegativeFloat
    """Distance between the box centres in three dimensions."""
    is_relocated: bool
    """Whether it moved more than 0.1 m or stands on another support."""
    cause: Id
    """The process that moved it: the mode, or an extension such as `ACTIVITY:cook`."""


class ObjectRecord(Record):
    """An object that an extension added (at its new place) or removed (at its old place)."""

    id: Id
    category: Id
    asset_id: Id
    position_m: Point3
    rotation_deg: Point3
    support_id: Id | None
    cause: Id


class StateChange(Record):
    """A door or object that an extension opened, closed, or switched on or off."""

    id: Id
    category: Id
    field: Literal["openness", "isOn"]
    before: Probability
    """Openness before the change, or 1 for switched on."""
    after: Probability
    cause: Id


class Activity(Record):
    """One activity of a person between two stages."""

    person: NonNegativeInt
    name: Id
    room_id: Id | None
    """Room of the activity; `None` away from home."""
    start_min: NonNegativeInt
    """Minutes after midnight of the first stage's day."""
    end_min: NonNegativeInt


class RoomWeight(Record):
    """The factors of `p_evolved_room` for one room (paper, Sec. 3.2)."""

    room_id: Id
    num_assets: NonNegativeInt
    is_visited: bool
    is_transition_room: bool
    was_changed_recently: bool
    weight: NonNegativeFloat


class Evolution(Record):
    """The hidden scene change before a stage, ΔH_k."""

    outcome: Outcome
    mode: Mode | None
    room_id: Id | None
    salient_id: Id | None
    """The salient object that was moved, for `SALIENT_OBJECT`."""
    room_weights: tuple[RoomWeight, ...]
    """Weights of the rooms; empty when evolution was not triggered."""
    failure: Failure | None = None
    """Reason that nothing was moved, for `no_placement`."""
    changes: tuple[Change, ...]
    unmoved_ids: tuple[Id, ...]
    """Objects selected to move for which no valid place was found."""
    blocking_ids: tuple[Id, ...] = ()
    """Those of them with free places that would all have cut off other places."""
    crowded_ids: tuple[Id, ...] = ()
    """Furniture placed without the free floor that ProcTHOR leaves around it."""
    rearranged_ids: tuple[Id, ...] = ()
    """Furniture of groups that fitted nowhere unchanged, rearranged by ProcTHOR's definition of the group."""
    additions: tuple[ObjectRecord, ...] = ()
    """Added objects; like all fields below, empty unless an extension is on."""
    removals: tuple[ObjectRecord, ...] = ()
    states: tuple[StateChange, ...] = ()
    clock_min: NonNegativeInt | None = None
    """Time of day of the stage, in minutes after midnight."""
    activities: tuple[Activity, ...] = ()
    """Activities since the previous stage."""

    @property
    def relocated_ids(self) -> tuple[str, ...]:
        """Ids of the objects relocated by this change."""
        return tuple(change.id for change in self.changes if change.is_relocated)

    def delta(self) -> dict[str, Any]:
        """Return the change as `House.apply` takes it, written as JSON."""
        return {
            "moves": [
                {
                    "id": change.id,
                    "position_m": change.to_position_m,
                    "rotation_deg": change.to_rotation_deg,
                    "parent": change.to_support_id,
                }
                for change in self.changes
            ],
            "removed": [one.id for one in self.removals],
            "added": [
                {
                    "id": one.id,
                    "asset_id": one.asset_id,
                    "position_m": one.position_m,
                    "rotation_deg": one.rotation_deg,
                    "parent": one.support_id,
                }
                for one in self.additions
            ],
            "states": [
                {"id": state.id, "openness": state.after}
                if state.field == "openness"
                else {"id": state.id, "is_on": state.after > 0.5}
                for state in self.states
            ],
        }


class GenerationState(Record):
    """The generator's state S when the stage was made, oldest entries first."""

    visited_room_ids: tuple[Id, ...]
    changed_room_ids: tuple[Id | None, ...]
    """Changed room of each of the last two transitions; `None` where nothing changed."""
    goal_room_ids: tuple[Id, ...]
    """Rooms of the last two goals."""
    transition_room_id: Id | None


class Rejection(Record):
    """A goal that was drawn and rejected."""

    id: Id
    reason: Literal["no_reference_pose", "not_visible", "unreachable"]


class Target(Record):
    """The target object x_k."""

    id: Id
    category: Id
    room_id: Id
    position_m: Point3
    """Centre of its box in the stage's house; success is measured from x and z."""
    size_m: Point3
    support_id: Id | None
    score: Annotated[float, Field(ge=1.0, le=2.0)]
    """Uniqueness: 2 in the house, 1.5 in its room, 1 otherwise."""
    same_category_ids: tuple[Id, ...]
    """Ids of other objects of its category in the house."""
    is_relocated_now: bool
    """Whether this stage's change relocated it."""
    is_relocated_ever: bool
    """Whether any change since stage 1 relocated it."""


class DuringRecord(Record):
    """A change of the house during a stage, while the agent is under way (docs/extensions.md)."""

    round: PositiveInt
    """The decision round, from 0, before whose views the house changes."""
    evolution: Evolution
    """The change; `evolution.delta()` leads from the stage's house to the house at its end."""
    target_position_m: Point3
    """Centre of the target's box after it."""
    target_support_id: Id | None
    is_target_relocated: bool
    """Whether the change relocated the target."""
    reference_pose: PoseRecord
    """Pose 1.0-1.5 m from the target from which it is visible after the change: the stage is still feasible."""
    reference_visible_px: Annotated[int, Field(ge=1)]


class OracleFields(Record):
    """The fields of an oracle stage that Algorithm 1 determines."""

    evolution: Evolution
    state: GenerationState
    start_pose: PoseRecord
    """Reference start s_k: the house's own at stage 1, then the previous reference pose."""
    target: Target
    rejections: tuple[Rejection, ...]
    reference_pose: PoseRecord
    """Pose 1.0-1.5 m from the target, from which the target is visible."""
    reference_visible_px: Annotated[int, Field(ge=1)]
    """Number of the target's pixels in the reference image."""
    reference_path_m: Annotated[tuple[Point2, ...], Field(min_length=1)]
    """Corners of the shortest path from `start_pose` to `reference_pose`."""
    reference_path_length_m: NonNegativeFloat
    ever_relocated_ids: tuple[Id, ...]
    """Ids of the objects relocated by any change up to the stage's start, sorted."""
    during: DuringRecord | None = None
    """The change during the stage, if there is one."""


class _OracleFileFields(Record):
    """The fields that identify the file of an oracle stage."""

    schema_version: Version = 1
    stage: Annotated[int, Field(ge=1)]
    house_sha256: Sha256
    """SHA-256 of `Task.house_json(stage)` in UTF-8."""


# Pydantic orders fields from the last base to the first: those of `_OracleFileFields` come first in the file.
class OracleStage(OracleFields, _OracleFileFields):
    """The part of a stage that the agent must not know."""
