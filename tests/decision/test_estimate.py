"""What a run would cost: extrapolated from what was counted, with the spread over tasks."""

from pathlib import Path

import pytest

from evonav.component import Component
from evonav.decision.vlm.account import Ledger, Usage
from evonav.decision.vlm.client import Pace
from evonav.decision.vlm.errors import VlmError
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.evaluation.cost_estimate import estimate_run, ratio_error
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.tasks.listing import BUNDLED_TASKS, task_files
from vlm_stub import serving


def test_an_estimate_counts_what_a_model_that_answers_alike_is_asked(tmp_path: Path) -> None:
    """The server answers by rules of its own, so the run is cut to the one round in which all agree."""
    config = RunConfig(protocol=ProtocolConfig(max_rounds=1))
    tasks = task_files(BUNDLED_TASKS, 2)
    (estimate,) = estimate_run(["fu"], tasks, config, {"model": "m"}, num_tasks=1)
    (whole,) = estimate_run(["fu"], tasks, config, {"model": "m"})
    with serving(lambda request: {"text": mock_answer(request)}) as stub:
        host = {"server": {"base_url": stub.url}, "ledger": str(tmp_path / "ledger.sqlite")}
        backend = Backend(decision=Component("evonav.decision.backends:vlm", {"model": "m"}, host))
        evaluate(
            ["fu"],
            tasks,
            tmp_path / "run",
            config=RunConfig(protocol=config.protocol, backend=backend),
            num_workers=0,
        )
    num_stages = sum(task.num_stages for task in tasks)
    assert (estimate.num_stages, estimate.num_stages_run) == (num_stages, tasks[0].num_stages)
    assert estimate.num_requests == num_stages
    assert whole.relative_error == 0.0
    assert whole.num_requests == len(stub.requests or []) == num_stages
    assert whole.kinds == {"choose": num_stages}
    # gpt-4o counts at least 255 for each image that is larger than a tile's half.
    assert whole.input_tokens > 1000 * num_stages
    (spent,) = Ledger(tmp_path / "ledger.sqlite").spending()
    assert (spent.num_asked, spent.input_tokens) == (num_stages, 1000 * num_stages)


def test_agents_in_a_sandbox_are_counted() -> None:
    """The model that counts writes a file, which an agent's process in a sandbox may not."""
    config = RunConfig(protocol=ProtocolConfig(max_rounds=1), hosting=AgentHosting(isolation="sandbox"))
    tasks = task_files(BUNDLED_TASKS, 1)
    (estimate,) = estimate_run(["fu"], tasks, config, {"model": "m"}, num_workers=1)
    assert estimate.num_requests == tasks[0].num_stages


def test_the_spread_is_of_ratios() -> None:
    assert ratio_error([(4, 400)]) == float("inf")
    assert ratio_error([(4, 400), (3, 300), (5, 500)]) == pytest.approx(0.0)
    # Two tasks of one stage with 90 and 110: mean 100, standard error 10, t = 12.7.
    assert ratio_error([(1, 90), (1, 110)]) == pytest.approx(1.2706, abs=1e-3)
    assert ratio_error([(1, 0), (1, 0)]) == 0.0


def test_one_limit_for_all_processes(tmp_path: Path) -> None:
    """Two models of one run, as in two processes, share what may be spent."""
    ledgers = [Ledger(tmp_path / "ledger.sqlite") for _ in range(2)]
    ledgers[0].reserve("m", 0.6, 1.0)
    with pytest.raises(VlmError, match=r"over_budget: \$0.6000 of \$1 spent"):
        ledgers[1].reserve("m", 0.6, 1.0)
    ledgers[0].settle("m", 0.6, Usage(10, 1), 0.1)
    ledgers[1].reserve("m", 0.6, 1.0)
    (spent,) = ledgers[0].spending()
    assert (spent.num_asked, spent.input_tokens, spent.cost_usd) == (1, 10, pytest.approx(0.1))
    assert spent.set_aside_usd == pytest.approx(0.6)


@pytest.mark.slow
def test_a_run_of_several_processes_stops_at_its_limit(tmp_path: Path) -> None:
    """A question sets 0.01 $ aside and costs 0.004 $; two workers may ask for 0.03 $ in all."""
    with serving(lambda request: {"text": mock_answer(request)}) as stub:
        host = {
            "server": {"base_url": stub.url},
            "ledger": str(tmp_path / "ledger.sqlite"),
            "price": [0.0, 40.0],
            "max_cost_usd": 0.03,
        }
        backend = Backend(
            decision=Component("evonav.decision.backends:vlm", {"model": "m", "request": {"max_tokens": 250}}, host)
        )
        config = RunConfig(backend=backend, protocol=ProtocolConfig(max_rounds=2))
        evaluate(["fu"], task_files(BUNDLED_TASKS, 2), tmp_path / "run", config=config, num_workers=2)
    (spent,) = Ledger(tmp_path / "ledger.sqlite").spending()
    assert spent.set_aside_usd == pytest.approx(0.0)
    assert spent.num_asked == len(stub.requests or []) <= 6
    assert 0.02 < spent.cost_usd <= 0.03


def test_questions_begin_no_faster_than_the_limits() -> None:
    now_s = [100.0]
    waits: list[float] = []

    def sleep(seconds: float) -> None:
        waits.append(seconds)
        now_s[0] += seconds

    pace = Pace(60.0, 6000.0, clock=lambda: now_s[0], sleep=sleep)
    pace.wait(50)  # its share: the greater of 1 s a request and 0.5 s of tokens
    pace.wait(300)  # 3 s of tokens
    pace.wait(0)
    assert waits == [1.0, 3.0]
    now_s[0] += 10.0
    pace.wait(0)
    assert waits == [1.0, 3.0]
    Pace().wait(10**9)
