"""List the words that detectors look for, and what they mean in ProcTHOR's types."""

from collections.abc import Mapping
from typing import Literal

from evonav.decision.text.language import canonical
from evonav.tasks.language import PROCTHOR_TYPES, STRUCTURE_TYPES, noun_of, phrases_of
from evonav.tasks.vocabulary import MAP_CATEGORIES

VocabularyName = Literal["procthor", "scannet200", "coco-unigoal", "dino-unigoal"]


PROCTHOR_NOUNS = tuple(noun_of(kind) for kind in PROCTHOR_TYPES)
"""Their names in words."""
PROCTHOR_WORDS = (*PROCTHOR_NOUNS, "door", "window")
"""The words that an open-vocabulary detector is asked for if nothing else is said."""

SCANNET200 = phrases_of(
    """
    wall; chair; floor; table; door; couch; cabinet; shelf; desk; office chair; bed; pillow; sink; picture;
    window; toilet; bookshelf; monitor; curtain; book; armchair; coffee table; box; refrigerator; lamp; kitchen
    cabinet; towel; clothes; tv; nightstand; counter; dresser; stool; cushion; plant; ceiling; bathtub; end
    table; dining table; keyboard; bag; backpack; toilet paper; printer; tv stand; whiteboard; blanket; shower
    curtain; trash can; closet; stairs; microwave; stove; shoe; computer tower; bottle; bin; ottoman; bench;
    board; washing machine; mirror; copier; basket; sofa chair; file cabinet; fan; laptop; shower; paper;
    person; paper towel dispenser; oven; blinds; rack; plate; blackboard; piano; suitcase; rail; radiator;
    recycling bin; container; wardrobe; soap dispenser; telephone; bucket; clock; stand; light; laundry basket;
    pipe; clothes dryer; guitar; toilet paper holder; seat; speaker; column; bicycle; ladder; bathroom stall;
    shower wall; cup; jacket; storage bin; coffee maker; dishwasher; paper towel roll; machine; mat; windowsill;
    bar; toaster; bulletin board; ironing board; fireplace; soap dish; kitchen counter; doorframe; toilet paper
    dispenser; mini fridge; fire extinguisher; ball; hat; shower curtain rod; water cooler; paper cutter; tray;
    shower door; pillar; ledge; toaster oven; mouse; toilet seat cover dispenser; furniture; cart; storage
    container; scale; tissue box; light switch; crate; power outlet; decoration; sign; projector; closet door;
    vacuum cleaner; candle; plunger; stuffed animal; headphones; dish rack; broom; guitar case; range hood;
    dustpan; hair dryer; water bottle; handicap bar; purse; vent; shower floor; water pitcher; mailbox; bowl;
    paper bag; alarm clock; music stand; projector screen; divider; laundry detergent; bathroom counter; object;
    bathroom vanity; closet wall; laundry hamper; bathroom stall door; ceiling light; trash bin; dumbbell; stair
    rail; tube; bathroom cabinet; cd case; closet rod; coffee kettle; structure; shower head; keyboard piano;
    case of water bottles; coat rack; storage organizer; folded chair; fire alarm; power strip; calendar;
    poster; potted plant; luggage; mattress
    """
)
"""3D-Mem's words: the 200 classes of ScanNet200, background included."""

COCO_UNIGOAL = MAP_CATEGORIES
"""UniGoal's 15 of COCO's, in its words."""

DINO_UNIGOAL = phrases_of(
    "table; tv; chair; cabinet; sofa; bed; windows; kitchen; bedroom; living room; mirror; plant; curtain; painting;"
    "picture"
)
"""UniGoal's 15 of the scene graph, three rooms among them."""

VOCABULARIES: Mapping[VocabularyName, tuple[str, ...]] = {
    "procthor": PROCTHOR_WORDS,
    "scannet200": SCANNET200,
    "coco-unigoal": COCO_UNIGOAL,
    "dino-unigoal": DINO_UNIGOAL,
}

_MORE = {
    "ball": "BasketBall",
    "bathroom counter": "CounterTop",
    "cd case": "CD",
    "clock": "AlarmClock",
    "coffee kettle": "Kettle",
    "computer tower": "Desktop",
    "cushion": "Pillow",
    "decoration": "RoomDecor",
    "floor plant": "HousePlant",
    "folded chair": "Chair",
    "laundry basket": "LaundryHamper",
    "mini fridge": "Fridge",
    "office chair": "Chair",
    "recycling bin": "GarbageCan",
    "shoe": "Boots",
    "soap dispenser": "SoapBottle",
    "sofa chair": "ArmChair",
    "stuffed animal": "TeddyBear",
    "toilet paper holder": "ToiletPaperHanger",
    "water bottle": "Bottle",
}
"""Words for which the synonyms of instructions have no type: what ProcTHOR has of such things."""


def type_of_word(word: str) -> str | None:
    """ProcTHOR's type that a detector's word means; `None` if it means none of them, or one of several.

    A `table` may be a dining table, a side table or a coffee table: it stays a table.
    """
    return _MORE.get(word.lower()) or _TYPE_OF_NOUN.get(canonical(word))


_TYPE_OF_NOUN = {canonical(kind): kind for kind in (*reversed(STRUCTURE_TYPES), *PROCTHOR_TYPES)}

TYPE_OF_WORD: Mapping[str, str] = {
    word: kind
    for phrases in (*VOCABULARIES.values(), PROCTHOR_TYPES)
    for word in phrases
    if (kind := type_of_word(word)) is not None
}
"""Type by word, for the words of all lists and the types themselves."""
