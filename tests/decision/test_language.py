"""Instructions are read as a person would: evonav's grammar, and freer wording."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from evonav.decision.language import Goal, Relation, canonical, parse_goal, similarity
from evonav.tasks.language import COLOURS, SIZES, noun_of

TYPES = [
    "AlarmClock",
    "ArmChair",
    "BaseballBat",
    "Bed",
    "Book",
    "CD",
    "CellPhone",
    "Chair",
    "CoffeeTable",
    "CounterTop",
    "DeskLamp",
    "DiningTable",
    "DogBed",
    "Dresser",
    "Fridge",
    "GarbageCan",
    "HousePlant",
    "Laptop",
    "Mug",
    "Painting",
    "RemoteControl",
    "ShelvingUnit",
    "SideTable",
    "Sink",
    "Sofa",
    "SoapBar",
    "TVStand",
    "TeddyBear",
    "Television",
    "Toilet",
    "ToiletPaper",
    "Vase",
    "WashingMachine",
    "Watch",
]
ROOMS = ("Bedroom", "Kitchen", "LivingRoom", "Bathroom")


def relation(kind, noun):
    return Relation(kind, noun)


@pytest.mark.parametrize(
    ("text", "category", "goal"),
    [
        (
            "Please navigate to the mug in the kitchen on the countertop next to the sink.",
            None,
            Goal("mug", (relation("in", "kitchen"), relation("on", "countertop"), relation("near", "sink"))),
        ),
        (
            "Please navigate to the small white vase in the living room on the TV stand next to the laptop and the "
            "remote control near the window below the painting.",
            None,
            Goal(
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
            Goal("house plant", (relation("near", "sofa"), relation("near", "window")), ("green",)),
        ),
        ("Go to the refrigerator.", "Fridge", Goal("fridge")),
        ("Locate the brown wooden dresser with six drawers against the wall.", None, Goal("dresser", (), ("brown",))),
        (
            "Navigate to the trash can inside the washroom, close to the bathtub.",
            None,
            Goal("garbage can", (relation("in", "bathroom"), relation("near", "bathtub"))),
        ),
        ("the soap bar in the sink", "SoapBar", Goal("soap bar", (relation("on", "sink"),))),
        ("", None, Goal("")),
    ],
)
def test_reads(text, category, goal):
    assert parse_goal(text, category) == goal


@given(
    target=st.sampled_from(TYPES),
    room=st.none() | st.sampled_from(ROOMS),
    support=st.none() | st.sampled_from(TYPES),
    anchors=st.lists(st.sampled_from(TYPES), max_size=2, unique=True),
    structure=st.none() | st.sampled_from(("doorway", "window")),
    size=st.none() | st.sampled_from(SIZES),
    colour=st.none() | st.sampled_from(COLOURS),
)
def test_reads_back_the_grammar(target, room, support, anchors, structure, size, colour):
    """What `evonav.tasks.language` lets the generator say is understood in full."""
    said = [noun for noun in (target, support, *anchors) if noun]
    assume(len(set(said)) == len(said))  # the generator never names a thing twice
    words = [f"Please navigate to the {' '.join(filter(None, (size, colour, noun_of(target))))}"]
    expected = []
    if room:
        words.append(f"in the {noun_of(room)}")
        expected.append(relation("in", canonical(room)))
    if support:
        words.append(f"on the {noun_of(support)}")
        expected.append(relation("on", canonical(support)))
    if anchors:
        words.append("next to " + " and ".join(f"the {noun_of(anchor)}" for anchor in anchors))
        expected.extend(relation("near", canonical(anchor)) for anchor in anchors)
    if structure:
        words.append(f"near the {structure}")
        expected.append(relation("near", structure))
    goal = parse_goal(" ".join(words) + ".")
    assert goal.noun == canonical(target)
    assert list(goal.relations) == expected
    assert goal.adjectives == tuple(filter(None, (size, colour)))


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
