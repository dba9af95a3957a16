"""Sealed task sets: nobody without the key reads them, and with it they are what they were."""

import hashlib
import importlib
import io
import json
import shutil
import stat
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from evonav.agents.hosting.sandbox import why_not
from evonav.cli import app
from evonav.errors import InvalidArgumentError, StoreError, TaskError
from evonav.evaluation.hosting.process import AgentHosting
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.run import SHIFT_KEY, RunConfig, evaluate, shifts_coordinates
from evonav.submission.pack import pack
from evonav.submission.sealed import SUFFIX, new_key, opened, read_index, seal, unseal
from evonav.tasks.bundled import bundled_tasks
from evonav.tasks.listing import KEY_VARIABLE, SEALED_NAME, TaskFile, task_files

pytest.importorskip("nacl")

NEEDS_SANDBOX = pytest.mark.skipif(bool(why_not()), reason=f"no sandbox here: {why_not()}")


@pytest.fixture(scope="module")
def tasks() -> Iterator[list[TaskFile]]:
    with bundled_tasks() as folder:
        yield task_files(folder, 2)


@pytest.fixture(scope="module")
def key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("keys") / "evaluator.key"
    new_key(path)
    return path


@pytest.fixture(scope="module")
def sealed(tasks: list[TaskFile], key: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sealed") / "set"
    seal(tasks, public(key), out)
    return out


def public(key: Path) -> Path:
    return key.with_name(f"{key.name}.pub")


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_files_come_back_bit_by_bit(tasks: list[TaskFile], key: Path, sealed: Path, tmp_path: Path) -> None:
    unseal(sealed, key, tmp_path)
    found = task_files(tmp_path)
    assert [task.task_id for task in found] == [task.task_id for task in tasks]
    assert all(task.was_sealed for task in found)
    assert not any(task.was_sealed for task in tasks)
    for before, after in zip(tasks, found, strict=True):
        assert after.digest == before.digest
        assert contents(after.path) == contents(before.path)


def test_nothing_tells_what_is_in_it(tasks: list[TaskFile], sealed: Path) -> None:
    files = contents(sealed)
    index = read_index(sealed)
    assert (index.num_tasks, index.num_stages) == (2, sum(task.num_stages for task in tasks))
    assert files.keys() == {SEALED_NAME, *index.files}
    told = b"\0".join([*files.values(), *(name.encode() for name in files)])
    for task in tasks:
        for word in (task.task_id, task.digest):
            assert word.encode() not in told
    assert b"instruction" not in told
    assert b"target" not in told


def test_the_same_tasks_are_sealed_differently_each_time(
    tasks: list[TaskFile], key: Path, sealed: Path, tmp_path: Path
) -> None:
    again = seal(tasks, public(key), tmp_path / "again")
    assert not again.files.keys() & read_index(sealed).files.keys()
    assert not set(again.files.values()) & set(read_index(sealed).files.values())


def test_only_this_user_reads_the_private_key(key: Path, tmp_path: Path) -> None:
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    with pytest.raises(StoreError, match="cannot be written: File exists"):
        new_key(key)


def changed(sealed: Path, tmp_path: Path) -> tuple[Path, Path]:
    copy = tmp_path / "copy"
    shutil.copytree(sealed, copy)
    return copy, next(path for path in sorted(copy.iterdir()) if path.suffix == SUFFIX)


def resealed(copy: Path, part: Path, data: bytes) -> None:
    """Replaces a file and its checksum, as somebody could who has no key."""
    part.write_bytes(data)
    index = json.loads((copy / SEALED_NAME).read_text())
    index["files"][part.name] = hashlib.sha256(data).hexdigest()
    (copy / SEALED_NAME).write_text(json.dumps(index))


def test_another_key_opens_nothing(sealed: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.key"
    new_key(other)
    with pytest.raises(TaskError, match="is sealed for another key"):
        unseal(sealed, other, tmp_path / "out")
    copy, _ = changed(sealed, tmp_path)
    index = json.loads((copy / SEALED_NAME).read_text())
    index["public_key"] = public(other).read_text().split()[-1]
    (copy / SEALED_NAME).write_text(json.dumps(index))
    with pytest.raises(TaskError, match="cannot be opened"):
        unseal(copy, other, tmp_path / "out")
    assert not list((tmp_path / "out").glob("*/*"))


def test_a_changed_file_is_named(sealed: Path, key: Path, tmp_path: Path) -> None:
    copy, part = changed(sealed, tmp_path)
    data = bytearray(part.read_bytes())
    data[len(data) // 2] ^= 1
    part.write_bytes(data)
    with pytest.raises(TaskError, match=rf"{part.name}: is not the file that was sealed"):
        unseal(copy, key, tmp_path / "out")
    resealed(copy, part, bytes(data))
    with pytest.raises(TaskError, match=rf"{part.name}: cannot be opened"):
        unseal(copy, key, tmp_path / "out")
    part.unlink()
    with pytest.raises(TaskError, match=rf"{part.name}: cannot be read: No such file"):
        unseal(copy, key, tmp_path / "out")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 2}, "format evonav-sealed-tasks 2: this is evonav-sealed-tasks 1"),
        ({"files": {"../../x.sealed": "0"}}, "files: each must be a name"),
        ({"files": []}, "no index of sealed tasks"),
        ({"num_tasks": None}, "no index of sealed tasks"),
    ],
)
def test_a_wrong_index_is_refused(
    sealed: Path, key: Path, tmp_path: Path, change: dict[str, object], message: str
) -> None:
    copy, _ = changed(sealed, tmp_path)
    index = json.loads((copy / SEALED_NAME).read_text())
    (copy / SEALED_NAME).write_text(json.dumps({**index, **change}))
    with pytest.raises(TaskError, match=message):
        unseal(copy, key, tmp_path / "out")


