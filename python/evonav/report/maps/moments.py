"""Divide a stage into moments between which its house changes, so that each is drawn as a stage of its own."""

from collections.abc import Mapping
from typing import NamedTuple

from evonav.counted import counted
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import StageRecord
from evonav.report.maps.text import describe_change


class Moment(NamedTuple):
    """Rounds of a stage in which the house stays as it is."""

    first_round: int
    record: StageRecord
    """The record with the target where it is in these rounds, and with the change before them as its transition."""
    maps: Mapping[int, FloorPlan]
    """Floor plans of the task's stages; that of the stage is of these rounds, that of the stage before of before."""


def moments(record: StageRecord, maps: Mapping[int, FloorPlan]) -> list[Moment]:
    """Return the moments of a stage: one, or two if its house changed before the stage ended."""
    k, during, here = record.stage, record.during, maps.get(record.stage)
    before = maps.get(k - 1)
    found = [Moment(0, record, maps if before is None else {**maps, k - 1: before.at_end})]
    if during is None or during.at_round is None:
        return found
    target = record.target.model_copy(update={"position_m": record.target_m_at_end})
    transition = during.change.model_copy(update={"relocations": during.done})
    after = record.model_copy(update={"target": target, "transition": transition})
    plans = maps if here is None else {**maps, k - 1: here, k: _without(here, during.skipped_ids)}
    return [*found, Moment(during.at_round, after, plans)]


def _without(plan: FloorPlan, skipped_ids: tuple[str, ...]) -> FloorPlan:
    """Return a floor plan after the change during its stage, without the part of it that did not take place."""
    skipped = set(skipped_ids)
    stays = [item for item in plan.objects if item.object_id in skipped]
    return plan.model_copy(
        update={
            "objects": (*(item for item in plan.objects_at_end if item.object_id not in skipped), *stays),
            "objects_at_end": (),
        }
    )


def describe_during(moment: Moment) -> str:
    """Describe the change during a stage that a moment begins with."""
    during, text = moment.record.during, describe_change(moment.record, moment.maps)
    if during is None:
        return text
    target = ", the target among them" if during.is_target_relocated else ""
    stayed = counted(len(during.skipped_ids), "object")
    return text + target + (f"; {stayed} stayed, because the agent was in the way" if during.skipped_ids else "")


def during_facts(record: StageRecord) -> list[tuple[str, str]]:
    """Return names and values that describe the change during a stage; none without one."""
    during = record.during
    if during is None:
        return []
    if during.at_round is None:
        return [("the house changed", "after the stage")]
    facts = [("the house changed", f"in round {during.at_round + 1}")]
    left_m = during.reference_after_m
    return facts if left_m is None else [*facts, ("shortest path then", f"{left_m:.1f} m")]
