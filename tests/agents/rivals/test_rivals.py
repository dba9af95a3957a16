"""All rivals: equal conditions, with any decision model, and equal seeds give equal paths."""

import pytest
from scripted_model import Scripted
from toy_episode import rounds_of, run
from toy_house import moved_table_stages, stage_case

from evonav.agents.registry import agent_factory, new_agent
from evonav.decision.rules import AppearanceMatch, TextMatch
from evonav.toml import tomllib

RIVALS = ("evolving", "dynamem", "dualmap", "khronos-fu", "vlfm", "onemap")


def by_rule(question):
    return question.answer_text(TextMatch().answer(question).answer)


@pytest.mark.parametrize("name", RIVALS)
def test_a_model_that_looks_is_asked_the_same_kinds_of_questions_with_images(name):
    model = Scripted(by_rule, needs_images=True)
    run(new_agent(agent_factory(name), model), *moved_table_stages())
    chosen = [question for question in model.questions if question.kind == "choose"]
    assert (name == "evolving") is not bool(chosen)
    for question in chosen:
        assert question.heading_view is not None
        assert all(one.image is not None for one in question.frontiers)
    blind = Scripted(by_rule)
    run(new_agent(agent_factory(name), blind), *moved_table_stages())
    assert {question.kind for question in blind.questions} == {question.kind for question in model.questions}


@pytest.mark.parametrize("name", RIVALS)
def test_it_runs_with_rules_that_look(name):
    records = run(new_agent(agent_factory(name), AppearanceMatch()), *moved_table_stages()[:2])
    assert [record.state for record in records] == ["success"] * 2


@pytest.mark.parametrize("name", [*RIVALS, "pro"])
def test_equal_seeds_give_equal_rounds(name):
    def told():
        _, rounds = rounds_of(new_agent(agent_factory(name)), *moved_table_stages())
        said = [(one.choice, one.counters, one.details) for _, _, one, _ in rounds]
        return [(action, belief.entries) for _, belief, _, action in rounds], said

    assert told() == told()


@pytest.mark.parametrize("name", RIVALS)
def test_a_model_without_an_answer_does_not_end_the_search(name):
    def nothing(question):
        return "I do not know."

    agent = new_agent(agent_factory(name), Scripted(nothing))
    (record,) = run(agent, stage_case(1, "Bed|1"))
    assert record.num_rounds > 3


def test_the_sweep_has_all_rivals_beside_the_heuristics(request):
    sweep = tomllib.loads((request.config.rootpath / "examples/sweeps/rivals.toml").read_text())
    assert sweep["agents"] == ["fu", "ftu", *RIVALS]
