"""What an agent is told of a task does not tell which one it is, so that it cannot generate the task again."""

import gzip
from collections import defaultdict

import pytest
from regenerating_agent import candidates, names_of, task_named
from short_tasks import short_tasks
from toy_run import SHORT, records, texts

import evonav
from evonav.evaluation.episode.spec import opaque_task_id
from evonav.evaluation.records.schema import EndState
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import NAMES_KEY, RunConfig
from evonav.report.pages.run_page import write_report
from evonav.submission.pack import pack
from evonav.tasks.listing import BUNDLED_TASKS

AGENT = "regenerating_agent:Regenerating"


def secret_of(folder):
    with RunStore(folder) as store:
        return store.meta(NAMES_KEY)


@pytest.mark.parametrize("name_of", [lambda task: task.task_id, lambda task: list(names_of(task.task_id))[2]])
def test_the_agent_finds_the_targets_where_the_name_tells_the_task(name_of):
    """Or the other tests would show nothing."""
    task = evonav.load_tasks("bundled")[3]
    found = task_named(name_of(task))
    numbers = range(1, task.num_stages + 1)
    assert [found.oracle(k).target for k in numbers] == [task.oracle(k).target for k in numbers]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The same evaluation twice: two agents on two stages, in processes of their own."""
    folders = [tmp_path_factory.mktemp("run") for _ in range(2)]
    tasks, reader = short_tasks(BUNDLED_TASKS, 2)
    config = RunConfig(backend=Backend(tasks=reader), protocol=SHORT.protocol)
    for folder in folders:
        evaluate([AGENT, "random-walk"], tasks, folder, config=config, num_workers=1)
    return folders


@pytest.mark.slow
def test_an_agent_in_its_own_process_finds_no_task_of_its_name(runs):
    known = {name for task_id in candidates() for name in names_of(task_id)}
    for folder in runs:
        found = records(folder, AGENT)
        assert found
        for record in found:
            assert record.stop_reason == "no task has this name"
            assert record.terminal == record.effective_start
            told = record.trace[0].choice
            assert told == opaque_task_id(secret_of(folder), record.task_id)
            assert told not in known
            assert record.task_id in set(candidates())  # the record keeps the true id


def test_every_run_has_other_names_and_the_same_records(runs):
    one, other = runs
    assert len(secret_of(one)) == 64
    assert secret_of(one) != secret_of(other)
    names = [[record.trace[0].choice for record in records(folder, AGENT)] for folder in runs]
    assert not {*names[0]} & {*names[1]}
    assert records(one, "random-walk") == records(other, "random-walk")


def test_nothing_that_is_shown_holds_the_secret(runs, tmp_path):
    secret = secret_of(runs[0]).encode()
    pages = write_report(runs[0]).parent
    packed = pack(runs[0], tmp_path / "run.gz", agents=[AGENT])
    assert packed
    assert secret not in gzip.decompress((tmp_path / "run.gz").read_bytes())
    files = [path for path in pages.rglob("*") if path.is_file() and not path.name.startswith("records.sqlite")]
    assert files
    assert not [path for path in files if secret in path.read_bytes()]


def test_a_resumed_run_keeps_its_names(tasks, tmp_path):
    evaluate([AGENT], tasks, tmp_path / "run", config=SHORT, num_workers=0)
    before, secret = texts(tmp_path / "run"), secret_of(tmp_path / "run")
    with RunStore(tmp_path / "run") as store:
        store.forget_episode(AGENT, "toy-moved", 2)
    evaluate([AGENT], tasks, tmp_path / "run", config=SHORT, num_workers=0)
    assert texts(tmp_path / "run") == before
    assert secret_of(tmp_path / "run") == secret
    names = defaultdict(set)
    for record in records(tmp_path / "run", AGENT):
        assert record.state is not EndState.ERRORED
        names[record.task_id].add(record.trace[0].choice)
    assert all(len(of_task) == 1 for of_task in names.values())
    assert len(set().union(*names.values())) == len(names) > 1


def test_tasks_come_in_the_order_of_their_secret_names(tasks, tmp_path):
    seen = []
    evaluate(["stay-still"], tasks, tmp_path / "run", config=SHORT, num_workers=0, on_progress=seen.append)
    order = list(dict.fromkeys(news.latest.task_id for news in seen if news.latest))
    secret = secret_of(tmp_path / "run")
    assert order == sorted((task.task_id for task in tasks), key=lambda name: opaque_task_id(secret, name))
