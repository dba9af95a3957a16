"""Pools of workers: every job has one answer, whatever becomes of the workers."""

import sys
from contextlib import closing

import pytest

from evonav.errors import InvalidArgumentError
from evonav.parallel import pool as parallel
from evonav.parallel.pool import Job, WorkerPool, open_pool
from evonav.parallel.worker import EngineError, Message, WorkerLostError, Workforce


def make_echo(settings, alive):
    """A worker that answers with its settings and the job."""

    def echo(text):
        if text == "raise":
            raise ValueError(text)
        return f"{settings} {text}"

    return echo


def make_nothing(settings, alive):
    """A worker that does not start."""
    raise SystemExit(3)


def answers_of(pool, texts):
    jobs, answers, num_open = list(enumerate(texts)), {}, 0
    while jobs or num_open:
        while jobs and num_open < pool.capacity:
            pool.submit(Job(*jobs.pop(0)))
            num_open += 1
        answer = pool.next_answer()
        assert answer.key not in answers
        answers[answer.key] = answer
        num_open -= 1
    return answers


@pytest.mark.parametrize("num_workers", [0, 2])
def test_every_job_has_its_answer(num_workers):
    texts = [*map(str, range(20)), "raise", "ü" * 100_000]
    with open_pool("test_parallel:make_echo", "ä", Workforce(num_workers), timeout_s=60.0) as pool:
        answers = answers_of(pool, texts)
    assert len(answers) == len(texts)
    for key, text in enumerate(texts):
        if text == "raise":
            assert answers[key].failure == "error"
            assert answers[key].detail.endswith("ValueError: raise\n")
        else:
            assert (answers[key].failure, answers[key].text) == (None, f"ä {text}")


def test_workers_that_never_start_are_an_error(monkeypatch):
    monkeypatch.setattr(parallel, "MAX_FAILED_STARTS", 2)
    with open_pool("test_parallel:make_nothing", "", Workforce(1), timeout_s=60.0) as pool:
        pool.submit(Job(0, ""))
        with pytest.raises(EngineError, match=r"workers do not start: the worker process died \(exit code 3\)"):
            pool.next_answer()


class ScriptedWorker:
    """Says what it is told to, and then is lost."""

    def __init__(self, *said):
        self.said = list(said)

    def send(self, key, text):
        pass

    def receive(self):
        if not self.said:
            raise WorkerLostError("gone")
        return self.said.pop(0)

    def close(self):
        pass


class ScriptedHost:
    """Starts the worker it is given, then ones that are never ready; hears these whenever there are any."""

    def __init__(self, first):
        self.first, self.num_started = first, 0

    def start(self):
        self.num_started += 1
        return self.first if self.num_started == 1 else ScriptedWorker()

    def wait(self, workers, timeout_s):
        new = [worker for worker in workers if worker is not self.first]
        is_starting = self.first.said[:1] == [Message("ready")]
        return [self.first] if is_starting or not new else new[:1]

    def close(self):
        pass


def test_one_worker_goes_on_alone_where_no_others_start():
    texts = [str(i) for i in range(6)]
    host = ScriptedHost(ScriptedWorker(Message("ready"), *(Message("done", int(text), text) for text in texts)))
    with closing(WorkerPool(host, 3, 60.0, 2)) as pool:
        answers = answers_of(pool, texts)
    assert sorted(answer.text for answer in answers.values()) == texts
    # Each job that is done gives the others a few more chances, not endless ones.
    assert parallel.MAX_FAILED_STARTS < host.num_started <= 1 + (len(texts) + 1) * (parallel.MAX_FAILED_STARTS + 2)


def test_it_is_an_error_once_that_worker_is_lost_too():
    host = ScriptedHost(ScriptedWorker(Message("ready"), Message("done", 0, "0")))
    with closing(WorkerPool(host, 3, 60.0, 2)) as pool, pytest.raises(EngineError, match="workers do not start: gone"):
        answers_of(pool, ["0", "1", "2", "3"])


def test_arguments_are_checked():
    with pytest.raises(InvalidArgumentError, match="num_workers = -1"):
        Workforce(-1)
    with pytest.raises(InvalidArgumentError, match="num_workers = 0: too few for engine ray"):
        Workforce(0, "ray")
    with pytest.raises(InvalidArgumentError, match="Ray address"):
        Workforce(1, ray_address="localhost:1")
    with pytest.raises(InvalidArgumentError, match=r"num_gpus = -1\.0"):
        Workforce(1, "ray", num_gpus=-1.0)


def test_without_ray_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    pool = open_pool("test_parallel:make_echo", "", Workforce(1, "ray"), timeout_s=1.0)
    with pytest.raises(EngineError, match=r"pip install 'evonav\[ray\]'"), pool:
        raise AssertionError("it was opened")


def make_broken(settings, alive):
    """A worker that cannot be made."""
    raise ImportError("no such thing")


def make_teller(settings, alive):
    """A worker that counts to a job, telling."""

    def count(text):
        for number in range(int(text)):
            alive()
            yield str(number)
        if text == "3":
            raise ValueError(text)
        return "end"

    return count


def test_a_worker_that_cannot_be_made_is_an_error_at_once():
    with open_pool("test_parallel:make_broken", "", Workforce(1), timeout_s=60.0) as pool:
        pool.submit(Job(0, ""))
        with pytest.raises(EngineError, match="workers do not start: ImportError: no such thing"):
            pool.next_answer()


@pytest.mark.parametrize("num_workers", [0, 1])
def test_jobs_tell_news_in_order(num_workers):
    with open_pool("test_parallel:make_teller", "", Workforce(num_workers), timeout_s=60.0) as pool:
        for key, num, end in ((0, 2, "end"), (1, 3, "")):
            pool.submit(Job(key, str(num)))
            answers = [pool.next_answer() for _ in range(num + 1)]
            assert [answer.text for answer in answers] == [*map(str, range(num)), end]
            assert [answer.is_end for answer in answers] == [False] * num + [True]
            assert (answers[-1].failure is None) == (end == "end")
