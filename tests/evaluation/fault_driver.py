"""A small run that is killed, or refused by its disk, at every call that changes its folder.

Run by `test_nothing_lost.py`, with `faults.c` loaded before all else; prints what came of it as JSON. Every attempt is
a fork of this process. What workers tell is canned, by one real run: it is the driver that is tried.
"""

import ctypes
import errno
import json
import os
import shutil
import traceback
from pathlib import Path

from toy_run import CONFIG

from evonav.errors import StoreError
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run import evaluate as engine
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.worker import EpisodeWork
from evonav.parallel import folders
from evonav.parallel.local import WorkerProgram
from evonav.tasks.listing import task_files

AGENT = "random-walk"
KILL, FAIL, FAIL_ALL = 1, 2, 3
REFUSED = 7
"""Exit code of a run that stopped with a `StoreError`."""

told = {}
"""By a job's text: what was told of it."""

library = ctypes.CDLL(os.environ["LD_PRELOAD"])
library.faults_arm.argtypes = [ctypes.c_char_p, ctypes.c_int, ctypes.c_long, ctypes.c_int]
library.faults_calls.restype = ctypes.c_long
library.faults_mark.argtypes = [ctypes.c_char_p]


class Canned(EpisodeWork):
    """Tells again what it told before."""

    def __call__(self, text):
        if text not in told:
            told[text] = list(super().__call__(text))
        yield from told[text]
        return "null"


engine.PROGRAM = WorkerProgram("fault_driver:Canned")


def arm(folder, mode=0, number=0, error=0):
    library.faults_arm(str(folder).encode(), mode, number, error)


def texts(run):
    with RunStore(run) as store:
        return list(store.record_texts())


def in_fork(function, *arguments):
    """Exit code, negative of a signal, and what the function gave."""
    reader, writer = os.pipe()
    pid = os.fork()
    if pid == 0:
        code = 9
        try:
            os.write(writer, json.dumps(function(*arguments)).encode())
            code = 0
        except StoreError as error:
            os.write(writer, json.dumps(str(error)).encode())
            code = REFUSED
        except BaseException:
            traceback.print_exc()
        os._exit(code)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        said = pipe.read()
    _, status = os.waitpid(pid, 0)
    return os.waitstatus_to_exitcode(status), json.loads(said) if said else None


class Driver:
    """Attempts at one run."""

    def __init__(self, root):
        self.root = root
        self.run = root / "run"
        self.tasks = task_files(root / "tasks", 1)
        self.done = root / "done"  # by what the driver was told before it was ended

    def evaluate(self, mode=0, number=0, error=0):
        arm(self.run, mode, number, error)
        with self.done.open("w", buffering=1) as done:
            evaluate(
                [AGENT],
                self.tasks,
                self.run,
                config=CONFIG,
                num_workers=0,
                on_progress=lambda news: news.latest and (done.write("x"), done.flush()),
            )
        return library.faults_calls()

    def attempt(self, mode, number, error):
        """A disturbed run, what of it can be read, and the run after it was gone on with."""
        shutil.rmtree(self.run, ignore_errors=True)
        code, said = in_fork(self.evaluate, mode, number, error)
        told = len(self.done.read_text())
        opens, kept = in_fork(texts, self.run) if (self.run / "records.sqlite").exists() else (0, [])
        again, problem = in_fork(self.evaluate)
        _, whole = in_fork(texts, self.run)
        return {
            "number": number,
            "code": code,
            "said": said,
            "told": told,
            "opens": opens,
            "kept": kept if opens == 0 else None,
            "why": kept if opens != 0 else None,
            "again": again,
            "problem": problem if again else None,
            "whole": whole,
        }


def main(how, root, journal, step):
    driver = Driver(Path(root))
    if journal == "DELETE":  # as on a network
        folders._NETWORK = {folders._mount_of(driver.root)[0]}
    driver.evaluate()
    whole = texts(driver.run)
    shutil.rmtree(driver.run)
    _, num_calls = in_fork(driver.evaluate)
    mode, error = {
        "kill": (KILL, 0),
        "full": (FAIL_ALL, errno.ENOSPC),
        "read-only": (FAIL_ALL, errno.EROFS),
        "broken": (FAIL, errno.EIO),
    }[how]
    attempts = [driver.attempt(mode, number, error) for number in range(1, num_calls + 1, int(step))]
    print(json.dumps({"whole": whole, "attempts": attempts}))


def log(root, path):
    """Runs once, and writes down all that changed the folder, with a mark where the driver was told of a stage."""
    driver = Driver(Path(root))
    with Path(path).open("wb") as file:
        library.faults_log(file.fileno())
        arm(driver.run)

        def mark(news):
            if news.latest:
                library.faults_mark(str(news.latest.stage).encode())

        evaluate([AGENT], driver.tasks, driver.run, config=CONFIG, num_workers=0, on_progress=mark)
        library.faults_log(-1)
    print(json.dumps(texts(driver.run)))
