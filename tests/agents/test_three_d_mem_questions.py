"""3D-Mem's two questions: prompts, the grammar of their answers, and what the text matcher answers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evonav.agents.frontier_update.questions import ChooseQuestion
from evonav.agents.three_d_mem.questions import PrefilterQuestion, SnapshotCandidate, SnapshotChoice, SnapshotQuestion
from evonav.decision.candidates import FrontierCandidate, ObjectCandidate
from evonav.decision.prompts import Picture
from evonav.decision.question import AnswerError
from evonav.decision.rules import TextMatch
from evonav.tasks.public import Goal

CLASSES = tuple(sorted(("Apple", "Bed", "Chair", "CounterTop", "DiningTable", "Fridge", "Mug", "Sink")))


def goal(text, category):
    return Goal(1, category, text, text, text, np.zeros((1, 1, 3), np.uint8))


MUG_GOAL = goal("Please navigate to the mug in the kitchen on the countertop next to the sink.", "Mug")


def picture(shade):
    return Picture(np.full((4, 6, 3), shade, np.uint8))


def thing(entry_id, label, x, z, *, y=0.4, size=(0.5, 0.8, 0.5), seen=3):
    return ObjectCandidate(entry_id, label, (x, y, z), size, seen, picture(entry_id))


COUNTER = thing(2, "CounterTop", 6.0, 2.0, y=0.45, size=(2.0, 0.9, 0.6))
SINK = thing(3, "Sink", 6.3, 2.0, y=0.8, size=(0.5, 0.2, 0.4))
MUG_ON_TABLE = thing(4, "Mug", 2.0, 2.0, y=0.85, size=(0.1, 0.1, 0.1), seen=9)
MUG_ON_COUNTER = thing(5, "Mug", 5.9, 2.0, y=0.95, size=(0.1, 0.1, 0.1))
FRIDGE = thing(6, "Fridge", 7.5, 2.0, y=0.9, size=(0.7, 1.8, 0.7))
BED = thing(7, "Bed", 1.0, 6.0, size=(1.5, 0.6, 2.0))
ALL = (COUNTER, SINK, MUG_ON_TABLE, MUG_ON_COUNTER, FRIDGE)
FRONTIERS = (
    FrontierCandidate(8, (0.0, 1.0), 1.0, picture(80)),
    FrontierCandidate(9, (6.0, 4.0), 3.5, picture(90)),
)


def snapshot_question(*snapshots, frontiers=FRONTIERS, rounds=40, stage=MUG_GOAL):
    views = [SnapshotCandidate(10 + i, objects, picture(100 + i)) for i, objects in enumerate(snapshots)]
    return SnapshotQuestion(stage, (0.0, 0.0), views, frontiers, ALL, rounds, heading_view=picture(1))


SHOWN = snapshot_question([MUG_ON_TABLE], [COUNTER, MUG_ON_COUNTER])


def prefilter(names=CLASSES, stage=MUG_GOAL):
    return PrefilterQuestion(stage, names)


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("Snapshot 1, Object 0", SnapshotChoice(1, 0)),
        ("\n  snapshot 1 , object 1.\nIt stands by the sink.", SnapshotChoice(1, 1)),
        ("Snapshot 01, Object 001", SnapshotChoice(1, 1)),
        ("FRONTIER 1\nSnapshot 0, Object 0", SnapshotChoice(None, 1)),
    ],
)
def test_choices_are_read_whatever_their_case_and_reason(text, answer):
    assert SHOWN.parse(text) == answer


@pytest.mark.parametrize(
    "text",
    [
        "",
        "Snapshot 0",
        "Object 0",
        "Snapshot 0, Object 1",
        "Snapshot 2, Object 0",
        "Frontier 2",
        "Frontier -1",
        "I would go to Frontier 0",
        "Frontier 0 because it is near",
        "Snapshot 0, Object 0, Object 1",
        "Because it is near:\nFrontier 0",
    ],
)
def test_what_names_no_candidate_is_invalid(text):
    with pytest.raises(AnswerError) as caught:
        SHOWN.parse(text)
    assert caught.value.fault == "invalid"
    assert caught.value.text == text


def test_the_prompt_shows_the_heading_view_then_snapshots_with_crops_then_frontiers():
    (turn,) = SHOWN.prompt().turns
    shades = [int(part.pixels[0, 0, 0]) for part in turn.parts if isinstance(part, Picture)]
    assert shades == [1, 100, 4, 101, 2, 5, 80, 90]
    words = "\n".join(part for part in turn.parts if isinstance(part, str))
    assert "Snapshot 1, Object 1: Mug" in words
    assert MUG_GOAL.unified_instruction in words
    # Nothing of what only rules may use.
    assert "Fridge" not in words
    assert "m away" not in words


def test_without_images_the_prompt_is_words():
    bare = ObjectCandidate(1, "Mug", (0.0, 0.0, 0.0), (0.1, 0.1, 0.1), 1)
    question = SnapshotQuestion(MUG_GOAL, (0.0, 0.0), [SnapshotCandidate(0, [bare])], (), [bare], 5)
    assert all(isinstance(part, str) for part in question.prompt().turns[0].parts)


def test_the_prefilter_drops_unknown_names_and_keeps_ten():
    names = tuple(f"Thing{i:02}" for i in range(15))
    text = "\n".join(("Unicorn", "thing03", "Thing03", *names))
    kept = prefilter(names).parse(text)
    assert len(kept) == 10
    assert kept[:3] == ("Thing03", "Thing00", "Thing01")


def test_the_prefilter_wants_a_name_or_none():
    assert prefilter().parse("None\nnothing here has to do with it") == ()
    for text in ("", "I am sorry, I cannot help with that.", "1. Mug"):
        with pytest.raises(AnswerError) as caught:
            prefilter().parse(text)
        assert caught.value.fault == "invalid"


def test_rules_keep_the_classes_that_the_instruction_speaks_of_then_those_of_its_room():
    reply = TextMatch().answer(prefilter())
    assert reply.answer == ("Mug", "CounterTop", "Sink", "Fridge")
    assert prefilter().parse(reply.text) == reply.answer


def test_rules_keep_no_class_where_none_may_help():
    """As without an answer in the original: no snapshot is left, and the agent explores."""
    reply = TextMatch().answer(prefilter(("Bed", "Chair")))
    assert reply.answer == ()
    assert prefilter(("Bed", "Chair")).parse(reply.text) == ()


@given(st.permutations([MUG_ON_TABLE, MUG_ON_COUNTER, COUNTER, SINK]), st.integers(1, 3))
def test_rules_choose_what_they_would_choose_for_frontier_update(objects, cut):
    asked = snapshot_question(objects[:cut], objects[cut:])
    reply = TextMatch().answer(asked)
    assert asked.parse(reply.text) == reply.answer
    chosen = asked.snapshots[reply.answer.snapshot].objects[reply.answer.index]
    flat = ChooseQuestion(MUG_GOAL, (0.0, 0.0), objects, FRONTIERS, ALL, 40)
    assert chosen == objects[TextMatch().answer(flat).answer.index] == MUG_ON_COUNTER


def test_rules_settle_for_the_goals_kind_even_where_no_relation_holds():
    flat = ChooseQuestion(MUG_GOAL, (0.0, 0.0), [MUG_ON_TABLE], FRONTIERS, ALL, 40)
    assert TextMatch().answer(flat).answer.kind == "frontier"  # Frontier-Update explores on
    assert TextMatch().answer(snapshot_question([MUG_ON_TABLE])).answer == SnapshotChoice(0, 0)


def test_rules_explore_where_nothing_fits_and_settle_when_nothing_is_left():
    assert TextMatch().answer(snapshot_question([COUNTER])).answer.snapshot is None
    assert TextMatch().answer(snapshot_question([COUNTER], frontiers=())).answer == SnapshotChoice(0, 0)
    assert TextMatch().answer(snapshot_question([FRIDGE], frontiers=())).answer == SnapshotChoice(0, 0)
    with pytest.raises(AnswerError):
        TextMatch().answer(snapshot_question([BED], frontiers=()))
