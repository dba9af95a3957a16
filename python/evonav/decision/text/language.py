"""Read navigation instructions by rule: what to find, in which room, on what, beside what.

The grammar of evonav's own instructions is in `evonav.tasks.language`; this reads that and freer wording, since
released tasks carry sentences of a language model. Words are compared as nouns: lower case, CamelCase split, synonyms
folded.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import zip_longest
from typing import Literal

from evonav.memory.colours import Layout
from evonav.tasks.language import COLOURS, MATERIALS, PROCTHOR_TYPES, SHAPES, SIZES, STRUCTURES, noun_of, plural_of

RelationKind = Literal["in", "on", "near"]

SYNONYMS: dict[str, str] = {
    "armchair": "arm chair",
    "bath tub": "bathtub",
    "bedside table": "side table",
    "bin": "garbage can",
    "bookcase": "shelving unit",
    "bookshelf": "shelving unit",
    "cellphone": "cell phone",
    "coffee maker": "coffee machine",
    "computer": "desktop",
    "couch": "sofa",
    "counter top": "countertop",
    "counter": "countertop",
    "door": "doorway",
    "door frame": "doorway",
    "doorframe": "doorway",
    "dryer": "clothes dryer",
    "dust bin": "garbage can",
    "dustbin": "garbage can",
    "end table": "side table",
    "floor plant": "house plant",
    "houseplant": "house plant",
    "kitchen counter": "countertop",
    "lounge": "living room",
    "mobile phone": "cell phone",
    "night stand": "side table",
    "nightstand": "side table",
    "phone": "cell phone",
    "picture": "painting",
    "plant": "house plant",
    "poster": "painting",
    "potted plant": "house plant",
    "refrigerator": "fridge",
    "remote": "remote control",
    "restroom": "bathroom",
    "settee": "sofa",
    "shelf": "shelving unit",
    "shelves": "shelving unit",
    "teddy": "teddy bear",
    "television set": "television",
    "television stand": "tv stand",
    "trash bin": "garbage can",
    "trash can": "garbage can",
    "trashcan": "garbage can",
    "tv": "television",
    "washer": "washing machine",
    "washroom": "bathroom",
    "waste basket": "garbage can",
    "wastebasket": "garbage can",
}
"""Synonyms of ProcTHOR's types, as `canonical` writes them."""

ROOMS = ("bedroom", "kitchen", "living room", "bathroom")
"""ProcTHOR's room types."""

_NOUNS = frozenset(
    (
        *(SYNONYMS.get(noun, noun) for noun in (noun_of(kind).lower() for kind in PROCTHOR_TYPES)),
        *ROOMS,
        *("bathtub", "doorway", "window", "table", "lamp"),
    )
)
"""ProcTHOR's types and rooms, canonical: common knowledge of the benchmark, used to tell nouns from adjectives."""

_SINGULARS = {plural_of(noun): noun for noun in _NOUNS}

_ARTICLES = {"a", "an", "the", "its", "some", "any", "that", "this"}
_ADJECTIVES = {word.lower(): word for word in (*SIZES, *SHAPES, *COLOURS, *MATERIALS, *MATERIALS.values())}
_RELATIONS: tuple[tuple[RelationKind, str], ...] = (
    ("near", r"in front of|to the (?:left|right) of|left of|right of"),
    ("on", r"on top of|atop|resting on|placed on|sitting on|standing on|lying on|located on|on|upon"),
    ("on", r"inside of|inside|within"),
    ("near", r"next to|adjacent to|close to|close by|nearby|near|beside|alongside|by|against|opposite|behind|between"),
    ("near", r"directly below|just below|below|underneath|beneath|under|above|over"),
    ("in", r"located in|in"),
)
_RELATION = re.compile("|".join(f"(?P<r{i}>\\b(?:{phrases})\\b)" for i, (_, phrases) in enumerate(_RELATIONS)))
_GOAL = re.compile(
    r"\b(?:navigate|go|head|walk|move|drive|proceed|get|come)\s+(?:over\s+)?(?:to|towards?)\b"
    r"|\b(?:find|locate|reach|approach|search for|look for|looking for|visit)\b"
)
_STOP = re.compile(r"[.;:!?,]|\b(?:and|which|that is|that has|with|where|made|featuring|has|is|are)\b")
_COLOUR_PAIR = re.compile(rf"\b({'|'.join(COLOURS)}) and ({'|'.join(COLOURS)})\b")


@dataclass(frozen=True, slots=True)
class Relation:
    """A relation of the target: in, on or near something."""

    kind: RelationKind
    noun: str
    """Canonical name of the other object or of the room."""


@dataclass(frozen=True, slots=True)
class ParsedGoal:
    """The content of an instruction."""

    noun: str
    """Canonical name of the target."""
    relations: tuple[Relation, ...] = ()
    adjectives: tuple[str, ...] = ()
    """Words of `evonav.tasks.language` for its size, shape, colours and material."""
    picture: Layout | None = field(default=None, compare=False, repr=False)
    """Colours of the goal's picture, if agents go by it and the rules look."""

    @property
    def room(self) -> str | None:
        """The room of the target, if stated."""
        return next((relation.noun for relation in self.relations if relation.kind == "in"), None)


