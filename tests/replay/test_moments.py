"""A stage whose house changes is drawn as two: before, and from the round of the change on."""

import json
from pathlib import Path

import pytest
from made_up_run import NEW_TABLE_M, OLD_TABLE_M, box, floor_plan, stage_record

from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import ChangeDuringStage, EndState, Relocation, StageRecord, TransitionRecord
from evonav.replay.pages import write_episode
from evonav.replay.types import ReplayedRound, ReplayedStage
from evonav.replay.video_frames import episode_frame, stage_frames
from evonav.report.maps.moments import describe_during, during_facts, moments

PLATE_M = (OLD_TABLE_M[0] + 0.3, 0.8, OLD_TABLE_M[2])
FRIDGE_M = (0.5, 0.9, 0.8)
MOVES = (
    Relocation(object_id="table", category="DiningTable", from_m=OLD_TABLE_M, to_m=NEW_TABLE_M),
    Relocation(object_id="fridge", category="Fridge", from_m=(0.5, 0.9, 3.5), to_m=FRIDGE_M),
)


def changed(at_round: int | None, *skipped_ids: str) -> StageRecord:
    during = ChangeDuringStage(
        round=2, change=TransitionRecord(mode="FULL_SHUFFLE", room_id="room|1", relocations=MOVES), at_round=at_round
    )
    if at_round is not None:
        found = {"skipped_ids": skipped_ids, "target_position_m": PLATE_M, "reference_after_m": 2.5}
        during = during.model_copy(update=found)
    return stage_record("fu", "t", 1, EndState.FAILURE).model_copy(update={"during": during})


@pytest.fixture
def plan() -> FloorPlan:
    start = floor_plan("t", 1)
    after = (
        box("fridge", "Fridge", FRIDGE_M, 0.8, 0.8),
        box("table", "DiningTable", NEW_TABLE_M, 1.6, 1.0),
        box("plate", "Plate", PLATE_M, 0.2, 0.2),
    )
    return start.model_copy(update={"objects_at_end": after})


def places(plan: FloorPlan) -> dict[str, tuple[float, float, float]]:
    return {item.object_id: item.centre_m for item in plan.objects}


def test_the_house_is_another_from_the_round_of_the_change_on(plan: FloorPlan) -> None:
    first, second = moments(changed(2), {1: plan})
    assert (first.first_round, second.first_round) == (0, 2)
    assert places(first.maps[1])["table"] == OLD_TABLE_M
    assert places(second.maps[1])["table"] == NEW_TABLE_M
    assert places(second.maps[0])["table"] == OLD_TABLE_M  # what moved is drawn from where it stood
    assert second.record.transition.relocations == MOVES
    assert second.record.target.position_m == PLATE_M


def test_what_stayed_is_drawn_where_it_stood(plan: FloorPlan) -> None:
    _, second = moments(changed(2, "fridge"), {1: plan})
    assert places(second.maps[1]) == {**places(plan), "table": NEW_TABLE_M}
    assert [one.object_id for one in second.record.transition.relocations] == ["table"]
    assert describe_during(second).endswith("1 object moved; 1 object stayed, because the agent was in the way")


def test_a_stage_that_ends_before_the_change_has_one_moment(plan: FloorPlan) -> None:
    assert [moment.first_round for moment in moments(changed(None), {1: plan})] == [0]
    assert during_facts(changed(None)) == [("the house changed", "after the stage")]
    assert during_facts(changed(2)) == [("the house changed", "in round 3"), ("shortest path then", "2.5 m")]
    assert during_facts(stage_record("fu", "t", 1, EndState.FAILURE)) == []


def test_the_next_stage_is_drawn_against_the_house_at_the_end(plan: FloorPlan) -> None:
    (moment,) = moments(stage_record("fu", "t", 2, EndState.FAILURE), {1: plan, 2: floor_plan("t", 2)})
    assert places(moment.maps[1])["table"] == NEW_TABLE_M


def test_the_plan_after_the_change_is_read_as_it_was_written(plan: FloorPlan) -> None:
    assert FloorPlan.model_validate_json(plan.model_dump_json()) == plan


def replayed(plan: FloorPlan) -> ReplayedStage:
    record = changed(2)
    steps = tuple(ReplayedRound(entry, entry.pose, ()) for entry in record.trace)
    return ReplayedStage(record, plan, steps, "", (), 1.5)


def test_a_page_switches_its_map_in_the_round_of_the_change(plan: FloorPlan, tmp_path: Path) -> None:
    write_episode([replayed(plan)], tmp_path, budget=50, success_radius_m=2.0)
    (page,) = tmp_path.glob("t_fu.html")
    text = page.read_text()
    assert 'data-of="0" data-first="0" data-until="2"' in text
    assert 'data-of="0" data-first="2" data-until="1000000"' in text
    data = json.loads(text.partition('id="data">')[2].partition("</script>")[0])
    assert data["stages"][0]["during"] == [2, "full shuffle in the kitchen: 2 objects moved"]


def test_a_film_switches_its_map_in_the_round_of_the_change(plan: FloorPlan) -> None:
    stage = replayed(plan)
    maps = {1: plan}
    frames = list(stage_frames(stage, maps, episode_frame([stage], maps), budget=50, success_radius_m=2.0))
    assert len(frames) == 5
    heads = [frame.crop((792, 90, 1260, 120)).tobytes() for frame in frames]
    assert heads[0] == heads[1] != heads[2] == heads[3]
