"""The distances to frontiers of which agents tell their decision model."""

import math
from typing import Any

import pytest
from scripted_model import Scripted
from toy_episode import START, run
from toy_house import stage_case

from evonav.agents.registry import agent_factory
from evonav.decision.candidates import FrontierCandidate
from evonav.evaluation.protocol import ProtocolConfig


def questions(*, needs_colours: bool) -> list[Any]:
    """Return an agent's questions while it goes to the frontier that is named last."""
    model = Scripted(lambda question: f"Frontier {len(question.frontiers) - 1}")
    model.needs = frozenset({"colours"}) if needs_colours else frozenset()
    agent = agent_factory("fu")(decision=model)
    run(agent, stage_case(1, "Mug|1"), start=START, protocol=ProtocolConfig(max_rounds=12), size_px=120)
    return model.questions


def straight_m(question: Any, frontier: FrontierCandidate) -> float:
    return math.dist(question.position_m, frontier.position_m)


def test_rules_that_look_are_told_the_way_along_the_map() -> None:
    asked = questions(needs_colours=True)
    detours = [one.travel_m / straight_m(question, one) for question in asked for one in question.frontiers]
    assert min(detours) > 0.8  # ways are from cell to cell
    assert max(detours) > 1.2


def test_others_are_told_the_straight_distance() -> None:
    for question in questions(needs_colours=False):
        for frontier in question.frontiers:
            assert frontier.travel_m == pytest.approx(straight_m(question, frontier))


def test_the_frontier_on_the_way_is_marked() -> None:
    marked = [
        [one.frontier_id for one in question.frontiers if one.is_current] for question in questions(needs_colours=True)
    ]
    assert marked[0] == []
    assert any(marked)
    assert all(len(ids) <= 1 for ids in marked)
