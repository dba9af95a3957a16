"""The evaluator's part of a task: where the target is, and what was changed. No agent may import this."""

from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, NonNegativeInt

from evonav.tasks.records import Id, Point2, Point3, PoseRecord, Probability, Record, Sha256

Mode = Literal["SALIENT_OBJECT", "RETAIN_GROUP", "FULL_SHUFFLE"]
"""Room modification (paper, Sec. 3.2)."""

Outcome = Literal["first_stage", "not_triggered", "no_room", "no_placement", "evolved"]
"""How a transition went: `no_room` when every room's weight is 0, `no_placement` when nothing drawn could be moved."""

Failure = Literal["nothing_movable", "no_free_place", "cuts_off"]
"""Why nothing could be moved: nothing there to move, no free place drawn, or only places that cut something off."""


class Change(Record):
    """One object that was moved, children of a moved support included."""

    id: Id
    category: Id
    from_position_m: Point3
    from_rotation_deg: Point3
    from_support_id: Id | None
    to_position_m: Point3
    to_rotation_deg: Point3
    to_support_id: Id | None
    displacement_m: NonNegativeFloat
    """Distance between the box centres, 3-D."""
    is_relocated: bool
    """Moved more than 0.1 m, or stands on another support."""
    cause: Id
    """The process that moved it: the mode, or an extension such as `ACTIVITY:cook`."""


class ObjectRecord(Record):
    """An object that came (where it is) or went (where it was); by an extension."""

    id: Id
    category: Id
    asset_id: Id
    position_m: Point3
    rotation_deg: Point3
    support_id: Id | None
    cause: Id


class StateChange(Record):
    """A door or object that opened, closed, or went on or off; by an extension."""

    id: Id
    category: Id
    field: Literal["openness", "isOn"]
    before: Probability
    """Openness, or 1 for on."""
    after: Probability
    cause: Id


class Activity(Record):
    """What one person did between two stages."""

    person: NonNegativeInt
    name: Id
    room_id: Id | None
    """`None` away from home."""
    start_min: NonNegativeInt
    """After midnight of the first stage's day."""
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
    """The salient object that was moved, under `SALIENT_OBJECT`."""
    room_weights: tuple[RoomWeight, ...]
    """Empty when evolution was not triggered."""
    failure: Failure | None = None
    """Why nothing could be moved, under `no_placement`."""
    changes: tuple[Change, ...]
    unmoved_ids: tuple[Id, ...]
    """Objects that were to move, but for which no valid place was found."""
    blocking_ids: tuple[Id, ...] = ()
    """Those of them that had free places, each of which would have cut something off."""
    crowded_ids: tuple[Id, ...] = ()
    """Furniture that had to do without the free floor that ProcTHOR leaves around it."""
    rearranged_ids: tuple[Id, ...] = ()
    """Furniture of groups that fitted nowhere as they stood: arranged anew by ProcTHOR's definition of the group."""
    additions: tuple[ObjectRecord, ...] = ()
    """Empty unless an extension is on, as all below."""
    removals: tuple[ObjectRecord, ...] = ()
    states: tuple[StateChange, ...] = ()
    clock_min: NonNegativeInt | None = None
    """Time of day of the stage, minutes after midnight."""
    activities: tuple[Activity, ...] = ()
    """What people did since the stage before."""

    @property
    def relocated_ids(self) -> tuple[str, ...]:
        """Objects relocated by this change."""
        return tuple(change.id for change in self.changes if change.is_relocated)


class GenerationState(Record):
    """The generator's state S as it was when the stage was made; oldest first."""

    visited_room_ids: tuple[Id, ...]
    changed_room_ids: tuple[Id | None, ...]
    """Per transition so far, the last two; `None` where nothing changed."""
    goal_room_ids: tuple[Id, ...]
    """The last two."""
    transition_room_id: Id | None


class Rejection(Record):
    """A goal that was drawn and refused."""

    id: Id
    reason: Literal["no_reference_pose", "not_visible", "unreachable"]


class Target(Record):
    """The object to be found, x_k."""

    id: Id
    category: Id
    room_id: Id
    position_m: Point3
    """Centre of its box in the stage's house; success is measured from its x and z."""
    size_m: Point3
    support_id: Id | None
    score: Annotated[float, Field(ge=1.0, le=2.0)]
    """2 unique in the house, 1.5 unique in its room, 1 otherwise."""
    same_category_ids: tuple[Id, ...]
    """Other objects of its category in the house."""
    is_relocated_now: bool
    """By this stage's change."""
    is_relocated_ever: bool
    """By any change since stage 1."""


class OracleStage(Record):
    """Everything about a stage that the agent must not know."""

    schema_version: Literal[2] = 2
    stage: Annotated[int, Field(ge=1)]
    house_sha256: Sha256
    """Of `Task.house_json(stage)`, UTF-8."""
    evolution: Evolution
    state: GenerationState
    start_pose: PoseRecord
    """Reference start s_k: the house's own at stage 1, then the previous reference pose."""
    target: Target
    rejections: tuple[Rejection, ...]
    reference_pose: PoseRecord
    """1.0-1.5 m from the target, which is visible from it."""
    reference_visible_px: Annotated[int, Field(ge=1)]
    """Pixels of the target in the reference image."""
    reference_path_m: Annotated[tuple[Point2, ...], Field(min_length=1)]
    """Shortest path from `start_pose` to `reference_pose`, corners."""
    reference_path_length_m: NonNegativeFloat
    ever_relocated_ids: tuple[Id, ...]
    """Objects relocated by any change up to this stage, sorted."""
