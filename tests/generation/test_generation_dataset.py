"""Folders of tasks have the same bytes for any workers and any number of interruptions."""

import gzip
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import pytest

from evonav.errors import InvalidArgumentError, StoreError, TaskError
from evonav.generation import dataset
from evonav.generation.dataset import generate_dataset
from evonav.generation.worker import GenerationOptions
from evonav.house import House
from evonav.parallel.worker import Workforce
from evonav.tasks import load_task
from evonav.tasks.dataset import check_dataset, read_dataset
from evonav.tasks.parameters import GenerationParameters

OPTIONS = GenerationOptions(parameters=GenerationParameters(reference_image_px=64, reference_min_visible_px=4))
FAULTY = "faulty_generation_worker:make_worker"
MALFORMED, SINGLE = 2, 5
"""Indices of the houses without a task."""


def smallest(count):
    with gzip.open(str(files("evonav") / "data" / "houses.jsonl.gz"), "rt") as lines:
        return sorted(lines, key=len)[:count]


def write_houses(path, count):
    houses = smallest(count)
    single = json.loads(houses[0])
    single["rooms"] = single["rooms"][:1]
    kept = {wall["id"] for wall in single["walls"] if wall["roomId"] == single["rooms"][0]["id"]}
    single["walls"] = [wall for wall in single["walls"] if wall["id"] in kept]
    single |= {"doors": [], "windows": [], "objects": []}
    House(json.dumps(single), name="single")
    houses.insert(MALFORMED, '{"rooms": 3}\n')
    houses.insert(SINGLE, json.dumps(single) + "\n")
    path.write_text("".join(houses))
    return path


@pytest.fixture(scope="module")
def houses(tmp_path_factory):
    return write_houses(tmp_path_factory.mktemp("houses") / "small.jsonl", 8)


@pytest.fixture(scope="module")
def clean(houses, tmp_path_factory):
    """The folder of an uninterrupted run in one process."""
    out = tmp_path_factory.mktemp("clean")
    generate_dataset(houses, out, options=OPTIONS)
    return out


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def assert_same(folder, expected):
    there, here = contents(folder), contents(expected)
    assert there.keys() == here.keys()
    # The lock's file says who writes.
    assert [name for name in here if there[name] != here[name] and name != ".lock"] == []


def local(num_workers, **values):
    return Workforce(num_workers=num_workers, **values)


@pytest.fixture
def faults(monkeypatch):
    def set_faults(**by_index):
        monkeypatch.setattr(dataset, "WORK", FAULTY)
        monkeypatch.setenv("EVONAV_TEST_FAULTS", json.dumps({key.strip("_"): what for key, what in by_index.items()}))

    return set_faults


def test_what_a_run_leaves(houses, clean):
    record = read_dataset(clean)
    assert check_dataset(record, clean) == []
    assert record.num_houses == 10
    assert [(rejection.house, rejection.reason) for rejection in record.rejections] == [
        (f"small.jsonl:{MALFORMED + 1}", "malformed_house"),
        (f"small.jsonl:{SINGLE + 1}", "too_few_rooms"),
    ]
    names = {path.name for path in clean.iterdir()}
    assert names == {entry.task_id for entry in record.tasks} | {".lock", "dataset.json", "journal.jsonl"}
    for entry in record.tasks:
        assert load_task(clean / entry.task_id).header.parameters == OPTIONS.parameters


@pytest.mark.parametrize("num_workers", [1, 2, 4])
def test_the_same_for_any_number_of_workers(houses, clean, tmp_path, num_workers):
    generate_dataset(houses, tmp_path, options=OPTIONS, workforce=local(num_workers))
    assert_same(tmp_path, clean)


def test_limit_takes_the_first_houses_that_give_a_task(houses, clean, tmp_path):
    num_tasks = 5  # of seven houses
    summaries = [
        generate_dataset(houses, tmp_path / str(workers), options=OPTIONS, limit=num_tasks, workforce=local(workers))
        for workers in (0, 3)
    ]
    assert_same(tmp_path / "0", tmp_path / "3")
    every = [outcome["task_id"] for outcome in journal_of(clean) if "task_id" in outcome]
    assert [root.name for root in summaries[1].roots] == every[:num_tasks]
    assert summaries[1].num_houses == 7
    assert sum(1 for path in (tmp_path / "3").glob("*/task.json")) == num_tasks


def journal_of(folder):
    return [json.loads(line) for line in (folder / "journal.jsonl").read_text().splitlines()[1:]]


class InterruptError(Exception):
    """Stands for Ctrl-C."""


