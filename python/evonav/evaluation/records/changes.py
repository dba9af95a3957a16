"""Define the records of a house's changes: in the transition before a stage, and during it."""

from typing import Literal

from evonav.evaluation.records.base import Whole, WholeRecord
from evonav.points import Point3, Real


class Relocation(WholeRecord):
    """One object moved in a change. Oracle."""

    object_id: str
    category: str
    from_m: Point3
    to_m: Point3


class TransitionRecord(WholeRecord):
    """A change of the house: between the previous stage and this one, or during this one. Oracle."""

    mode: Literal["SALIENT_OBJECT", "RETAIN_GROUP", "FULL_SHUFFLE"] | None = None
    """`None` when the paper's process changed nothing."""
    room_id: str | None = None
    is_agent_in_room: bool = False
    """True if the agent stands in the evolved room as the house changes: at the start of the stage, or during it."""
    relocations: tuple[Relocation, ...] = ()
    num_added: Whole = 0
    """Objects that an extension added. The two fields below are of extensions, too."""
    num_removed: Whole = 0
    num_states: Whole = 0
    """Doors and objects that opened, closed, or went on or off."""

    @property
    def kind(self) -> str:
        """The mode in lower case, `activities` where people moved things, `extensions` where others did, `static`."""
        if self.mode is not None:
            return self.mode.lower()
        if self.relocations:
            return "activities"
        return "extensions" if self.num_added or self.num_removed or self.num_states else "static"


DURING_STRATA = ("target_moved_during", "changed_during", "unchanged_during")
"""Events during a stage: its target moved, other things changed, or nothing did before the stage ended."""


class ChangeDuringStage(WholeRecord):
    """The change of the house during the stage (docs/extensions.md). Oracle."""

    round: Whole
    """The decision round that was drawn for it."""
    change: TransitionRecord
    """The change as the task has it, whatever of it took place before the stage ended."""
    at_round: Whole | None = None
    """The round of the trace before whose views it took place; `None` if the stage ended before it."""
    skipped_ids: tuple[str, ...] = ()
    """Ids of what did not change in the stage, because the agent stood in the way; it changes after the stage."""
    target_position_m: Point3 | None = None
    """Position of the target once it took place: success is judged by it; `None` if the stage ended before it."""
    is_target_relocated: bool = False
    """The target moved during the stage."""
    path_before_m: Real | None = None
    """Length of the agent's path up to the change."""
    reference_after_m: Real | None = None
    """Length of the shortest path from the agent's place at the change to the target after it; `None` without one."""

    @property
    def stratum(self) -> str:
        """The name in `DURING_STRATA` of what happened during the stage."""
        if self.at_round is None:
            return "unchanged_during"
        return "target_moved_during" if self.is_target_relocated else "changed_during"

    @property
    def done(self) -> tuple[Relocation, ...]:
        """The moves that took place during the stage."""
        if self.at_round is None:
            return ()
        return tuple(one for one in self.change.relocations if one.object_id not in self.skipped_ids)

    @property
    def left(self) -> tuple[Relocation, ...]:
        """The moves that take place after the stage, unseen."""
        done = self.done
        return tuple(one for one in self.change.relocations if one not in done)