@lru_cache(maxsize=4096)
def canonical(phrase: str) -> str:
    """Return one spelling of a noun: "DiningTable", "the dining tables" and "dining table" are all `dining table`."""
    phrase = noun_of(phrase) if re.fullmatch(r"[A-Z]\w*", phrase) and any(c.islower() for c in phrase) else phrase
    tokens = [token for token in re.findall(r"[a-z0-9]+", phrase.lower()) if token not in _ARTICLES]
    noun = " ".join(tokens)
    for spelling in (noun, _singular(noun)):
        if spelling in SYNONYMS:
            return SYNONYMS[spelling]
        if spelling in _NOUNS:
            return spelling
    return noun


def is_structure(label: str) -> bool:
    """Return whether a label names a door or a window: a part of the house, and never a goal."""
    return canonical(label) in STRUCTURES


def _singular(noun: str) -> str:
    if noun.endswith("shelves"):
        return noun
    if noun in _SINGULARS:
        return _SINGULARS[noun]
    return noun[:-1] if noun.endswith("s") and not noun.endswith("ss") else noun


@lru_cache(maxsize=65536)
def similarity(noun: str, label: str) -> float:
    """Return how well a label, in any spelling, names a canonical noun: 1 the same, 0 no word in common."""
    other = canonical(label)
    if noun == other or _singular(noun) == other:
        return 1.0
    a, b = set(noun.split()), set(other.split())
    # The last word says what a thing is: a side table is a table, a table lamp is none.
    shared = len(a & b) / len(a | b) if a and b else 0.0
    return shared * (0.9 if a and b and noun.split()[-1] == other.split()[-1] else 0.4)


@lru_cache(maxsize=4096)
def parse_goal(instruction: str, category: str | None = None) -> ParsedGoal:
    """Parse an instruction, each only once.

    Args:
        instruction: English text, in evonav's grammar or freer.
        category: Category of the target, which counts only where the sentence names no known type of object.

    Returns:
        What was understood; never fails. A noun that cannot be made out is empty.
    """
    text = " ".join(instruction.replace("’", "'").split()).lower()
    start = _GOAL.search(text)
    text = text[start.end() :] if start else text
    matches = list(_RELATION.finditer(text))
    # Before the noun "and" joins colours: "the black and white mug".
    head = _phrase(re.sub(_COLOUR_PAIR, r"\1 \2", text[: matches[0].start()] if matches else text))
    noun = canonical(_without_adjectives(head))
    if category and noun not in _NOUNS:
        noun = canonical(category)
    relations: list[Relation] = []
    for match, following in zip_longest(matches, matches[1:]):
        kind = next(_RELATIONS[i][0] for i in range(len(_RELATIONS)) if match.group(f"r{i}"))
        clause = text[match.end() : following.start() if following else len(text)]
        for thing in _things(clause):
            relation = _relation(kind, thing)
            if relation is not None and relation.noun != noun and relation not in relations:
                relations.append(relation)
    # Up to the description of parts, whose colours are not the target's.
    appearance = re.split(r"\bwith\b", text[: matches[0].start()] if matches else text)[0]
    tokens = [token for token in re.findall(r"[a-z]+(?:-[a-z]+)?", appearance) if token not in noun.split()]
    adjectives = tuple(dict.fromkeys(_ADJECTIVES[token] for token in tokens if token in _ADJECTIVES))
    return ParsedGoal(noun, tuple(relations), adjectives)


def _relation(kind: RelationKind, thing: str) -> Relation | None:
    noun = canonical(_without_adjectives(thing))
    room = next((room for room in ROOMS if noun.endswith(room)), None)
    if room is not None:
        return Relation("in", room)
    if not noun or noun in {"room", "floor", "ground", "wall", "house", "home", "corner", "left", "right", "side"}:
        return None
    # "In the sink" is a support, not a room.
    return Relation("on" if kind == "in" else kind, noun)


def _things(clause: str) -> Iterable[str]:
    """Yield the noun phrases of `the sink and the mug`."""
    for part in re.split(r"\band\b|,", clause):
        phrase = _phrase(part)
        if phrase:
            yield phrase


def _phrase(clause: str) -> str:
    """Return the first noun phrase: up to punctuation or a clause."""
    end = _STOP.search(clause)
    return (clause[: end.start()] if end else clause).strip()


def _without_adjectives(phrase: str) -> str:
    """Return the last known noun of the phrase, or all of it without articles and adjectives."""
    tokens = [t for t in re.findall(r"[a-z0-9']+", phrase) if t not in _ARTICLES]
    for end in range(len(tokens), 0, -1):
        for length in range(min(3, end), 0, -1):
            known = " ".join(tokens[end - length : end])
            if canonical(known) in _NOUNS:
                return known
    return " ".join(t for t in tokens if t not in _ADJECTIVES)