def test_a_member_cannot_lead_out_of_the_folder(key: Path, tmp_path: Path) -> None:
    nacl = importlib.import_module("nacl.public")
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("../escaped", b"x")
    box = nacl.SealedBox(nacl.PublicKey(bytes.fromhex(public(key).read_text().split()[-1])))
    folder = tmp_path / "set"
    folder.mkdir()
    content = {"format": "evonav-sealed-tasks", "version": 1, "public_key": public(key).read_text().split()[-1]}
    (folder / SEALED_NAME).write_text(
        json.dumps({**content, "num_tasks": 1, "num_stages": 1, "files": {"a.sealed": ""}})
    )
    resealed(folder, folder / "a.sealed", box.encrypt(data.getvalue()))
    with pytest.raises(TaskError, match="leads out of the set"):
        unseal(folder, key, tmp_path / "out")
    assert not (tmp_path / "escaped").exists()


@pytest.mark.parametrize(
    "text", ["", "evonav public key 00", f"evonav public key {'0' * 64}", "\ud800", "evonav private key zz"]
)
def test_a_file_that_is_no_private_key_is_named(sealed: Path, tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.key"
    path.write_bytes(text.encode(errors="surrogatepass"))
    with pytest.raises(InvalidArgumentError, match=r"bad\.key: "):
        unseal(sealed, path, tmp_path / "out")


def test_a_set_is_open_only_while_it_is_lent(sealed: Path, key: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(KEY_VARIABLE, raising=False)
    with pytest.raises(InvalidArgumentError, match="set EVONAV_TASKS_KEY"), opened(sealed):
        pass
    monkeypatch.setenv(KEY_VARIABLE, str(key))
    with opened(sealed) as folder:
        assert len(task_files(folder)) == 2
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert not folder.exists()


def test_agents_must_be_shut_in(sealed: Path, key: Path, tmp_path: Path) -> None:
    unseal(sealed, key, tmp_path / "tasks")
    with pytest.raises(InvalidArgumentError, match=r"the tasks were sealed.*use sandbox"):
        evaluate(["random-walk"], task_files(tmp_path / "tasks"), tmp_path / "run", num_workers=1)
    assert not (tmp_path / "run").exists()


def test_agents_are_told_shifted_coordinates_on_sealed_tasks_always(
    tasks: list[TaskFile], sealed: Path, key: Path, tmp_path: Path
) -> None:
    unseal(sealed, key, tmp_path)
    for is_on in (False, True):
        config = RunConfig(shift_coordinates=is_on)
        assert shifts_coordinates(task_files(tmp_path), config)
        assert shifts_coordinates([*tasks, *task_files(tmp_path, 1)], config)
        assert shifts_coordinates(tasks, config) == is_on


@NEEDS_SANDBOX
def test_a_run_on_sealed_tasks_is_that_on_the_tasks_with_shifted_coordinates(
    tasks: list[TaskFile], sealed: Path, key: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evonav.evaluation.run.run.secrets.token_hex", lambda _: "5" * 64)  # runs draw the same shifts
    monkeypatch.setenv(KEY_VARIABLE, str(key))
    words = ["evaluate", "--agent", "fu", "--tasks", str(sealed), "--isolation", "sandbox", "--workers", "1"]
    for _ in range(2):  # the second call finds that nothing is left
        done = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "sealed")])
        assert done.exit_code == 0, done.output
        assert "the tasks were sealed: agents are told shifted coordinates (--shift-coordinates)" in done.output
    config = RunConfig(hosting=AgentHosting(is_sandboxed=True), shift_coordinates=True)
    evaluate(["fu"], tasks, tmp_path / "plain", num_workers=1, config=config)
    evaluate(["fu"], tasks, tmp_path / "true", num_workers=1, config=replace(config, shift_coordinates=False))
    with (
        RunStore(tmp_path / "sealed") as a,
        RunStore(tmp_path / "plain") as b,
        RunStore(tmp_path / "true") as c,
    ):
        assert list(a.records("fu")) == list(b.records("fu"))
        assert list(a.records("fu")) != list(c.records("fu"))
        assert [store.meta("config").get(SHIFT_KEY) for store in (a, b, c)] == [True, True, None]
        opened_folder = Path(a.meta("tasks_dir"))
    assert not opened_folder.exists()
    with pytest.raises(InvalidArgumentError, match="its tasks are sealed"):
        pack(tmp_path / "sealed", tmp_path / "sealed.evonav.zip")
    pack(tmp_path / "plain", tmp_path / "plain.evonav.zip")
    packed = CliRunner().invoke(app, ["pack", str(tmp_path / "sealed"), "--reveal"])
    assert packed.exit_code == 0, packed.output
    verified = CliRunner().invoke(app, ["verify", str(tmp_path / "sealed.evonav.zip"), "--tasks", str(sealed)])
    assert verified.exit_code == 0, verified.output


