"""Folders of tasks have the same bytes for any workers and any number of interruptions."""

import gzip
import json
import shutil
import time
from itertools import pairwise
from pathlib import Path

import pytest
from generated_folder import MALFORMED, OPTIONS, SINGLE, assert_same, contents

from evonav.errors import InvalidArgumentError, StoreError, TaskError
from evonav.generation import dataset
from evonav.generation.dataset import generate_dataset
from evonav.generation.worker import GenerationOptions
from evonav.parallel.worker import Workforce
from evonav.tasks import load_task
from evonav.tasks.dataset import check_dataset, read_dataset

FAULTY = "faulty_generation_worker:make_worker"


def local(num_workers, **values):
    return Workforce(num_workers=num_workers, **values)


@pytest.fixture
def faults(monkeypatch):
    def set_faults(**by_index):
        monkeypatch.setattr(dataset, "WORK", FAULTY)
        monkeypatch.setenv("EVONAV_TEST_FAULTS", json.dumps({key.strip("_"): what for key, what in by_index.items()}))

    return set_faults


def test_what_a_run_leaves(house_file, clean_folder):
    record = read_dataset(clean_folder)
    assert check_dataset(record, clean_folder) == []
    assert record.num_houses == 10
    assert [(rejection.house, rejection.reason) for rejection in record.rejections] == [
        (f"small.jsonl:{MALFORMED + 1}", "malformed_house"),
        (f"small.jsonl:{SINGLE + 1}", "too_few_rooms"),
    ]
    names = {path.name for path in clean_folder.iterdir()}
    assert names == {entry.task_id for entry in record.tasks} | {".lock", "dataset.json", "journal.jsonl"}
    for entry in record.tasks:
        assert load_task(clean_folder / entry.task_id).header.parameters == OPTIONS.parameters


@pytest.mark.slow
@pytest.mark.parametrize("num_workers", [1, 2, 4])
def test_the_same_for_any_number_of_workers(house_file, clean_folder, tmp_path, num_workers):
    generate_dataset(house_file, tmp_path, options=OPTIONS, workforce=local(num_workers))
    assert_same(tmp_path, clean_folder)


def test_limit_takes_the_first_houses_that_give_a_task(house_file, clean_folder, tmp_path):
    num_tasks = 5  # of seven houses
    summaries = [
        generate_dataset(
            house_file, tmp_path / str(workers), options=OPTIONS, limit=num_tasks, workforce=local(workers)
        )
        for workers in (0, 3)
    ]
    assert_same(tmp_path / "0", tmp_path / "3")
    every = [outcome["task"]["task_id"] for outcome in journal_of(clean_folder) if "task" in outcome]
    assert [root.name for root in summaries[1].roots] == every[:num_tasks]
    assert summaries[1].num_houses == 7
    assert sum(1 for path in (tmp_path / "3").glob("*/task.json")) == num_tasks


def journal_of(folder):
    return [json.loads(line) for line in (folder / "journal.jsonl").read_text().splitlines()[1:]]


class InterruptError(Exception):
    """Stands for Ctrl-C."""


@pytest.mark.slow
@pytest.mark.parametrize("num_workers", [0, 2])
def test_a_run_interrupted_after_every_house_ends_as_one_that_was_not(house_file, clean_folder, tmp_path, num_workers):
    for num_done in range(1, 10, 1 if num_workers == 0 else 4):

        def interrupt(news, num_done=num_done):
            if news.num_houses >= num_done:
                raise InterruptError

        with pytest.raises(InterruptError):
            generate_dataset(house_file, tmp_path, options=OPTIONS, workforce=local(num_workers), on_progress=interrupt)
        assert not (tmp_path / "dataset.json").exists()
    summary = generate_dataset(house_file, tmp_path, options=OPTIONS)
    assert_same(tmp_path, clean_folder)
    assert summary.num_new < 8
    again = generate_dataset(house_file, tmp_path, options=OPTIONS, workforce=local(0))
    assert (again.num_new, again.roots) == (0, summary.roots)


