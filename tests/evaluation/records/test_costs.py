from contextlib import nullcontext

import pytest

from evonav.agents.agent import SensorConfig
from evonav.agents.hosting import wire
from evonav.component import Component
from evonav.decision.noisy import NoiseRates, Noisy
from evonav.decision.question import DecisionModel, Metered, Reply
from evonav.decision.vlm.account import Account, Price, Usage
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.agent import RemoteAgent
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.hosting.process import AgentFailedError
from evonav.evaluation.metrics.stage_rows import read_stage_metrics
from evonav.evaluation.records.costs import Stopwatch
from evonav.evaluation.records.schema import ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.tasks.listing import BUNDLED_TASKS, task_files


class Model(DecisionModel):
    needs = frozenset({"images"})

    def __init__(self, account=None):
        self.account = account

    def answer(self, question, attempt=0):
        if question is None:
            raise ValueError("no question")
        return Reply(question, "so")

    def costs(self):
        return {} if self.account is None else self.account.costs()


def test_a_metered_model_answers_the_same_and_counts_its_questions():
    metered = Metered(Model())
    assert metered.needs == {"images"}
    assert metered.answer("q").text == "so"
    with pytest.raises(ValueError, match="no question"):
        metered.answer(None)
    costs = metered.costs()
    assert costs["num_questions"] == 2
    assert set(costs) == {"decision_wall_s", "decision_cpu_s", "num_questions"}


def test_tokens_and_money_are_the_accounts_even_of_a_wrapped_model():
    account = Account(Price(2.0, 10.0), model="m")
    account.settle(account.reserve(Usage(1, 1)), Usage(1_000_000, 500_000))
    account.replayed()
    costs = Metered(Noisy(Model(account), NoiseRates(), 0)).costs()
    assert (costs["input_tokens"], costs["output_tokens"], costs["num_replayed"]) == (1_000_000, 500_000, 1)
    assert costs["cost_usd"] == pytest.approx(7.0)


@pytest.mark.parametrize(
    "wrong",
    [
        '"cost_usd": NaN',
        '"cost_usd": 1e300',
        f'"input_tokens": {10**30}',
        '"input_tokens": -1',
        '"output_tokens": "9"',
        '"success": 1.0',
        '"num_replayed": true',
    ],
)
def test_costs_that_are_no_numbers_are_refused(wrong):
    assert wire.COSTS.read(b'{"num_questions": 3, "cost_usd": 0.5}') == {"num_questions": 3, "cost_usd": 0.5}
    with pytest.raises(InvalidArgumentError, match=wrong.partition(":")[0].strip('"')):
        wire.COSTS.read(f'{{"num_questions": 3, {wrong}}}'.encode())


class Silent:
    """The process of an agent whose model cannot tell its costs."""

    cpu_s = 0.0
    relay = None
    hosting = AgentHosting("process")
    waiting = staticmethod(nullcontext)

    def lend(self, name):
        return self

    def describe(self, label):
        pass

    def send(self, operation, *arguments):
        self.operation = operation

    def answer(self):
        if self.operation == "costs":
            raise AgentFailedError(ErrorKind.AGENT, "ZeroDivisionError: division by zero")
        return {"sensors": wire.SENSORS.write(SensorConfig())}


def test_costs_that_cannot_be_told_are_left_out():
    agent = RemoteAgent(Silent(), "mine", Component("evonav.decision.backends:text_match"), 0)
    assert agent.sensors == SensorConfig()
    assert agent.costs() == {}


def test_a_stopwatch_books_by_component_and_leaves_the_rest_to_the_evaluator():
    cpu_s = iter([0.0, 1.0, 3.0, 10.0, 14.0, 20.0])
    stopwatch = Stopwatch(lambda: next(cpu_s))
    with stopwatch.timing("simulation"):
        pass
    with pytest.raises(KeyError), stopwatch.timing("agent"):
        raise KeyError
    costs = stopwatch.costs({"num_questions": 4})
    assert (costs.cpu_s, costs.simulation_cpu_s, costs.perception_cpu_s) == (20.0, 2.0, 0.0)
    assert (costs.agent_cpu_s, costs.evaluator_cpu_s, costs.num_questions) == (4.0, 14.0, 4)


def test_a_stage_of_an_agent_in_its_own_process_tells_what_it_cost(tmp_path):
    evaluate(["fu"], task_files(BUNDLED_TASKS, 1), tmp_path, num_workers=1)
    with RunStore(tmp_path) as store:
        rows = read_stage_metrics(store)
        assert not any("cpu_s" in text for text in store.record_texts())
    for row in rows:
        parts = (row.simulation_cpu_s, row.perception_cpu_s, row.agent_cpu_s, row.evaluator_cpu_s)
        assert sum(parts) == pytest.approx(row.cpu_s)
        assert 0.0 <= row.decision_cpu_s < row.agent_cpu_s
        # Every question is a decision that the agent counts: a stage's own, not the sum so far.
        assert row.num_questions == row.num_decisions
        assert row.agent_peak_rss_mb is None or row.agent_peak_rss_mb > 1.0
        assert row.input_tokens is None  # rules keep no account
