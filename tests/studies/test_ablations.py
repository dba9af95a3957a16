"""Each part of Belief-Weighted Search has an ablation, which the example's sweep names."""

import sys
from dataclasses import fields
from pathlib import Path

from toy_episode import run
from toy_house import stage_case

from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.registry import agent_factory, new_agent

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

EXAMPLES = Path(__file__).parents[2] / "examples"
ENTRY_POINTS = tomllib.loads((EXAMPLES / "studies/pyproject.toml").read_text())["project"]["entry-points"]
SWEEP = tomllib.loads((EXAMPLES / "sweeps/proactive-ablation.toml").read_text())


def test_each_ablation_of_the_sweep_lacks_one_part_and_each_part_has_one():
    switches = {field.name for field in fields(ProactiveConfig) if field.default is True}
    names = [name for name in SWEEP["agents"] if name.startswith("pro-without-")]
    made = [new_agent(agent_factory(ENTRY_POINTS["evonav.agents"][name])) for name in names]
    off = [{part for part in switches if not getattr(agent.config, part)} for agent in made]
    assert all(len(one) == 1 for one in off)
    assert set().union(*off) == switches
    for agent in made:
        assert all(r.is_scored for r in run(agent, stage_case(1, "Bed|1"), stage_case(2, "Fridge|1")))