def test_progress_ends_at_the_whole(house_file, tmp_path):
    news = []
    generate_dataset(house_file, tmp_path, options=OPTIONS, on_progress=news.append)
    assert [one.num_houses for one in news] == list(range(11))
    assert (news[-1].num_tasks, news[-1].num_rejected, news[-1].num_failed) == (8, 2, 0)
    assert news[-1].share == 1.0
    assert all(earlier.share <= later.share for earlier, later in pairwise(news))


def other_houses(house_file, tmp_path):
    path = tmp_path / house_file.name
    path.write_text(house_file.read_text() + "\n")
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
def test_another_run_in_the_same_folder_is_refused(house_file, clean_folder, tmp_path, changes, words):
    before = contents(clean_folder)
    changes = dict(changes)
    make_houses = changes.pop("houses", None)
    with pytest.raises(StoreError, match=words):
        generate_dataset(
            make_houses(house_file, tmp_path) if make_houses else house_file,
            clean_folder,
            **{"options": OPTIONS, **changes},
        )
    assert contents(clean_folder) == before


def test_tasks_of_another_origin_are_not_mixed_with(house_file, clean_folder, tmp_path):
    shutil.copytree(clean_folder, tmp_path / "out")
    (tmp_path / "out" / "journal.jsonl").unlink()
    with pytest.raises(StoreError, match="this command did not make"):
        generate_dataset(house_file, tmp_path / "out", options=OPTIONS)


