"""3D-Mem and MSGNav explore as their released code does; their variants with `+` have our fallback for frontiers."""

import pytest
from scripted_model import Scripted
from toy_episode import START, run
from toy_house import stage_case

from evonav.agents.registry import agent_factory
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import StageRecord

ANSWERS = {
    "prefilter": "none",
    "choose_snapshot": "Frontier 0",
    "subgraph": "none",
    "graph": "Continue Exploration",
    "frontier": "Frontier 0",
}


def explored(name: str) -> StageRecord:
    """A stage in which only frontiers are chosen."""
    agent = agent_factory(name)(decision=Scripted(lambda question: ANSWERS[question.kind]))
    (record,) = run(agent, stage_case(1, "Mug|1"), start=START, protocol=ProtocolConfig(max_rounds=60), size_px=120)
    return record


@pytest.mark.parametrize("name", ["3d-mem", "msgnav"])
def test_the_fallback_finds_frontiers_where_no_region_is_left(name: str) -> None:
    original, ours = explored(name), explored(f"{name}+")
    assert original.trace[-1].num_frontiers == 0
    last = original.num_rounds - 1
    assert [entry.pose for entry in ours.trace[: last + 1]] == [entry.pose for entry in original.trace]
    assert ours.trace[last].num_frontiers > 0
    assert ours.num_rounds > original.num_rounds
