"""Fail-then-Update with a check of identity, and with an early stop: what is gained without another memory."""

import math
from dataclasses import replace

import numpy as np
import pytest
from evonav_studies.early_stop import EarlyStopConfig, FailThenUpdateEarlyStop
from scripted_model import going
from toy_episode import rounds_of, run
from toy_house import moved_table_stages, stage_case

from evonav.agents.frontier_update.fail_then_update import FailThenUpdate, FailThenUpdateIdentity, IdentityConfig
from evonav.agents.frontier_update.questions import IdentityQuestion
from evonav.decision.appearance import AppearanceMatcher
from evonav.decision.candidates import ObjectAppearance, ObjectCandidate
from evonav.decision.text.matcher import Matcher
from evonav.evaluation.protocol import ProtocolConfig
from evonav.tasks.language import COLOURS
from evonav.tasks.public import Goal


def test_an_object_that_contradicts_the_goal_is_set_aside_and_stays_in_memory():
    model = going(verify="yes", identity="no")
    agent = FailThenUpdateIdentity(decision=model)
    records, told = rounds_of(agent, stage_case(1, "Fridge|1"), stage_case(2, "Fridge|1"))
    by_stage = {stage: [d for number, _, d, _ in told if number == stage] for stage in (1, 2)}
    aside = {stage: rounds[-1].details.get("set_aside", []) for stage, rounds in by_stage.items()}
    assert len(aside[1]) >= 2
    remembered = {entry.entry_id for entry in records[0].entries}
    assert set(aside[1]) & remembered
    assert by_stage[1][-1].counters["rejected_entries"] == 0
    gone = {1: set(), 2: set()}
    offered_again, reserve = set(), IdentityConfig().reserve_rounds
    for question in model.questions:
        stage = question.goal.stage
        if question.kind == "identity":
            gone[stage].add(question.entry.entry_id)
        elif question.kind == "choose" and question.frontiers and question.num_rounds_left > reserve:
            offered = {one.entry_id for one in question.objects}
            assert not offered & gone[stage]
            offered_again |= offered & gone[1] if stage == 2 else set()
    assert offered_again  # another goal may be what contradicted the last one


def test_what_was_set_aside_comes_back_when_nothing_else_is_left():
    model = going(verify="yes", identity="no")
    (record,) = run(FailThenUpdateIdentity(decision=model), stage_case(1, "Mug|1"))
    rounds_left = [q.num_rounds_left for q in model.questions if q.kind == "choose"]
    kinds = [question.kind for question in model.questions]
    assert record.stop_reason == "verified"
    assert "identity" in kinds
    assert kinds[-1] == "verify"  # it is accepted without another question about its identity
    assert record.trace[-1].chosen_entry.entry_id in {q.entry.entry_id for q in model.questions if q.kind == "identity"}
    assert min(rounds_left) > 0


def test_fail_then_update_asks_nothing_about_identity():
    model = going(verify="yes")
    (record,) = run(FailThenUpdate(decision=model), stage_case(1, "Mug|1"))
    assert "identity" not in {question.kind for question in model.questions}
    assert "set_aside" not in record.trace[-1].counters


def goal_of(sentence, category="Mug"):
    return Goal(1, category, sentence, sentence, sentence, np.zeros((8, 8, 3), np.uint8))


def candidate(entry_id, label, x_m, z_m, *, y_m=0.5, size_m=(0.5, 1.0, 0.5), **rest):
    return ObjectCandidate(entry_id, label, (x_m, y_m, z_m), size_m, 9, **rest)


KITCHEN = (candidate(1, "Fridge", 0.5, 0.5), candidate(2, "CounterTop", 2.0, 0.5))
BEDROOM = (candidate(3, "Bed", 10.0, 0.5, size_m=(2.0, 0.6, 1.5)), candidate(4, "Dresser", 10.0, 3.0))


@pytest.mark.parametrize(
    ("sentence", "answers"),
    [
        ("Find the mug in the kitchen.", (True, False)),
        ("Find the mug in the bedroom.", (False, True)),
        ("Find the mug.", (True, True)),
        ("Find the mug on the dresser in the bedroom.", (False, True)),
        ("Find the mug near the sofa.", (True, True)),  # one neighbour is no contradiction: it may not have been seen
        ("Find the mug on the desk near the sofa.", (False, False)),
    ],
)
def test_rules_that_read_find_contradictions_in_what_is_around(sentence, answers):
    mugs = (
        candidate(5, "Mug", 2.0, 0.5, y_m=1.05, size_m=(0.1, 0.1, 0.1)),
        candidate(6, "Mug", 10.0, 3.0, y_m=1.05, size_m=(0.1, 0.1, 0.1)),
    )
    everything = (*KITCHEN, *BEDROOM, *mugs)
    asked = [IdentityQuestion(goal_of(sentence), mug, everything) for mug in mugs]
    assert tuple(question.by_rule(Matcher())[0] for question in asked) == answers


def test_rules_that_look_find_contradictions_in_colours():
    def mug(entry_id, colour):
        shares = tuple(float(name == colour) for name in COLOURS)
        looks = ObjectAppearance(shares, frozenset({entry_id}), 1.0)
        return candidate(entry_id, "Mug", float(entry_id), 0.5, size_m=(0.1, 0.1, 0.1), appearance=looks)

    mugs = (mug(1, "red"), mug(2, "blue"))
    asked = [IdentityQuestion(goal_of("Find the red mug."), one, mugs) for one in mugs]
    assert [question.by_rule(AppearanceMatcher())[0] for question in asked] == [True, False]
    assert [question.by_rule(Matcher())[0] for question in asked] == [True, True]  # blind to colours


def test_an_early_stop_is_nearer_than_its_distance_and_saves_a_part_of_the_way():
    early = run(FailThenUpdateEarlyStop(), *moved_table_stages())
    late = run(FailThenUpdate(), *moved_table_stages())
    assert [record.state for record in early] == [record.state for record in late]
    counters = [record.trace[-1].counters["early_looks"] for record in early]
    assert counters[-1] >= 1
    assert sum(r.path_length_m for r in early) < sum(r.path_length_m for r in late)
    for record, looks, before in zip(early, counters, [0, *counters], strict=False):
        if looks > before:
            centre_m = record.trace[-1].chosen_entry.centre_m
            end = record.trace[-1].pose
            assert math.dist((end.x_m, end.z_m), centre_m[::2]) < EarlyStopConfig().stop_within_m


def test_an_early_stop_needs_a_detection_of_its_target():
    agent = FailThenUpdateEarlyStop()
    act = agent.act

    def act_blindly(observation):
        if agent._navigator.target is not None:
            nothing = [replace(v, detections=v.detections.taken([])) for v in observation.views]
            observation = replace(observation, views=tuple(nothing))
        return act(observation)

    agent.act = act_blindly
    (record,) = run(agent, stage_case(1, "Fridge|1"), protocol=ProtocolConfig(max_rounds=20))
    assert record.trace[-1].counters["early_looks"] == 0
    assert record.trace[-1].counters["verifications"] == 1
