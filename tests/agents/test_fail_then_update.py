"""Fail-then-Update's questions on arrival, and what it deletes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scripted_model import going
from toy_episode import rounds_of, run
from toy_house import moved_table_stages, stage_case

from evonav.agents.frontier_update.fail_then_update import SAME_PLACE_M, FailThenUpdate, FailThenUpdateConfig
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState
from evonav.memory import ObjectMap


def test_fail_then_update_asks_once_an_arrival_and_goes_on_until_the_budget_ends():
    model = going(verify="no")
    (record,) = run(FailThenUpdate(decision=model), stage_case(1, "Mug|1"), protocol=ProtocolConfig(max_rounds=12))
    counters = record.trace[-1].counters
    assert not record.has_stopped
    assert record.num_rounds == 12
    assert counters["rejected_entries"] == counters["verifications"] >= 1


def test_fail_then_update_deletes_the_moved_table_on_arrival_and_nothing_else(monkeypatch):
    removed = []
    remove = ObjectMap.remove
    monkeypatch.setattr(ObjectMap, "remove", lambda self, entry_id: removed.append(entry_id) or remove(self, entry_id))
    records, told = rounds_of(FailThenUpdate(), *moved_table_stages())
    rejected = [d.counters["rejected_entries"] for _, _, d, _ in told]
    rejections = [i for i in range(1, len(told)) if rejected[i] > rejected[i - 1]]
    assert len(rejections) == len(removed) >= 1
    for i, gone in zip(rejections, removed, strict=True):
        before, after = ({e.entry_id: e.label for e in told[j][1].entries} for j in (i - 1, i))
        assert before[gone] == "DiningTable"
        assert gone not in after
        assert set(before.values()) - {"DiningTable"} <= set(after.values())
        assert told[i - 1][2].choice == f"object {gone}"  # it was committed to it, and arrived
        assert told[i][2].details["rejected"][-1] == gone
    assert records[2].state is EndState.SUCCESS
    assert not set(removed) & {e.entry_id for e in records[2].entries}


def test_fail_then_update_deletes_nothing_where_something_hides_the_place():
    """A door that opened in front of the camera: the table is not seen, and neither is that it is gone."""
    agent, stages = FailThenUpdate(), []
    act, begin_stage = agent.act, agent.begin_stage

    def behind_a_door(view):
        nothing = replace(view.detections, masks=np.full_like(view.detections.masks, -1))
        return replace(view, depth_m=np.full_like(view.depth_m, 0.3), detections=nothing)

    def act_in_front_of_a_door(observation):
        if stages[-1] == 3:
            observation = replace(observation, views=tuple(map(behind_a_door, observation.views)))
        return act(observation)

    agent.begin_stage = lambda goal: stages.append(goal.stage) or begin_stage(goal)
    agent.act = act_in_front_of_a_door
    last = run(agent, *moved_table_stages())[2]
    assert (last.stop_reason, last.trace[-1].counters["rejected_entries"]) == ("verified", 0)
    assert last.trace[-2].chosen_entry.is_stale


@pytest.mark.parametrize("meaning", ["yes", "no"])
def test_verification_without_an_answer_is_taken_for_yes_or_no(meaning):
    model = going(verify="perhaps")
    agent = FailThenUpdate(FailThenUpdateConfig(unanswered_means=meaning), model)
    (record,) = run(agent, stage_case(1, "Mug|1"), protocol=ProtocolConfig(max_rounds=12))
    counters = record.trace[-1].counters
    assert counters["failed_decisions"] == counters["verifications"] >= 1
    if meaning == "yes":
        assert (record.stop_reason, counters["rejected_entries"]) == ("verified", 0)
    else:
        assert not record.has_stopped
        assert counters["rejected_entries"] == counters["verifications"]


@pytest.mark.parametrize(("views", "num_views"), [("facing", 1), ("all", 3)])
def test_verification_is_asked_at_arrival_alone_on_the_facing_view_or_on_all(views, num_views):
    model = going(verify="yes", needs_images=True)
    agent = FailThenUpdate(FailThenUpdateConfig(verify_views=views), model)
    (record,) = run(agent, stage_case(1, "Mug|1"))
    verified = [question for question in model.questions if question.kind == "verify"]
    assert len(verified) == record.trace[-1].counters["verifications"] == 1
    assert model.questions[-1] is verified[0]
    assert len(verified[0].views) == num_views
    # Motion ended in the round before, at the place to stand.
    assert record.trace[-2].choice == f"object {verified[0].entry.entry_id}"
    assert record.num_rounds == len(record.trace)


def test_what_was_rejected_and_came_up_again_can_be_hidden_for_the_rest_of_the_stage():
    def rejections(limit):
        """How many entries were rejected by stage, and how many of them were offered again in theirs."""
        model = going(verify="no")
        agent = FailThenUpdate(FailThenUpdateConfig(hide_after_rejections=limit), model)
        run(agent, stage_case(1, "Mug|1"), stage_case(2, "Mug|1"), protocol=ProtocolConfig(max_rounds=40))
        rejected, num_again = {1: [], 2: []}, 0
        for question in model.questions:
            gone = rejected[question.goal.stage]
            if question.kind == "verify":
                gone.append(question.entry)
                continue
            for candidate in question.objects:
                num_again += any(
                    candidate.label == one.label and math.dist(candidate.centre_m, one.centre_m) <= SAME_PLACE_M
                    for one in gone
                )
        return {stage: len(gone) for stage, gone in rejected.items()}, num_again

    open_rejected, num_open_again = rejections(None)
    hidden_rejected, num_hidden_again = rejections(1)
    assert (num_open_again > 0, num_hidden_again) == (True, 0)
    assert hidden_rejected[2] < open_rejected[2]
    assert hidden_rejected[2] >= 1  # another stage offers it again
