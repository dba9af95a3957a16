"""What holds for every question that any agent really asks: words and grammar, schema and other answers agree."""

import json
import re
from collections import defaultdict
from typing import Any

import jsonschema
import numpy as np
import pytest
from bundled_run import bundled_run

from evonav.component import Component
from evonav.decision.noisy import GARBAGE
from evonav.decision.prompts import Picture
from evonav.decision.question import AnswerError, DecisionModel, Question, Reply
from evonav.decision.rules import TextMatch
from evonav.decision.vlm.decision import read_json, with_schema
from evonav.evaluation.run.components import Backend
from vlm_stub import check_strict

NUM_OF_A_KIND = 12
WITH_CASE = ("decompose", "goal-relations", "scene-relations")
"""JSON, and lines in which small words are part of the grammar."""
ASKED: dict[str, list[tuple[Question[Any], Reply[Any]]]] = defaultdict(list)


class Collecting(DecisionModel):
    """The text matcher, with images, keeping some questions of each kind."""

    needs = frozenset({"images"})

    def __init__(self, seed: int) -> None:
        self.model = TextMatch()
        self.num = 0

    def answer(self, question: Question[Any], attempt: int = 0) -> Reply[Any]:
        reply = self.model.answer(question, attempt)
        self.num += 1
        asked = ASKED[question.kind]
        if not asked or (len(asked) < NUM_OF_A_KIND and self.num % 3 == 1):
            asked.append((question, reply))
        return reply


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[tuple[Question[Any], Reply[Any]]]]:
    agents = ["ftu", "3d-mem", "msgnav", "unigoal", "evonav_studies.variants:unigoal_as_published"]
    backend = Backend(decision=Component(f"{__name__}:Collecting"))
    records = bundled_run(tmp_path_factory.mktemp("runs"), agents, backend, max_rounds=5, max_actions=30)
    assert [record.error for record in records if record.error] == []
    return ASKED


@pytest.mark.slow
def test_all_agents_ask(asked: dict[str, list[tuple[Question[Any], Reply[Any]]]]) -> None:
    assert {"choose", "prefilter", "choose_snapshot", "subgraph", "graph", "goal-objects", "category"} <= set(asked)


def test_words_are_what_the_grammar_reads(asked: dict[str, list[tuple[Question[Any], Reply[Any]]]]) -> None:
    for kind, pairs in asked.items():
        for question, reply in pairs:
            assert question.parse(question.answer_text(reply.answer)) == reply.answer, kind
            if kind not in WITH_CASE:
                question.parse(question.answer_text(reply.answer).upper())
            others = list(question.alternatives(reply.answer))
            assert reply.answer not in others, kind
            for other in others:
                assert question.parse(question.answer_text(other)) == other, kind


def test_schemas_are_strict_and_hold_every_answer(asked: dict[str, list[tuple[Question[Any], Reply[Any]]]]) -> None:
    for kind, pairs in asked.items():
        for question, reply in pairs:
            schema = with_schema(question.prompt(), question.answer_schema()).schema
            assert schema is not None
            check_strict(dict(schema))
            # Servers that compile patterns to grammars know no such classes, and would accept any text.
            assert not re.search(r"\\\\[dwsb]", json.dumps(schema)), kind
            for answer in (reply.answer, *question.alternatives(reply.answer)):
                words = question.answer_text(answer)
                is_array = question.answer_schema()["type"] == "array"
                content = {"answer": words.split("\n") if is_array else words, "reason": "Because\nof it."}
                jsonschema.validate(content, schema)
                assert read_json(question, json.dumps(content)).answer == answer, kind


def test_prompts_say_their_grammar_and_are_the_same_again(
    asked: dict[str, list[tuple[Question[Any], Reply[Any]]]],
) -> None:
    for kind, pairs in asked.items():
        for question, _ in pairs:
            parts, again = question.prompt().parts, question.prompt().parts
            assert isinstance(parts[-1], str), kind
            assert "nswer" in parts[-1] or kind == "describe", kind
            assert len(parts) == len(again)
            for part, other in zip(parts, again, strict=True):
                if isinstance(part, Picture):
                    assert isinstance(other, Picture)
                    assert part.pixels.dtype == np.uint8
                    assert part.pixels.ndim == 3
                    assert np.array_equal(part.pixels, other.pixels)
                else:
                    assert part == other
                    assert part.strip()


def test_garbage_is_no_answer(asked: dict[str, list[tuple[Question[Any], Reply[Any]]]]) -> None:
    for kind, pairs in asked.items():
        for garbage in GARBAGE:
            with pytest.raises(AnswerError) as caught:
                pairs[0][0].parse(garbage)
            assert caught.value.fault == "invalid", kind


def test_no_prompt_says_that_things_may_have_been_moved(
    asked: dict[str, list[tuple[Question[Any], Reply[Any]]]],
) -> None:
    for kind, pairs in asked.items():
        for question, _ in pairs:
            assert "moved" not in question.prompt().text, kind
