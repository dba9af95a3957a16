"""A finished stage stays, whatever becomes of processes, disk and power."""

import json
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from chaos import disturb, num_recorded, texts
from power_loss import Disk, read_log
from processes import children
from toy_house import write_tasks
from toy_run import CHEAP, CONFIG, HERE_ALONE, driver_command, driver_environment, many_tasks
from typer.testing import CliRunner

from evonav.cli import app
from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.parallel import folders
from evonav.parallel.folders import replacing, write_atomically, writing
from evonav.parallel.local import PROCESS_NAME
from evonav.tasks.listing import task_files

HERE = Path(__file__).parents[1]
ONE_THREAD = dict.fromkeys(("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


def compiled(name, folder):
    """Return a library to be loaded before all else."""
    compiler = shutil.which("cc")
    if compiler is None or sys.platform != "linux":
        pytest.skip("needs a C compiler and Linux")
    library = folder / f"{name}.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, HERE / name, "-ldl"], check=True)
    return library


@pytest.fixture(scope="module")
def faults(tmp_path_factory):
    """Runs a function of `fault_driver.py` with the library that makes faults."""
    library = compiled("faults.c", tmp_path_factory.mktemp("faults"))

    def run(call):
        done = subprocess.run(
            [sys.executable, "-c", f"import fault_driver; fault_driver.{call}"],
            env=driver_environment(**ONE_THREAD, LD_PRELOAD=str(library)),
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "journal", "step"),
    [
        ("kill", "WAL", 9),
        ("kill", "DELETE", 20),
        ("full", "WAL", 12),
        ("full", "DELETE", 30),
        ("read-only", "WAL", 25),
        ("broken", "WAL", 13),
    ],
)
def test_nothing_is_lost_at_any_call_that_changes_the_folder(faults, tmp_path, how, journal, step):
    """Killed at it, or refused by a disk that is full or read-only from then on, or once by one that is broken.

    At one call in `step`, or at every one with EVERY_FAULT set.
    """
    step = 1 if "EVERY_FAULT" in os.environ else step
    write_tasks(tmp_path / "tasks")
    said = faults(f"main({how!r}, {str(tmp_path)!r}, {journal!r}, {step})")
    whole, attempts = said["whole"], said["attempts"]
    assert len(whole) == 3
    assert len(attempts) * step > 100, len(attempts)
    for one in attempts:
        if how == "kill":
            assert one["code"] == -9, one
        elif one["code"] != 0:  # of some calls a failure costs nothing
            assert one["code"] == 7, one
            assert str(tmp_path) in one["said"]
        if one["told"]:
            assert one["opens"] == 0, one
        kept = one["kept"] or []
        assert kept == whole[: len(kept)], one["number"]
        assert len(kept) >= one["told"], one["number"]  # what the driver has said is finished is there
        assert (one["again"], one["whole"]) == (0, whole), one
    if how in ("full", "read-only"):  # what still comes when all is written needs no room
        assert all(one["code"] == 7 or one["number"] > attempts[-1]["number"] - 10 for one in attempts)
    assert max(one["told"] for one in attempts) >= 2


@pytest.mark.slow
def test_a_loss_of_power_loses_no_stage(faults, tmp_path):
    """After every change of the folder, with all that was not synced lost, or a random half of it."""
    write_tasks(tmp_path / "tasks")
    whole = faults(f"log({str(tmp_path)!r}, {str(tmp_path / 'log')!r})")
    disk, num_told, num_cuts = Disk(str(tmp_path / "run")), 0, 0
    draw = random.Random(0)
    for op, path, offset, data in read_log(tmp_path / "log"):
        if op == "mark":
            num_told = int(path)
            continue
        disk.do(op, path, offset, data)
        for chance in (None, draw):
            num_cuts += 1
            after = tmp_path / "after" / "run"
            shutil.rmtree(after, ignore_errors=True)
            after.mkdir(parents=True)
            disk.leave(after, chance)
            try:
                kept = texts_of_stages(after)
            except StoreError:
                assert num_told == 0
                kept = []
            assert kept == whole[: len(kept)]
            assert len(kept) >= num_told, (num_cuts, op, path)
            if num_cuts % 60 == 0:
                evaluate(["random-walk"], task_files(tmp_path / "tasks", 1), after, config=CONFIG, num_workers=0)
                assert texts_of_stages(after) == whole
    assert (num_told, len(whole)) == (3, 3)
    assert num_cuts > 200


def texts_of_stages(run):
    with RunStore(run) as store:
        return list(store.record_texts())


MANY_AT_ONCE = {"config": CHEAP, "num_workers": 2, "episodes_at_once": 4}
RESILIENT = {"agents": ["random-walk"], "num_workers": 2, "num_retries": 5}


@pytest.mark.slow
@pytest.mark.parametrize("at_once", [1, 4])
def test_a_wall_clock_that_jumps_changes_nothing(tmp_path, at_once):
    """By up to a day, forwards or backwards, whenever a driver, worker or agent reads it."""
    library = compiled("clock.c", tmp_path)
    tasks = many_tasks(tmp_path / "tasks", 8)
    evaluate(["random-walk"], tasks, tmp_path / "whole", **HERE_ALONE)
    environment = driver_environment(LD_PRELOAD=str(library))
    look = [sys.executable, "-c", "import time; print(max(abs(time.time() - time.time()) for _ in range(20)))"]
    assert float(subprocess.run(look, env=environment, check=True, capture_output=True).stdout) > 3600.0
    command = driver_command(tmp_path, **RESILIENT, episodes_at_once=at_once)
    subprocess.run(command, env=environment, check=True, timeout=120.0)
    assert texts(tmp_path / "run") == texts(tmp_path / "whole")
    with RunStore(tmp_path / "run") as store:
        assert not list(store.failures())
        assert all(0.0 <= wall_s < 100.0 for wall_s, _ in store.timings().values())


def resident_mb(pid):
    fields = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return int(fields["VmRSS"].split()[0]) / 1024.0


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs /proc")
def test_random_kills_change_nothing_and_a_long_run_grows_nothing(tmp_path):
    """Of the driver (a script without `if __name__ == "__main__"`), its workers and the agents, over 210 stages."""
    tasks = many_tasks(tmp_path / "tasks", 70)
    whole, run = tmp_path / "whole", tmp_path / "run"
    seen = []

    def look(news):
        if news.num_done in (60, 209):
            workers = [pid for pid, line in children(os.getpid()).items() if PROCESS_NAME in line]
            num_open = [len(list(Path(f"/proc/{pid}/fd").iterdir())) for pid in (os.getpid(), *workers)]
            seen.append((num_open, sum(map(resident_mb, workers))))

    evaluate(["random-walk"], tasks, whole, config=CHEAP, num_workers=1, on_progress=look)
    (early_open, early_mb), (late_open, late_mb) = seen
    assert early_open == late_open
    assert late_mb < 1.05 * early_mb
    kills = disturb(driver_command(tmp_path, **RESILIENT), run, 210, 10, seed=1, environment=driver_environment())
    assert kills.total() == 10
    assert len(kills) >= 2
    assert num_recorded(run) == 210
    assert texts(run) == texts(whole)
    assert (run / "summary.json").read_bytes() == (whole / "summary.json").read_bytes()
    with RunStore(run) as store:
        assert all(failure.is_retried for failure in store.failures())


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 300 kB, and a function that mounts it again with other options."""
    small = tmp_path / "small"
    small.mkdir()

    def mount(*options):
        subprocess.run(["mount", *options, str(small)], check=True, capture_output=True)

    try:
        mount("-t", "tmpfs", "-o", "size=300k", "none")
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no file system can be mounted here")
    try:
        yield small, lambda options: mount("-o", f"remount,{options}")
    finally:
        subprocess.run(["umount", str(small)], check=True)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [HERE_ALONE, MANY_AT_ONCE])
def test_a_full_disk_is_one_clear_error(small_disk, tmp_path, workers):
    small, remount = small_disk
    tasks = many_tasks(tmp_path / "tasks", 30)
    with pytest.raises(StoreError, match="0 MB are free there"):
        evaluate(["random-walk"], tasks, small / "run", **workers)
    kept = texts_of_stages(small / "run")
    assert 0 < len(kept) < 90
    remount("size=20m")
    evaluate(["random-walk"], tasks, small / "run", **workers)
    evaluate(["random-walk"], tasks, tmp_path / "whole", **HERE_ALONE)
    assert texts(small / "run") == texts(tmp_path / "whole")


@pytest.mark.slow
@pytest.mark.parametrize("workers", [HERE_ALONE, MANY_AT_ONCE])
def test_a_run_on_a_read_only_disk_is_read_and_not_continued(small_disk, tmp_path, workers):
    small, remount = small_disk
    tasks = many_tasks(tmp_path / "tasks", 2)
    remount("size=20m")
    evaluate(["random-walk"], tasks, small / "run", **workers)
    kept = texts_of_stages(small / "run")
    remount("ro")
    assert len(kept) == 6
    assert texts_of_stages(small / "run") == kept
    done = CliRunner().invoke(app, ["report", str(small / "run"), "--out", str(tmp_path / "report")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "report" / "report.html").is_file()
    with pytest.raises(StoreError, match=r"small/run.*[Rr]ead-only"):
        evaluate(["random-walk", "stay-still"], tasks, small / "run", **workers)
    remount("rw")
    evaluate(["random-walk", "stay-still"], tasks, small / "run", **workers)
    assert texts_of_stages(small / "run")[:6] == kept


def test_the_second_driver_is_told_of_the_first(tasks, tmp_path):
    with (
        writing(tmp_path / "run"),
        pytest.raises(StoreError, match=rf"another evonav is writing here \(process {os.getpid()} on "),
    ):
        evaluate(["random-walk"], tasks, tmp_path / "run", config=CONFIG, num_workers=0)


@pytest.mark.parametrize(
    ("kind", "options", "is_refused"),
    [("nfs4", "rw,vers=4.2", False), ("nfs", "rw,nolock", True), ("cifs", "rw,nobrl", True), ("ext4", "rw", False)],
)
def test_network_file_systems_have_no_shared_memory_and_some_no_locks(
    tasks, tmp_path, monkeypatch, kind, options, is_refused
):
    mounts = tmp_path / "mounts"
    where = str(tmp_path).replace(" ", "\\040")
    mounts.write_text(f"1 0 0:1 / / rw - ext4 /dev/a rw\n2 1 0:2 / {where} rw - {kind} server:/a {options}\n")
    monkeypatch.setattr(folders, "_MOUNTS", mounts)
    if is_refused:
        with pytest.raises(StoreError, match="without locks"):
            evaluate(["random-walk"], tasks, tmp_path / "run", config=CONFIG, num_workers=0)
        return
    evaluate(["random-walk"], tasks, tmp_path / "run", config=CONFIG, num_workers=0)
    with RunStore(tmp_path / "run") as store:
        (mode,) = store._db.execute("PRAGMA journal_mode").fetchone()
    assert mode == ("wal" if kind == "ext4" else "delete")


def test_an_agent_of_the_running_script_is_refused_at_once(tasks, tmp_path):
    with pytest.raises(InvalidArgumentError, match="a module of its own, or use num_workers=0"):
        evaluate(["__main__:Mine"], tasks, tmp_path / "run", config=CONFIG, num_workers=1)
    assert not (tmp_path / "run").exists()


def test_a_file_is_replaced_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "table.csv"
    assert write_atomically(path, "old") == path

    def write_half() -> None:
        with replacing(path) as beside:
            beside.write_text("half", encoding="utf-8")
            raise ValueError("in the middle")

    with pytest.raises(ValueError, match="in the middle"):
        write_half()
    assert [(one.name, one.read_text("utf-8")) for one in path.parent.iterdir()] == [("table.csv", "old")]


def test_a_file_that_cannot_be_replaced_stays(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_atomically(path, "old")

    def fail(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(StoreError, match="No space left"):
        write_atomically(path, "new")
    assert [one.name for one in tmp_path.iterdir()] == ["file"]
    assert path.read_text() == "old"
