"""Agents that forget object entries by a rule: `fu@bayes`."""

import pytest
from toy_episode import rounds_of
from toy_house import moved_table_stages
from typer.testing import CliRunner

from evonav.agents.registry import BUILT_IN, agent_factory, new_agent
from evonav.cli import app
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.run.components import check_agent_names

FORGETFUL = sorted(set(BUILT_IN) - {"unigoal", "stay-still", "random-walk"})


def test_agents_with_object_entries_of_ours_take_a_rule() -> None:
    for name in BUILT_IN:
        if name in FORGETFUL:
            agent = new_agent(agent_factory(f"{name}@ray-votes"))
            assert type(agent) is type(new_agent(agent_factory(name)))
            assert agent._navigator_config.forgetting == "ray-votes"  # type: ignore[attr-defined]
        else:
            with pytest.raises(InvalidArgumentError, match=f"agent `{name}` has no object entries that rule"):
                agent_factory(f"{name}@ray-votes")


def test_a_rule_that_does_not_exist_is_named_with_the_nearest() -> None:
    for isolation in ("none", "process"):
        with pytest.raises(InvalidArgumentError, match=r"no forgetting rule 'baies': did you mean `bayes`[?]$"):
            check_agent_names(["fu@baies"], AgentHosting(isolation))


@pytest.mark.parametrize("name", [name for name in FORGETFUL if name != "dualmap"])  # its anchors are no entries
def test_an_agent_that_resets_remembers_only_this_stage(name: str) -> None:
    def first_ids(name: str) -> list[int]:
        """Ids of the entries in the first round of the second stage."""
        _, rounds = rounds_of(new_agent(agent_factory(name)), *moved_table_stages())
        return next([entry.entry_id for entry in belief.entries] for stage, belief, _, _ in rounds if stage == 2)

    _, rounds = rounds_of(new_agent(agent_factory(f"{name}@reset")), *moved_table_stages())
    before = {entry.entry_id for stage, belief, _, _ in rounds if stage == 1 for entry in belief.entries}
    if name == "stage-reset":  # its ids begin again
        assert first_ids(f"{name}@reset") == first_ids(name)
    else:
        assert before
        assert before.isdisjoint(first_ids(f"{name}@reset"))
        assert not before.isdisjoint(first_ids(name))


@pytest.mark.parametrize("name", ["fu", "3d-mem", "msgnav"])
def test_an_agent_acts_with_a_rule_as_without_one_where_nothing_is_forgotten(name: str) -> None:
    def actions(name: str) -> list[object]:
        _, rounds = rounds_of(new_agent(agent_factory(name)), *moved_table_stages()[:1])
        return [action for _, _, _, action in rounds]

    for rule in ("never", "see-through", "bayes"):
        assert actions(f"{name}@{rule}") == actions(name)


def test_the_rule_is_part_of_the_name_in_the_run(tmp_path) -> None:
    import evonav

    words = ["evaluate", "--agent", "fu@failed-look", "--limit", "1", "--workers", "0"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "run")])
    assert done.exit_code == 0, done.output
    assert evonav.load_run(tmp_path / "run").agents == ("fu@failed-look",)