READING_AGENT = """
import os
from evonav import Agent, Stop

class Reader(Agent):
    def act(self, observation):
        for path in ({key!r}, {run!r}):
            try:
                open(path).read()
            except OSError:
                continue
            raise RuntimeError(f"could read {{path}}")
        if "EVONAV_TASKS_KEY" in os.environ:
            raise RuntimeError("knows where the key is")
        return Stop()
"""


@NEEDS_SANDBOX
def test_an_agent_beside_the_key_cannot_read_it(
    sealed: Path, key: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside = tmp_path / "evaluator.key"  # in the agent's own folder, which it may read
    shutil.copy(key, beside)
    (tmp_path / "reader.py").write_text(READING_AGENT.format(key=str(beside), run=str(tmp_path / "run/records.sqlite")))
    monkeypatch.setenv(KEY_VARIABLE, str(beside))
    words = ["evaluate", "--agent", f"{tmp_path / 'reader.py'}:Reader", "--tasks", str(sealed), "--limit", "1"]
    done = CliRunner().invoke(app, [*words, "--isolation", "sandbox", "--workers", "1", "--out", str(tmp_path / "run")])
    assert done.exit_code == 0, done.output


def test_a_folder_with_files_is_not_written_to(tasks: list[TaskFile], key: Path, tmp_path: Path) -> None:
    (tmp_path / "there").write_text("x")
    with pytest.raises(StoreError, match="is not empty"):
        seal(tasks, public(key), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
