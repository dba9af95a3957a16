"""The text matcher's choices, and that they do not depend on the order of what it is shown."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evonav.agents.frontier_update.questions import ChooseQuestion, ComparedDetection, VerifyQuestion
from evonav.decision.candidates import FrontierCandidate, ObjectCandidate
from evonav.decision.question import AnswerError, Question
from evonav.decision.rules import TextMatch
from evonav.decision.text.matcher import Matcher
from evonav.decision.text.ranking import rank_by_feature, rank_entries
from evonav.errors import DecisionError
from evonav.memory.presence import DepthEvidence
from evonav.tasks.public import Goal


def goal(text, category):
    return Goal(1, category, text, text, text, np.zeros((1, 1, 3), np.uint8))


def thing(entry_id, label, x, z, *, y=0.4, size=(0.5, 0.8, 0.5), seen=3):
    return ObjectCandidate(entry_id, label, (x, y, z), size, seen)


TABLE = thing(1, "DiningTable", 2.0, 2.0, size=(1.5, 0.8, 1.0))
COUNTER = thing(2, "CounterTop", 6.0, 2.0, y=0.45, size=(2.0, 0.9, 0.6))
SINK = thing(3, "Sink", 6.3, 2.0, y=0.8, size=(0.5, 0.2, 0.4))
MUG_ON_TABLE = thing(4, "Mug", 2.0, 2.0, y=0.85, size=(0.1, 0.1, 0.1), seen=9)
MUG_ON_COUNTER = thing(5, "Mug", 5.9, 2.0, y=0.95, size=(0.1, 0.1, 0.1))
FRIDGE = thing(6, "Fridge", 7.5, 2.0, y=0.9, size=(0.7, 1.8, 0.7))
BED = thing(7, "Bed", 12.0, 2.0, size=(2.0, 0.6, 1.5))
ALL = [TABLE, COUNTER, SINK, MUG_ON_TABLE, MUG_ON_COUNTER, FRIDGE, BED]
MUG_GOAL = goal("Please navigate to the mug in the kitchen on the countertop next to the sink.", "Mug")
NEAR, FAR = FrontierCandidate(1, (0.0, 1.0), 1.0), FrontierCandidate(2, (6.0, 4.0), 3.5)


def question(entries, frontiers=(), stage=MUG_GOAL, rounds=40):
    model = TextMatch()
    ranked = [entries[i] for i in rank_entries(Matcher(), stage, entries, (0.0, 0.0))[:5]]
    return model, ChooseQuestion(stage, (0.0, 0.0), ranked, frontiers, entries, rounds)


def chosen(model, asked):
    reply = model.answer(asked)
    assert asked.parse(reply.text) == reply.answer
    candidates = {"object": asked.objects, "frontier": asked.frontiers}
    return candidates[reply.answer.kind][reply.answer.index]


def test_all_are_ranked_by_what_the_instruction_speaks_of():
    order = [ALL[i].entry_id for i in rank_entries(Matcher(), MUG_GOAL, ALL, (0.0, 0.0))]
    assert order[:2] == [4, 5]  # of the same label the one that was detected more often comes first
    assert order[2] == 2
    assert sorted(order) == [entry.entry_id for entry in ALL]


@settings(deadline=None)
@given(st.permutations(ALL))
def test_order_makes_no_difference(entries):
    model, asked = question(list(entries), [NEAR, FAR])
    assert chosen(model, asked) == MUG_ON_COUNTER


def test_the_wrong_instance_does_not_end_the_search():
    entries = [TABLE, MUG_ON_TABLE, COUNTER, SINK]
    model, asked = question(entries, [NEAR])
    assert chosen(model, asked) == NEAR
    model, asked = question(entries)
    assert chosen(model, asked) == MUG_ON_TABLE
    model, asked = question(entries, [NEAR], rounds=5)
    assert chosen(model, asked) == MUG_ON_TABLE


def test_without_the_object_it_explores_where_it_should_be():
    model, asked = question([TABLE, COUNTER, SINK], [NEAR, FAR])
    assert chosen(model, asked) == FAR
    model, asked = question([TABLE], [NEAR, FAR])
    assert chosen(model, asked) == NEAR


def test_with_nothing_left_to_explore_it_goes_where_the_object_should_be():
    model, asked = question([TABLE, COUNTER, BED])
    assert chosen(model, asked) == COUNTER
    model, asked = question([BED])
    with pytest.raises(AnswerError, match="nothing to go to"):
        model.answer(asked)


def test_the_room_is_told_by_what_stands_in_it():
    stage = goal("Please navigate to the chair in the bedroom.", "Chair")
    by_bed, by_fridge = thing(8, "Chair", 11.0, 3.0), thing(9, "Chair", 8.5, 2.0, seen=20)
    model, asked = question([FRIDGE, BED, by_fridge, by_bed], [NEAR], stage)
    assert chosen(model, asked) == by_bed


SEEN_THROUGH = DepthEvidence(num_see_through=256)


def test_verification_answers_yes_to_the_label_at_the_place():
    model = TextMatch()
    for sighting, is_present in (
        (ComparedDetection("Mug", 0.9, 0.6), True),
        (ComparedDetection("Mug", 0.0, 0.3), True),
        (ComparedDetection("Mug", 0.1, 0.8), False),
        (ComparedDetection("Mug", 0.0, float("inf")), False),
        (ComparedDetection("Bowl", 0.9, 0.0), False),
    ):
        assert model.answer(VerifyQuestion(MUG_GOAL, MUG_ON_TABLE, [sighting], SEEN_THROUGH)).answer is is_present


@pytest.mark.parametrize(
    ("evidence", "is_present", "reason"),
    [
        (SEEN_THROUGH, False, "no: of 256 points in view, 256 seen through, 0 on a surface, 0 hidden"),
        (DepthEvidence(num_supported=256), True, "yes: of 256 points"),
        (DepthEvidence(num_occluded=256), True, "unknown: of 256 points"),
        (DepthEvidence(num_out_of_view=256), True, "unknown: of 0 points"),
    ],
)
def test_verification_without_the_label_answers_no_only_if_the_place_is_seen_through(evidence, is_present, reason):
    reply = TextMatch().answer(VerifyQuestion(MUG_GOAL, MUG_ON_TABLE, [], evidence))
    assert reply.answer is is_present
    assert reason in reply.text


def test_entries_are_ranked_by_the_cosine_of_their_features_where_they_have_some() -> None:
    goal = np.array([1.0, 0.0], np.float32)
    features = [np.array(one, np.float32) for one in ((0.0, 1.0), (0.6, 0.8), (1.0, 0.0), (0.6, 0.8))]
    assert rank_by_feature(goal, [*features, None], [1, 9, 3, 4, 0]) == [2, 3, 1, 0, 4]


class Unruled(VerifyQuestion):
    """A question of somebody else's agent, which says nothing of rules."""

    by_rule = Question.by_rule


