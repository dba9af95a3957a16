"""Answers of a mock model: read from the prompt's text by simple rules, without looking at images.

They follow the grammar that each prompt of evonav's agents states, and are about as good as looking for the goal's noun
in the text. That is enough to try the way to a model and back; it does not predict what a model would do.
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from evonav.decision.text.language import ParsedGoal, parse_goal, similarity

_GOAL = re.compile(r"^(?:Goal of the robot|A robot is told|A robot looks for)(?: for)?:? (.*)$", re.MULTILINE)
_TITLE = re.compile(r"^((?:Snapshot \d+, )?Object \d+|Frontier \d+):? ?(.*)$", re.MULTILINE)
_IS_SAME = 0.9
"""Smallest similarity at which one noun stands for the other."""


def mock_answer(request: Mapping[str, Any]) -> str:
    """Answer the body of a request: in JSON if the request asks for it, else in lines."""
    content = request["messages"][-1]["content"]
    parts = [{"type": "text", "text": content}] if isinstance(content, str) else content
    text = "\n".join(part["text"] for part in parts if part["type"] == "text")
    lines = answer_lines(text)
    reason = "A rule on the words of the question."
    if "response_format" not in request:
        return "\n".join([*lines, reason] if len(lines) == 1 and "reason" in text else lines)
    schema = request["response_format"]["json_schema"]["schema"]["properties"]["answer"]
    return json.dumps({"answer": lines if schema.get("type") == "array" else lines[0], "reason": reason})


def answer_lines(text: str) -> list[str]:
    """Return lines by the grammar in a prompt; `I cannot tell.` for an unknown grammar."""
    stated = _GOAL.search(text)
    goal = parse_goal(stated[1] if stated else "")
    for mark, rule in _RULES:
        if mark in text:
            return rule(text, goal)
    return ["I cannot tell."]


def _candidate(text: str, goal: ParsedGoal) -> list[str]:
    """Choose a candidate labelled like the goal; else the first frontier, else anything."""
    titles = _TITLE.findall(text)
    labelled = [title for title, label in titles if _is_goal(goal, label)]
    frontiers = [title for title, _ in titles if title.startswith("Frontier")]
    return [*labelled, *frontiers, *(title for title, _ in titles), "Frontier 0"][:1]


def _graph_choice(text: str, goal: ParsedGoal) -> list[str]:
    rejected = set(re.findall(r"chose object (\d+) - not correct", text))
    objects = re.findall(r"^(\d+), ([^,\n]+), [-\d.]+, ", text, re.MULTILINE)
    chosen = [f"Object {number}" for number, label in objects if _is_goal(goal, label) and number not in rejected]
    return [*chosen, "Continue Exploration"][:1]


def _ids(text: str, goal: ParsedGoal) -> list[str]:
    objects = re.findall(r"^(\d+): ([^,\n]+), ", text, re.MULTILINE)
    objects.sort(key=lambda found: -similarity(goal.noun, found[1]))
    return [number for number, _ in objects[:20]] or ["0"]


def _names(text: str, goal: ParsedGoal) -> list[str]:
    listed = text.partition("of these classes:\n")[2].partition("\nRank")[0].splitlines()
    nouns = [goal.noun, *(relation.noun for relation in goal.relations)]
    return [name for noun in nouns for name in listed if similarity(noun, name) >= _IS_SAME] or ["none"]


def _goal_objects(text: str, goal: ParsedGoal) -> list[str]:
    nouns = [goal.noun, *(relation.noun for relation in goal.relations if relation.kind != "in")]
    return [f"[{', '.join(list(dict.fromkeys(nouns))[:5])}]"]


def _relations(text: str, goal: ParsedGoal) -> list[str]:
    pairs = text.partition("pairs of objects in a home:\n")[2].partition("\nHow do they")[0]
    if pairs:
        named = [pair.split(" and ") for pair in pairs.splitlines()]
        return [f"{a} and {b}: {a} is near {b}" for a, b in named]
    listed = re.search(r"The objects are \[(.*?)\]", text)
    known = listed[1].split(", ") if listed else []
    relations = [
        f"{goal.noun} and {other}: {goal.noun} is {kind} {other}"
        for kind, other in ((relation.kind, relation.noun) for relation in goal.relations)
        if goal.noun in known and other in known and other != goal.noun
    ]
    return relations or ["none"]


def _subgraphs(text: str, goal: ParsedGoal) -> list[str]:
    graph = text.partition("objects and relations: ")[2].partition("\nDivide")[0]
    return [f'{{"subgraph_1": {graph}}}']


def _one_of(text: str, goal: ParsedGoal) -> list[str]:
    listed = re.findall(r"\[([^\[\]]*)\]", text)
    names = listed[-1].split(", ") if listed else []
    noun = re.search(r"It is to find: ([^.\n]*)", text)
    fitting = [name for name in names if similarity(noun[1] if noun else goal.noun, name) >= _IS_SAME]
    return [*fitting, *(["none"] if "none of them" in text else names)][:1] or ["none"]


def _layout(text: str, goal: ParsedGoal) -> list[str]:
    listed = re.search(r"objects \[(.*?)\]", text)
    return [f"{name}: ({index}, {index})" for index, name in enumerate(listed[1].split(", ") if listed else [])]


def _corrections(text: str, goal: ParsedGoal) -> list[str]:
    return [f"{number}: keep" for number in re.findall(r"^(\d+): ", text, re.MULTILINE)]


def _is_goal(goal: ParsedGoal, label: str) -> bool:
    return bool(label) and similarity(goal.noun, label) >= _IS_SAME


_RULES: Sequence[tuple[str, Callable[[str, ParsedGoal], list[str]]]] = (
    ('"Continue Exploration"', _graph_choice),
    ('"Frontier i"', _candidate),
    ('"yes" or "no"', lambda text, goal: ["yes"]),
    ("with ids, one a line", _ids),
    ("with names from the list only", _names),
    ("exactly [a, b, ...]", _goal_objects),
    ("A is <relation> B", _relations),
    ('{"subgraph_1"', _subgraphs),
    ("number from 0 to 1", lambda text, goal: ["0.5"]),
    ("object: (x, y)", _layout),
    ("the number, a colon", _corrections),
    ("exactly one of them", _one_of),
    ("in one sentence on one line", lambda text, goal: ["A thing in a room."]),
)
"""Marks of grammars, and the functions that answer by them; the first mark in the prompt counts."""