def test_what_was_damaged_is_made_again(house_file, clean_folder, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(clean_folder, out)
    first, second, *_ = sorted(path.parent for path in out.glob("*/task.json"))
    shutil.rmtree(first)
    (second / "task.json").write_text("{}")
    assert generate_dataset(house_file, out, options=OPTIONS).num_new == 2
    assert_same(out, clean_folder)


def test_a_journal_cut_anywhere_is_gone_on_with(house_file, clean_folder, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(clean_folder, out)
    whole = (clean_folder / "journal.jsonl").read_bytes()
    first = whole.index(b"\n") + 1
    for length in (first, first + 1, len(whole) // 2, len(whole) - 1):
        (out / "journal.jsonl").write_bytes(whole[:length])
        (out / "dataset.json").unlink()
        generate_dataset(house_file, out, options=OPTIONS)
        assert_same(out, clean_folder)


@pytest.mark.parametrize(
    ("number", "line", "words"),
    [
        (3, b'{"index": 1}\n', "journal.jsonl:3: not the record of a house"),
        (3, b"\xff\xfe\n", "journal.jsonl:3: not the record of a house"),
        (1, b"[]\n", "journal.jsonl:1: not the record of the run"),
    ],
)
def test_a_damaged_journal_is_told_by_line(house_file, clean_folder, tmp_path, number, line, words):
    out = tmp_path / "out"
    shutil.copytree(clean_folder, out)
    lines = (clean_folder / "journal.jsonl").read_bytes().splitlines(keepends=True)
    lines[number - 1] = line
    (out / "journal.jsonl").write_bytes(b"".join(lines))
    with pytest.raises(StoreError, match=words):
        generate_dataset(house_file, out, options=OPTIONS)
    if number > 1:  # what the message advises
        (out / "journal.jsonl").write_bytes(b"".join(lines[: number - 1] + lines[number:]))
        generate_dataset(house_file, out, options=OPTIONS)
        assert_same(out, clean_folder)


@pytest.mark.slow
def test_a_house_that_fails_costs_itself_alone(house_file, clean_folder, tmp_path, faults):
    faults(_0="raise", _3="die", _6="hang")
    summary = generate_dataset(house_file, tmp_path, options=OPTIONS, workforce=local(2), house_timeout_s=4.0)
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
    again = generate_dataset(house_file, tmp_path, options=OPTIONS, workforce=local(2))
    assert again.num_new == 0
    again = generate_dataset(house_file, tmp_path, options=OPTIONS, retry_failed=True, workforce=local(2))
    assert again.num_new == 3
    assert_same(tmp_path, clean_folder)


def test_a_worker_that_dies_once_costs_nothing(house_file, clean_folder, tmp_path, faults):
    faults(_0=f"die once {tmp_path / 'flag 0'}", _7=f"die once {tmp_path / 'flag 7'}")
    generate_dataset(house_file, tmp_path / "out", options=OPTIONS, workforce=local(2))
    assert (tmp_path / "flag 7").exists()
    assert_same(tmp_path / "out", clean_folder)


def test_houses_that_give_no_task_are_an_error_that_says_why(tmp_path):
    (tmp_path / "none.jsonl").write_text('{"rooms": 3}\n{}\n')
    with pytest.raises(TaskError, match=r"none.jsonl: no house gives a task \(2 malformed_house\); the first: .*:1"):
        generate_dataset(tmp_path / "none.jsonl", tmp_path / "out", options=OPTIONS)
    with pytest.raises(InvalidArgumentError, match="limit"):
        generate_dataset(tmp_path / "none.jsonl", tmp_path / "out", options=OPTIONS, limit=0)


def test_a_folder_of_houses(house_file, clean_folder, tmp_path):
    lines = house_file.read_text().splitlines(keepends=True)
    source = tmp_path / "houses"
    source.mkdir()
    with gzip.open(source / "a.jsonl.gz", "wt") as file:
        file.write("".join(lines[:2]))
    (source / "b.json").write_text("[" + ",".join(lines[3:5]) + "]")
    out = tmp_path / "out"
    generate_dataset(source, out, options=OPTIONS, workforce=local(2))
    record = read_dataset(out)
    assert [file.name for file in record.sources] == ["a.jsonl.gz", "b.json"]
    assert {entry.house_sha256 for entry in record.tasks} <= {
        entry.house_sha256 for entry in read_dataset(clean_folder).tasks
    }
    assert record.num_tasks == 4


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # Ray's own
def test_ray_makes_the_same(house_file, clean_folder, tmp_path, monkeypatch, faults):
    pytest.importorskip("ray")
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setenv("RAY_TMPDIR", "/tmp")  # paths of sockets have a greatest length
    faults(_0=f"die once {tmp_path / 'flag'}", _1="hang", _4="raise", _7="die")
    out, workforce = tmp_path / "out", local(2, engine="ray")
    summary = generate_dataset(house_file, out, options=OPTIONS, workforce=workforce, house_timeout_s=40.0)
    assert (tmp_path / "flag").exists()
    assert summary.reasons == {
        "timeout": 1, "error": 1, "crash": 1, "malformed_house": 1, "too_few_rooms": 1
    }  # fmt: skip
    faults()
    assert generate_dataset(house_file, out, options=OPTIONS, retry_failed=True).num_new == 3
    assert_same(out, clean_folder)


def resident_mb():
    fields = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return int(fields["VmRSS"].split()[0]) / 1024.0


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
def test_memory_is_flat(large_house_file, tmp_path):
    """300 tasks in this process take no more memory than 100."""
    resident = []
    for seed in range(6):
        options = GenerationOptions(seed=seed, parameters=OPTIONS.parameters)
        generate_dataset(large_house_file, tmp_path / str(seed), options=options)
        resident.append(resident_mb())
    assert resident[-1] - resident[1] < 8.0, resident


def test_houses_are_read_as_they_are_needed(tmp_path, clean_folder, house_file):
    """The parent holds a few lines, not the file: a source without an end is no obstacle to a limit."""
    fifo = tmp_path / "endless.jsonl"
    lines = house_file.read_text().splitlines(keepends=True)[:2]
    fifo.write_text("".join(lines * 2000))
    began_s = time.monotonic()
    summary = generate_dataset(fifo, tmp_path / "out", options=OPTIONS, limit=2, workforce=local(1))
    assert summary.num_houses == 2
    assert time.monotonic() - began_s < 30.0