class Ruled(VerifyQuestion):
    """One that brings its own."""

    def by_rule(self, matcher):
        return True, "as always"


def test_every_question_answers_by_a_rule_of_its_own():
    reply = TextMatch().answer(Ruled(MUG_GOAL, MUG_ON_TABLE, [], SEEN_THROUGH))
    assert (reply.answer, reply.text) == (True, "yes\nas always")
    with pytest.raises(DecisionError, match="no rule for Unruled: ask a model"):
        TextMatch().answer(Unruled(MUG_GOAL, MUG_ON_TABLE, [], 0.1))


DOOR = thing(20, "Doorway", 6.3, 2.6, y=1.0, size=(1.0, 2.0, 0.1), seen=50)
WINDOW = thing(21, "Window", 2.0, 2.8, y=1.5, size=(1.0, 1.0, 0.1), seen=50)
FRAME = thing(22, "Doorframe", 2.0, 1.2, y=1.0, size=(1.0, 2.0, 0.1), seen=50)


def share(text, mug, *around):
    matcher = Matcher()
    return matcher.relation_share(matcher.parsed(goal(f"Find the mug {text}.", "Mug")), mug, [*ALL, *around])


@pytest.mark.parametrize(
    ("text", "structure", "near"),
    [
        ("near the doorway", DOOR, MUG_ON_COUNTER),
        ("near a door", FRAME, MUG_ON_TABLE),
        ("near the window", WINDOW, MUG_ON_TABLE),
        ("by the windows", WINDOW, MUG_ON_TABLE),
    ],
)
def test_a_doorway_or_a_window_is_judged_once_one_is_remembered(text, structure, near):
    far = MUG_ON_TABLE if near is MUG_ON_COUNTER else MUG_ON_COUNTER
    assert share(text, near) == share(text, far) == 1.0, "an agent that remembers none cannot tell"
    assert share(text, near, structure) == 1.0
    assert share(text, far, structure) == 0.0


def test_a_corner_is_never_judged():
    assert share("in a corner", MUG_ON_TABLE, DOOR, WINDOW) == 1.0
    assert share("on the countertop, in a corner", MUG_ON_TABLE, DOOR, WINDOW) == 0.0


def test_doors_and_windows_are_no_candidates_and_no_hints():
    stage = goal("Please navigate to the mug near the doorway and the window.", "Mug")
    structures = [DOOR, WINDOW, FRAME]
    parsed = Matcher().parsed(stage)
    assert [Matcher().label_score(parsed, one.label) for one in structures] == [0.0] * 3
    model, asked = question([*structures, FRIDGE], stage=stage)
    with pytest.raises(AnswerError, match="nothing to go to"):
        model.answer(asked)
    costs_m = Matcher().frontier_costs_m(parsed, [NEAR, FAR], structures)
    assert costs_m == [NEAR.travel_m, FAR.travel_m]
