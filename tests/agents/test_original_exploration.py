"""3D-Mem and MSGNav explore as their released code does; their variants with `+` have our fallback for frontiers."""

from collections.abc import Callable

import pytest
from evonav_studies.variants import msgnav_plus, three_d_mem_plus
from scripted_model import Scripted
from toy_episode import START, run
from toy_house import stage_case

from evonav.agents.agent import Agent
from evonav.agents.msgnav.agent import MsgNav
from evonav.agents.three_d_mem.agent import ThreeDMem
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import StageRecord

ANSWERS = {
    "prefilter": "none",
    "choose_snapshot": "Frontier 0",
    "subgraph": "none",
    "graph": "Continue Exploration",
    "frontier": "Frontier 0",
}


def explored(make: Callable[..., Agent]) -> StageRecord:
    """A stage in which only frontiers are chosen."""
    agent = make(decision=Scripted(lambda question: ANSWERS[question.kind]))
    (record,) = run(agent, stage_case(1, "Mug|1"), start=START, protocol=ProtocolConfig(max_rounds=60), size_px=120)
    return record


@pytest.mark.parametrize(("released", "plus"), [(ThreeDMem, three_d_mem_plus), (MsgNav, msgnav_plus)])
def test_the_fallback_finds_frontiers_where_no_region_is_left(released: type, plus: type) -> None:
    original, ours = explored(released), explored(plus)
    assert original.trace[-1].num_frontiers == 0
    last = original.num_rounds - 1
    assert [entry.pose for entry in ours.trace[: last + 1]] == [entry.pose for entry in original.trace]
    assert ours.trace[last].num_frontiers > 0
    assert ours.num_rounds > original.num_rounds
