"""Instructions are read as a person would: evonav's grammar, and freer wording."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from evonav.decision.text.language import ParsedGoal, Relation, canonical, parse_goal, similarity
from evonav.generation.instructions.describe import adjectives_of, unified_instruction
from evonav.generation.result import Anchor, Appearance, Detail, Relations, Tint
from evonav.tasks.language import MATERIALS, PROCTHOR_TYPES, STRUCTURES

ROOMS = ("Bedroom", "Kitchen", "LivingRoom", "Bathroom")


def relation(kind, noun):
    return Relation(kind, noun)


@pytest.mark.parametrize(
    ("text", "category", "goal"),
    [
        (
            "Please navigate to the mug in the kitchen on the countertop next to the sink.",
            None,
            ParsedGoal("mug", (relation("in", "kitchen"), relation("on", "countertop"), relation("near", "sink"))),
        ),
        (
            "Please navigate to the small white vase in the living room on the TV stand next to the laptop and the "
            "remote control near the window below the painting.",
            None,
            ParsedGoal(
                "vase",
                (
                    relation("in", "living room"),
                    relation("on", "tv stand"),
                    relation("near", "laptop"),
                    relation("near", "remote control"),
                    relation("near", "window"),
                    relation("near", "painting"),
                ),
                ("small", "white"),
            ),
        ),
        (
            "Find the tall green potted plant standing beside the couch, near the large window.",
            None,
            ParsedGoal("house plant", (relation("near", "sofa"), relation("near", "window")), ("tall", "green")),
        ),
        ("Go to the refrigerator.", "Fridge", ParsedGoal("fridge")),
        (
            "Locate the brown wooden dresser with six drawers against the wall.",
            None,
            ParsedGoal("dresser", (), ("brown", "wooden")),
        ),
        (
            "Navigate to the trash can inside the washroom, close to the bathtub.",
            None,
            ParsedGoal("garbage can", (relation("in", "bathroom"), relation("near", "bathtub"))),
        ),
        ("the soap bar in the sink", "SoapBar", ParsedGoal("soap bar", (relation("on", "sink"),))),
        ("", None, ParsedGoal("")),
        # The sentence says what to find; the category counts only where the sentence names no known type.
        ("Go to the desk in the bedroom.", "SideTable", ParsedGoal("desk", (relation("in", "bedroom"),))),
        ("Go to the loveseat in the bedroom.", "Sofa", ParsedGoal("sofa", (relation("in", "bedroom"),))),
        ("Find it near the window.", "Dresser", ParsedGoal("dresser", (relation("near", "window"),))),
    ],
)
def test_reads(text, category, goal):
    assert parse_goal(text, category) == goal


ANCHORS = st.builds(Anchor, category=st.sampled_from(PROCTHOR_TYPES), determiner=st.sampled_from(("the", "a", "some")))
PARTS = st.builds(Anchor, category=st.sampled_from(STRUCTURES), determiner=st.sampled_from(("the", "a")))
RELATIONS = st.builds(
    Relations,
    room_type=st.sampled_from(ROOMS),
    is_category_unique=st.booleans(),
    is_room_type_unique=st.booleans(),
    support=st.none() | ANCHORS,
    is_in_support=st.booleans(),
    neighbours=st.lists(ANCHORS, max_size=2).map(tuple),
    structure=st.none() | PARTS,
    wall_object=st.none() | ANCHORS,
    is_below_wall_object=st.booleans(),
)
APPEARANCES = st.builds(
    Appearance,
    tints=st.lists(
        st.builds(Tint, colour=st.tuples(*[st.integers(0, 255)] * 3), share=st.floats(0.0, 1.0)), max_size=3
    ).map(tuple),
    form=st.sampled_from((None, "round", "L-shaped", "U-shaped")),
    details=st.lists(
        st.builds(Detail, noun=st.sampled_from(("drawer", "open lid", "armrest")), count=st.integers(1, 20)), max_size=3
    ).map(tuple),
    made_of=st.lists(st.sampled_from((*MATERIALS, "food")), max_size=2).map(tuple),
)
SIZES_M = st.tuples(*[st.floats(0.05, 2.0)] * 3)


@given(target=st.sampled_from(PROCTHOR_TYPES), size_m=SIZES_M, relations=RELATIONS, appearance=APPEARANCES)
def test_reads_back_the_grammar(target, size_m, relations, appearance):
    """Every sentence of the grammar in `evonav.tasks.language` is understood in full."""
    things = [relations.support, *relations.neighbours, relations.wall_object]
    said = [target, *(thing.category for thing in things if thing)]
    assume(len({canonical(noun) for noun in said}) == len(said))  # the describer never names a thing twice
    expected = []
    if not relations.is_category_unique:
        expected.append(relation("in", canonical(relations.room_type)))
    if relations.support:
        expected.append(relation("on", canonical(relations.support.category)))
    expected.extend(relation("near", canonical(anchor.category)) for anchor in relations.neighbours)
    if relations.structure and relations.structure.category != "corner":
        expected.append(relation("near", relations.structure.category))
    if relations.wall_object:
        expected.append(relation("near", canonical(relations.wall_object.category)))
    for category in (None, target):
        goal = parse_goal(unified_instruction(target, size_m, relations, appearance), category)
        assert goal.noun == canonical(target)
        assert list(goal.relations) == expected
        words = {word for phrase in adjectives_of(target, size_m, appearance) for word in phrase.split(" and ")}
        assert set(goal.adjectives) == words


@given(st.text(max_size=200), st.none() | st.text(max_size=20))
def test_never_fails(text, category):
    parse_goal(text, category)


def test_spellings_of_one_thing_agree():
    for spellings in (
        ("DiningTable", "dining table", "the dining tables", "Dining Table"),
        ("TVStand", "TV stand", "tv stand", "television stand"),
        ("CD", "cd"),
        ("CounterTop", "countertop", "kitchen counter", "counter"),
        ("ArmChair", "armchair", "arm chair"),
        ("ShelvingUnit", "shelving unit", "bookshelf", "shelves"),
    ):
        assert len({canonical(spelling) for spelling in spellings}) == 1, spellings


def test_similarity_goes_by_the_last_word():
    assert similarity("side table", "SideTable") == 1.0
    assert 0.0 < similarity("table lamp", "DiningTable") < similarity("table", "DiningTable") < 1.0
    assert similarity("mug", "Fridge") == 0.0