@pytest.mark.parametrize("num_workers", [0, 2])
def test_a_run_interrupted_after_every_house_ends_as_one_that_was_not(houses, clean, tmp_path, num_workers):
    for num_done in range(1, 10, 1 if num_workers == 0 else 4):

        def interrupt(news, num_done=num_done):
            if news.num_houses >= num_done:
                raise InterruptError

        with pytest.raises(InterruptError):
            generate_dataset(houses, tmp_path, options=OPTIONS, workforce=local(num_workers), on_progress=interrupt)
        assert not (tmp_path / "dataset.json").exists()
    summary = generate_dataset(houses, tmp_path, options=OPTIONS)
    assert_same(tmp_path, clean)
    assert summary.num_new < 8
    again = generate_dataset(houses, tmp_path, options=OPTIONS, workforce=local(0))
    assert (again.num_new, again.roots) == (0, summary.roots)


def test_progress_ends_at_the_whole(houses, tmp_path):
    news = []
    generate_dataset(houses, tmp_path, options=OPTIONS, workforce=local(2), on_progress=news.append)
    assert [one.num_houses for one in news] == list(range(11))
    assert (news[-1].num_tasks, news[-1].num_rejected, news[-1].num_failed) == (8, 2, 0)
    assert news[-1].share == 1.0
    assert all(earlier.share <= later.share for earlier, later in pairwise(news))


def other_houses(houses, tmp_path):
    path = tmp_path / houses.name
    path.write_text(houses.read_text() + "\n")
    return path


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"options": GenerationOptions(seed=1, parameters=OPTIONS.parameters)}, r"options.seed: there 0, asked 1"),
        ({"options": GenerationOptions()}, r"options.parameters.reference_image_px: there 64, asked 300"),
        ({"limit": 3}, r"limit: there None, asked 3"),
        ({"houses": other_houses}, r"houses.small.jsonl: there '[0-9a-f]{64}', asked '[0-9a-f]{64}'"),
    ],
)
def test_another_run_in_the_same_folder_is_refused(houses, clean, tmp_path, changes, words):
    before = contents(clean)
    changes = dict(changes)
    make_houses = changes.pop("houses", None)
    with pytest.raises(StoreError, match=words):
        generate_dataset(
            make_houses(houses, tmp_path) if make_houses else houses, clean, **{"options": OPTIONS, **changes}
        )
    assert contents(clean) == before


def test_tasks_of_another_origin_are_not_mixed_with(houses, clean, tmp_path):
    shutil.copytree(clean, tmp_path / "out")
    (tmp_path / "out" / "journal.jsonl").unlink()
    with pytest.raises(StoreError, match="this command did not make"):
        generate_dataset(houses, tmp_path / "out", options=OPTIONS)


