"""Define the vocabulary and grammar of instructions.

All three instructions of `evonav.generation.instructions.describe` are one sentence each and can be parsed by rule.
Instructions written by a language model (`PublicStage.writer` names it) are free English.

    basic_instruction      := "Please navigate to the " NOUN {" " RELATION} "."
    appearance_instruction := "Please navigate to the " LOOKS "."
    unified_instruction    := "Please navigate to the " LOOKS {" " RELATION} "."

    LOOKS    := [SIZE " "] [SHAPE " "] [COLOUR [" and " COLOUR] " "] [MATERIAL " "] NOUN
                [" with " DETAIL [" and " DETAIL]]
    DETAIL   := "a " PART | NUMBER " " PARTS | PARTS
    RELATION := ROOM | SUPPORT | NEAR | [","] EXTRA [" and " EXTRA]
    ROOM     := "in the " NOUN | "in one of the " NOUNS         when the category is not unique in the house
    SUPPORT  := "on " THING | "in " THING                       its receptacle: furniture, a basin or a cupboard
    NEAR     := "next to " THING [" and " THING]                at most two nearby objects
    EXTRA    := "near " PLACE [" and " THING] | "in a corner"   a door, a window, or a corner of the room
              | "below " THING | "near " THING                  something on a wall
    THING    := "the " NOUN | "a " NOUN | "some " NOUNS
    PLACE    := "the " STRUCTURE | "a " STRUCTURE

Relations come in this order, each at most once. "the" marks the only one of its kind in the room, "some" several that
are all near. `NOUN` is `noun_of` a ProcTHOR object or room type, `NOUNS` its plural. `SIZE` is the size relative to
other assets of the category. The other adjectives are those of `SHAPES`, `COLOURS` (two if the second colour covers
much of the object) and `MATERIALS`. A comma comes before the extras if a support or a neighbour precedes them.
"""

import re
from functools import lru_cache

SIZES = ("small", "large")
"""Adjectives for the size of a target among the catalogue's assets of its category; the middle has none."""

SHAPES = ("round", "square", "rectangular", "L-shaped", "U-shaped", "long", "tall", "slim", "wide", "low")
"""Adjectives for a target's form and proportions."""

COLOURS = ("black", "white", "grey", "red", "orange", "yellow", "green", "blue", "purple", "pink", "brown", "beige")
"""Adjectives for the colours that a target shows in its reference image."""

_NOUNS = ("cardboard", "ceramic", "fabric", "glass", "leather", "metal", "paper", "plastic", "rubber", "stone", "wax")
MATERIALS = {**{noun: noun for noun in _NOUNS}, "wood": "wooden"}
"""Adjectives for the materials of a target."""

STRUCTURES = ("doorway", "window", "corner")
"""Parts of the house that instructions refer to."""

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
"""Numerals for counts of parts."""

_IRREGULAR = {"ArmChair": "armchair", "CD": "CD", "CounterTop": "countertop", "TVStand": "TV stand"}
_PLURALS = {"decor": "decor", "foil": "foil", "knife": "knives", "paper": "paper", "shelf": "shelves"}
_UNCOUNTED = {"aluminum foil", "blinds", "boots", "bread", "lettuce", "room decor", "table top decor", "toilet paper"}


@lru_cache(maxsize=1_000)
def noun_of(category: str) -> str:
    """Return the noun of a ProcTHOR object or room type: `noun_of("DiningTable")` is `dining table`.

    No two ProcTHOR types share a noun.
    """
    if category in _IRREGULAR:
        return _IRREGULAR[category]
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", category).lower()


def plural_of(noun: str) -> str:
    """Return the plural of a noun: `plural_of("wine bottle")` is `wine bottles`."""
    head, _, last = noun.rpartition(" ")
    if noun in _UNCOUNTED:
        return noun
    if last in _PLURALS:
        last = _PLURALS[last]
    elif re.search(r"(s|x|z|ch|sh|[^aeiou]o)$", last):
        last += "es"
    elif re.search(r"[^aeiou]y$", last):
        last = last[:-1] + "ies"
    else:
        last += "s"
    return f"{head} {last}" if head else last


def with_article(noun: str) -> str:
    """Return a noun with its indefinite article: `an armchair`, `a mug`, `some bread`."""
    if noun in _UNCOUNTED:
        return f"some {noun}"
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"


def listed(nouns: list[str]) -> str:
    """Join nouns: `a`, `a and b`, `a, b and c`."""
    return " and ".join([", ".join(nouns[:-1]), nouns[-1]]) if len(nouns) > 1 else "".join(nouns)


def phrases_of(text: str) -> tuple[str, ...]:
    """Return the phrases of a list with semicolons between them."""
    return tuple(" ".join(phrase.split()) for phrase in text.split(";"))


PROCTHOR_TYPES = phrases_of(
    """
    AlarmClock; AluminumFoil; Apple; ArmChair; BaseballBat; BasketBall; Bed; Blinds; Book; Boots; Bottle; Bowl;
    Box; Bread; ButterKnife; CD; Candle; Cart; CellPhone; Chair; Cloth; ClothesDryer; CoffeeMachine;
    CoffeeTable; CounterTop; CreditCard; Cup; Desk; DeskLamp; Desktop; DiningTable; DishSponge; DogBed; Dresser;
    Dumbbell; Egg; Faucet; FloorLamp; Footstool; Fork; Fridge; GarbageBag; GarbageCan; HandTowel;
    HandTowelHolder; HousePlant; Kettle; KeyChain; Knife; Ladle; Laptop; LaundryHamper; Lettuce; LightSwitch;
    Microwave; Mug; Newspaper; Ottoman; Painting; Pan; PaperTowelRoll; Pen; Pencil; PepperShaker; Pillow; Plate;
    Plunger; Pot; Potato; RemoteControl; RoomDecor; Safe; SaltShaker; ScrubBrush; ShelvingUnit; ShowerCurtain;
    ShowerHead; SideTable; Sink; SoapBar; SoapBottle; Sofa; Spatula; Spoon; SprayBottle; Statue; Stool; TVStand;
    TableTopDecor; TeddyBear; Television; TennisRacket; TissueBox; Toaster; Toilet; ToiletPaper;
    ToiletPaperHanger; Tomato; Towel; TowelHolder; VacuumCleaner; Vase; WashingMachine; Watch; WateringCan;
    WineBottle
    """
)
"""ProcTHOR's types of objects; doors, windows and what the house is built of are none."""

STRUCTURE_TYPES = ("Doorway", "Doorframe", "Window")
"""ProcTHOR's types of doors, with and without a leaf, and of windows: they are detected, never move, and are no goals.

Instructions call both types of doors a doorway."""
