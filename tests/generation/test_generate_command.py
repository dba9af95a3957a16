"""`evonav generate` says what it did, and survives kills, interrupts and full disks."""

import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from generated_folder import OPTIONS, assert_same, write_houses
from processes import children

from evonav.generation.dataset import generate_dataset
from evonav.parallel.local import PROCESS_NAME
from evonav.parallel.pool import MAX_LOSSES
from evonav.tasks import load_task


def command(house_file, out, *more):
    config = house_file.parent / "theta.toml"
    config.write_text("reference_image_px = 64\nreference_min_visible_px = 4\n")
    arguments = ("tasks", "generate", "--houses", house_file, "--out", out, "--config", config, *more)
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


def workers_of(pid):
    return [child for child, line in children(pid).items() if PROCESS_NAME in line]


@pytest.fixture(scope="module")
def more_houses(tmp_path_factory):
    """24 small houses, of which two give no task: time enough to kill what makes them."""
    return write_houses(tmp_path_factory.mktemp("more") / "small.jsonl", 22)


@pytest.fixture(scope="module")
def more_tasks(more_houses, tmp_path_factory):
    out = tmp_path_factory.mktemp("more-clean")
    generate_dataset(more_houses, out, options=OPTIONS)
    return out


@pytest.mark.slow
def test_killed_six_times_it_ends_as_if_it_was_not(more_houses, more_tasks, tmp_path):
    # A run that ends before it can be killed is compared, and the kills go on in a new folder.
    draws, num_kills = random.Random(0), 0
    for attempt in range(6):
        out, ended = tmp_path / str(attempt), False
        while not ended:
            process = subprocess.Popen(
                command(more_houses, out, "--workers", 2), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            if num_kills < 6:
                wait_for_lines(process, out, num_lines(out) + draws.choice([1, 1, 2, 3, 5]))
                time.sleep(draws.uniform(0.0, 0.03))
                process.send_signal(signal.SIGKILL)
            ended = process.wait() == 0
            num_kills += not ended
            for root in out.glob("*/task.json"):
                load_task(root.parent)  # whole, or not there
        assert_same(out, more_tasks)
        if num_kills >= 6:
            return
    pytest.fail(f"only {num_kills} runs could be killed before they ended")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to find the workers")
def test_workers_killed_four_times_cost_nothing(more_houses, more_tasks, tmp_path):
    draws, num_kills = random.Random(1), 0
    for attempt in range(4):
        out, num_left = tmp_path / str(attempt), MAX_LOSSES  # of more, one house may lose all, and is then given up
        process = subprocess.Popen(command(more_houses, out, "--workers", 3), stdout=subprocess.DEVNULL)
        while process.poll() is None:
            wait_for_lines(process, out, num_lines(out) + 3)
            workers = workers_of(process.pid)
            if workers and num_left:
                os.kill(draws.choice(workers), signal.SIGKILL)
                num_left -= 1
        assert process.returncode == 0
        assert_same(out, more_tasks)
        num_kills += MAX_LOSSES - num_left
        if num_kills >= 4:
            return
    pytest.fail(f"only {num_kills} workers were found to be killed")


@pytest.mark.parametrize("signal_", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_says_how_to_go_on(more_houses, tmp_path, signal_):
    out = tmp_path / "out"
    process = subprocess.Popen(command(more_houses, out, "--workers", 1), stderr=subprocess.PIPE, text=True)
    wait_for_lines(process, out, 3)
    process.send_signal(signal_)
    _, stderr = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "run the same command again to resume" in stderr
    assert "Traceback" not in stderr
    assert num_lines(out) >= 3


@pytest.mark.slow
@pytest.mark.parametrize("most_bytes", [100, 6_000])
def test_a_full_disk_is_one_clear_error_and_loses_nothing(house_file, clean_folder, tmp_path, most_bytes):
    def fill():  # no file may be longer
        resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))

    out = tmp_path / "out"
    arguments = command(house_file, out, "--workers", 2)
    done = subprocess.run(arguments, capture_output=True, text=True, preexec_fn=fill)
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert "File too large" in done.stderr
    assert done.stderr.count("\n") == 1
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert_same(out, clean_folder)


def test_a_folder_that_cannot_be_written_is_one_clear_error(house_file, tmp_path):
    (tmp_path / "file").write_text("")
    done = subprocess.run(command(house_file, tmp_path / "file" / "out"), capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert "Not a directory" in done.stderr
    assert done.stderr.count("\n") == 1


def test_the_command_tells_what_it_did(house_file, tmp_path):
    done = subprocess.run(
        command(house_file, tmp_path / "out", "--workers", 0), capture_output=True, text=True, check=True
    )
    assert "8 tasks in" in done.stdout
    assert "from 10 houses; 8 new in" in done.stdout
    assert "1 house without a task: too_few_rooms" in done.stdout
    done = subprocess.run(command(house_file, tmp_path / "out", "--seed", 1), capture_output=True, text=True)
    assert done.returncode == 1
    assert "options.seed: there 0, asked 1" in done.stderr