def test_what_was_damaged_is_made_again(houses, clean, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(clean, out)
    first, second, *_ = sorted(path.parent for path in out.glob("*/task.json"))
    shutil.rmtree(first)
    (second / "task.json").write_text("{}")
    assert generate_dataset(houses, out, options=OPTIONS).num_new == 2
    assert_same(out, clean)


def test_a_journal_cut_anywhere_is_gone_on_with(houses, clean, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(clean, out)
    whole = (clean / "journal.jsonl").read_bytes()
    first = whole.index(b"\n") + 1
    for length in (first, first + 1, len(whole) // 2, len(whole) - 1):
        (out / "journal.jsonl").write_bytes(whole[:length])
        (out / "dataset.json").unlink()
        generate_dataset(houses, out, options=OPTIONS)
        assert_same(out, clean)


@pytest.mark.parametrize(
    ("number", "line", "words"),
    [
        (3, b'{"index": 1}\n', "journal.jsonl:3: not the record of a house"),
        (3, b"\xff\xfe\n", "journal.jsonl:3: not the record of a house"),
        (1, b"[]\n", "journal.jsonl:1: not the record of the run"),
    ],
)
def test_a_damaged_journal_is_told_by_line(houses, clean, tmp_path, number, line, words):
    out = tmp_path / "out"
    shutil.copytree(clean, out)
    lines = (clean / "journal.jsonl").read_bytes().splitlines(keepends=True)
    lines[number - 1] = line
    (out / "journal.jsonl").write_bytes(b"".join(lines))
    with pytest.raises(StoreError, match=words):
        generate_dataset(houses, out, options=OPTIONS)
    if number > 1:  # what the message advises
        (out / "journal.jsonl").write_bytes(b"".join(lines[: number - 1] + lines[number:]))
        generate_dataset(houses, out, options=OPTIONS)
        assert_same(out, clean)


def test_a_house_that_fails_costs_itself_alone(houses, clean, tmp_path, faults):
    faults(_0="raise", _3="die", _6="hang")
    summary = generate_dataset(houses, tmp_path, options=OPTIONS, workforce=local(2), house_timeout_s=4.0)
    assert summary.reasons == {
        "error": 1, "crash": 1, "timeout": 1, "malformed_house": 1, "too_few_rooms": 1
    }  # fmt: skip
    details = {rejection.reason: rejection.detail for rejection in read_dataset(tmp_path).rejections}
    assert details["crash"] == "the worker process died (exit code 7)"
    assert details["timeout"] == "not done within 4 s"
    assert "Traceback" in details["error"]
    assert details["error"].endswith("RuntimeError: a defect\n")
    assert len(summary.roots) == 5
    faults()
    again = generate_dataset(houses, tmp_path, options=OPTIONS, workforce=local(2))
    assert again.num_new == 0
    again = generate_dataset(houses, tmp_path, options=OPTIONS, retry_failed=True, workforce=local(2))
    assert again.num_new == 3
    assert_same(tmp_path, clean)


def test_a_worker_that_dies_once_costs_nothing(houses, clean, tmp_path, faults):
    faults(_0=f"die once {tmp_path / 'flag 0'}", _7=f"die once {tmp_path / 'flag 7'}")
    generate_dataset(houses, tmp_path / "out", options=OPTIONS, workforce=local(2))
    assert (tmp_path / "flag 7").exists()
    assert_same(tmp_path / "out", clean)


def test_houses_that_give_no_task_are_an_error_that_says_why(tmp_path):
    (tmp_path / "none.jsonl").write_text('{"rooms": 3}\n{}\n')
    with pytest.raises(TaskError, match=r"none.jsonl: no house gives a task \(2 malformed_house\); the first: .*:1"):
        generate_dataset(tmp_path / "none.jsonl", tmp_path / "out", options=OPTIONS)
    with pytest.raises(InvalidArgumentError, match="limit"):
        generate_dataset(tmp_path / "none.jsonl", tmp_path / "out", options=OPTIONS, limit=0)


def test_a_folder_of_houses(houses, clean, tmp_path):
    lines = houses.read_text().splitlines(keepends=True)
    source = tmp_path / "houses"
    source.mkdir()
    with gzip.open(source / "a.jsonl.gz", "wt") as file:
        file.write("".join(lines[:2]))
    (source / "b.json").write_text("[" + ",".join(lines[3:5]) + "]")
    out = tmp_path / "out"
    generate_dataset(source, out, options=OPTIONS, workforce=local(2))
    record = read_dataset(out)
    assert [file.name for file in record.sources] == ["a.jsonl.gz", "b.json"]
    assert {entry.house_sha256 for entry in record.tasks} <= {entry.house_sha256 for entry in read_dataset(clean).tasks}
    assert record.num_tasks == 4


# The command.


def command(houses, out, *more):
    config = houses.parent / "theta.toml"
    config.write_text("reference_image_px = 64\nreference_min_visible_px = 4\n")
    arguments = ("generate", "--houses", houses, "--out", out, "--config", config, *more)
    return [sys.executable, "-m", "evonav", *map(str, arguments)]


def num_lines(out):
    try:
        return (out / "journal.jsonl").read_bytes().count(b"\n")
    except FileNotFoundError:
        return 0


def wait_for_lines(process, out, count):
    deadline_s = time.monotonic() + 60.0
    while num_lines(out) < count and process.poll() is None:
        assert time.monotonic() < deadline_s
        time.sleep(0.002)


def children_of(pid):
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
            if int(fields[1]) == pid and b"spawn_main" in (path.parent / "cmdline").read_bytes():
                found.append(int(path.parent.name))
        except (FileNotFoundError, ProcessLookupError):
            continue
    return found


@pytest.fixture(scope="module")
def many_houses(tmp_path_factory):
    return write_houses(tmp_path_factory.mktemp("many") / "small.jsonl", 50)


@pytest.fixture(scope="module")
def many_clean(many_houses, tmp_path_factory):
    out = tmp_path_factory.mktemp("many-clean")
    generate_dataset(many_houses, out, options=OPTIONS)
    return out


@pytest.mark.slow
def test_killed_a_dozen_times_it_ends_as_if_it_was_not(many_houses, many_clean, tmp_path):
    # A run that ends before it can be killed is compared, and the kills go on in a new folder.
    draws, num_kills = random.Random(0), 0
    for attempt in range(12):
        out, ended = tmp_path / str(attempt), False
        while not ended:
            process = subprocess.Popen(
                command(many_houses, out, "--workers", 2), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            if num_kills < 12:
                wait_for_lines(process, out, num_lines(out) + draws.choice([1, 1, 2, 3, 5]))
                time.sleep(draws.uniform(0.0, 0.03))
                process.send_signal(signal.SIGKILL)
            ended = process.wait() == 0
            num_kills += not ended
            for root in out.glob("*/task.json"):
                load_task(root.parent)  # whole, or not there
        assert_same(out, many_clean)
        if num_kills >= 12:
            return
    pytest.fail(f"only {num_kills} runs could be killed before they ended")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to find the workers")
def test_workers_killed_a_dozen_times_cost_nothing(many_houses, many_clean, tmp_path):
    draws, num_kills = random.Random(1), 0
    for attempt in range(4):
        out = tmp_path / str(attempt)
        process = subprocess.Popen(command(many_houses, out, "--workers", 3), stdout=subprocess.DEVNULL)
        while process.poll() is None:
            wait_for_lines(process, out, num_lines(out) + 3)
            workers = children_of(process.pid)
            if workers and num_kills < 10:
                os.kill(draws.choice(workers), signal.SIGKILL)
                num_kills += 1
        assert process.returncode == 0
        assert_same(out, many_clean)
        if num_kills >= 10:
            return
    pytest.fail(f"only {num_kills} workers were found to be killed")


@pytest.mark.parametrize("signal_", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_says_how_to_go_on(many_houses, tmp_path, signal_):
    out = tmp_path / "out"
    process = subprocess.Popen(command(many_houses, out, "--workers", 1), stderr=subprocess.PIPE, text=True)
    wait_for_lines(process, out, 3)
    process.send_signal(signal_)
    _, stderr = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "run the same command again to resume" in stderr
    assert "Traceback" not in stderr
    assert num_lines(out) >= 3


@pytest.mark.parametrize("most_bytes", [100, 6_000])
def test_a_full_disk_is_one_clear_error_and_loses_nothing(houses, clean, tmp_path, most_bytes):
    def fill():  # no file may be longer
        resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))

    out = tmp_path / "out"
    arguments = command(houses, out, "--workers", 2)
    done = subprocess.run(arguments, capture_output=True, text=True, preexec_fn=fill)
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert "File too large" in done.stderr
    assert done.stderr.count("\n") == 1
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert_same(out, clean)


def test_a_folder_that_cannot_be_written_is_one_clear_error(houses, tmp_path):
    (tmp_path / "file").write_text("")
    done = subprocess.run(command(houses, tmp_path / "file" / "out"), capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert "Not a directory" in done.stderr
    assert done.stderr.count("\n") == 1


def test_the_command_tells_what_it_did(houses, tmp_path):
    done = subprocess.run(command(houses, tmp_path / "out", "--workers", 0), capture_output=True, text=True, check=True)
    assert "8 tasks in" in done.stdout
    assert "from 10 houses; 8 new in" in done.stdout
    assert "1 houses without a task: too_few_rooms" in done.stdout
    done = subprocess.run(command(houses, tmp_path / "out", "--seed", 1), capture_output=True, text=True)
    assert done.returncode == 1
    assert "options.seed: there 0, asked 1" in done.stderr


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # Ray's own
def test_ray_makes_the_same(houses, clean, tmp_path, monkeypatch, faults):
    pytest.importorskip("ray")
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setenv("RAY_TMPDIR", "/tmp")  # paths of sockets have a greatest length
    faults(_0=f"die once {tmp_path / 'flag'}")
    generate_dataset(houses, tmp_path / "out", options=OPTIONS, workforce=local(2, engine="ray"))
    assert (tmp_path / "flag").exists()
    assert_same(tmp_path / "out", clean)
    faults(_1="hang", _4="raise", _7="die")
    workforce = local(2, engine="ray")
    summary = generate_dataset(houses, tmp_path / "faulty", options=OPTIONS, workforce=workforce, house_timeout_s=8.0)
    assert summary.reasons == {
        "timeout": 1, "error": 1, "crash": 1, "malformed_house": 1, "too_few_rooms": 1
    }  # fmt: skip


def resident_mb():
    fields = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return int(fields["VmRSS"].split()[0]) / 1024.0


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
def test_memory_is_flat(many_houses, tmp_path):
    """300 tasks in this process take no more memory than 100."""
    resident = []
    for seed in range(6):
        options = GenerationOptions(seed=seed, parameters=OPTIONS.parameters)
        generate_dataset(many_houses, tmp_path / str(seed), options=options)
        resident.append(resident_mb())
    assert resident[-1] - resident[1] < 8.0, resident


def test_houses_are_read_as_they_are_needed(tmp_path, clean, houses):
    """The parent holds a few lines, not the file: a source without an end is no obstacle to a limit."""
    fifo = tmp_path / "endless.jsonl"
    lines = houses.read_text().splitlines(keepends=True)[:2]
    fifo.write_text("".join(lines * 2000))
    began_s = time.monotonic()
    summary = generate_dataset(fifo, tmp_path / "out", options=OPTIONS, limit=2, workforce=local(1))
    assert summary.num_houses == 2
    assert time.monotonic() - began_s < 30.0
