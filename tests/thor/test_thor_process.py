"""The engine never outlives its controller, and ends with a word."""

import json
import os
import random
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import evonav.thor

CLIENT = Path(__file__).with_name("thor_client.py")
TOKEN = "EVONAV_TEST_TOKEN"
WITHIN_S = 10.0

pytestmark = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc to find orphans")


class Client:
    """The client in a process group of its own; it and what it starts carry a token in their environment."""

    def __init__(self, folder: Path, house: dict[str, Any], *arguments: str, script: Path = CLIENT) -> None:
        self.token = uuid.uuid4().hex
        self.log = folder / ".ai2thor/log/unity.log"
        house_file = folder / "house.json"
        house_file.write_text(json.dumps(house))
        self.process = subprocess.Popen(
            [sys.executable, "-W", "ignore", script, house_file, *arguments],
            env=os.environ | {TOKEN: self.token, "HOME": str(folder)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def line(self, word: str) -> str:
        """The next thing that the client says, which must begin with the word."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line.startswith(word), (line, self.process.communicate()[1])
        return line.removeprefix(word).strip()

    def pids(self) -> list[int]:
        """Living processes with the token."""
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                environment = (folder / "environ").read_bytes()
            except OSError:
                continue
            if self.token.encode() in environment:
                found.append(int(folder.name))
        return found

    def engines(self) -> list[int]:
        return [pid for pid in self.pids() if pid != self.process.pid]

    def assert_all_gone(self) -> None:
        deadline_s = time.monotonic() + WITHIN_S
        while self.pids() or self.process.poll() is None:
            assert time.monotonic() < deadline_s, (self.pids(), self.process.poll(), self._words())
            time.sleep(0.02)

    def logged(self) -> str:
        return self.log.read_text() if self.log.exists() else ""

    def kill_all(self) -> None:
        for pid in self.pids():
            os.kill(pid, signal.SIGKILL)
        self.process.communicate()

    def _words(self) -> str:
        return self.logged()[-2000:]


@pytest.fixture
def clients(tmp_path: Path, house: dict[str, Any]) -> Iterator[Any]:
    started: list[Client] = []

    def start(*arguments: str, **options: Path) -> Client:
        started.append(Client(tmp_path, house, *arguments, **options))
        return started[-1]

    yield start
    for client in started:
        client.kill_all()


def test_stop_ends_the_engine(clients: Any) -> None:
    client = clients("--steps", "20")
    client.assert_all_gone()
    assert client.process.returncode == 0


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_a_killed_client_leaves_no_engine(clients: Any, seed: int) -> None:
    """From before the engine opened its pipes to amid its answers."""
    client = clients()
    rng = random.Random(seed)
    if seed % 2:
        client.line("started")
        time.sleep(rng.uniform(0.0, 0.3))
    else:
        while not client.engines():
            assert client.process.poll() is None
        time.sleep(rng.uniform(0.0, 0.4))
    client.process.kill()
    client.assert_all_gone()
    assert "Traceback" not in client.logged()


def _assert_fails_soon(client: Client, within_s: float = WITHIN_S) -> None:
    began_s = time.monotonic()
    client.assert_all_gone()
    assert time.monotonic() - began_s < within_s
    assert client.process.stdout is not None
    words = client.process.stdout.read()
    assert "failed" in words
    assert "failed TimeoutError" not in words
    assert "stopped" in words


@pytest.mark.parametrize(
    "number", [signal.SIGKILL, *(pytest.param(one, marks=pytest.mark.slow) for one in (signal.SIGTERM, signal.SIGSEGV))]
)
@pytest.mark.parametrize("victim", ["process", "worker"])
def test_a_killed_engine_ends_the_client_soon(clients: Any, number: signal.Signals, victim: str) -> None:
    client = clients()
    process = int(client.line("started"))
    client.line("stepped")
    (worker,) = (pid for pid in client.engines() if pid != process)
    os.kill(process if victim == "process" else worker, number)
    _assert_fails_soon(client)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size_px", [300, 1500])
def test_an_engine_killed_at_any_moment_ends_the_client_soon(clients: Any, seed: int, size_px: int) -> None:
    """The larger images do not fit into the pipe, so that most of the time a message is under way."""
    client = clients("--size", str(size_px))
    process = int(client.line("started"))
    (worker,) = (pid for pid in client.engines() if pid != process)
    time.sleep(random.Random(seed).uniform(0.0, 0.3))
    os.kill(worker if seed % 2 else process, signal.SIGKILL)
    _assert_fails_soon(client)


def test_both_processes_of_the_engine_killed(clients: Any) -> None:
    """Nobody is left to say goodbye: the client waits for its timeout, or sees that nobody reads its next action."""
    client = clients("--timeout", "2")
    client.line("started")
    client.line("stepped")
    for pid in client.engines():
        os.kill(pid, signal.SIGKILL)
    client.assert_all_gone()
    assert "failed" in client.process.stdout.read()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_worker_and_supervisor_are_both_killed(clients: Any, seed: int) -> None:
    client = clients()
    engine = int(client.line("started"))
    time.sleep(random.Random(seed).uniform(0.0, 0.2))
    victims = [engine, client.process.pid]
    for pid in victims if seed % 2 else victims[::-1]:
        os.kill(pid, signal.SIGKILL)
    client.assert_all_gone()


def test_interrupt_from_the_terminal_is_quiet(clients: Any) -> None:
    """Ctrl-C goes to the whole group."""
    client = clients()
    client.line("started")
    client.line("stepped")
    os.killpg(client.process.pid, signal.SIGINT)
    client.assert_all_gone()
    assert "Traceback" not in client.logged()


FORKING_CLIENT = f"""
import os, pathlib, sys, threading, time
def fork_and_die():
    while not pathlib.Path("go").exists():
        time.sleep(0.01)
    if os.fork() == 0:
        time.sleep(30.0)
        os._exit(0)
    os.kill(os.getpid(), 9)
threading.Thread(target=fork_and_die, daemon=True).start()
sys.path.insert(0, {str(CLIENT.parent)!r})
import thor_client
thor_client.main()
"""


def test_a_fork_of_the_client_does_not_keep_the_engine(
    clients: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Multiprocessing's forks hold the client's ends of the pipes open."""
    script = tmp_path / "forking_client.py"
    script.write_text(FORKING_CLIENT)
    monkeypatch.chdir(tmp_path)
    client = clients(script=script)
    engine = int(client.line("started"))
    (tmp_path / "go").touch()
    assert client.process.wait(WITHIN_S) == -signal.SIGKILL
    deadline_s = time.monotonic() + WITHIN_S
    while engine in client.pids():
        assert time.monotonic() < deadline_s
        time.sleep(0.02)
    assert client.pids(), "the fork was to live on"


def test_without_a_client_it_prints_its_usage() -> None:
    environment = {key: value for key, value in os.environ.items() if not key.startswith("AI2THOR_")}
    run = subprocess.run(
        [evonav.thor.executable()], env=environment, capture_output=True, text=True, timeout=WITHIN_S, check=False
    )
    assert run.returncode == 2
    assert "local_executable_path=evonav.thor.executable()" in run.stderr
    assert "Traceback" not in run.stderr


def test_no_client_opens_the_pipes(tmp_path: Path) -> None:
    """The engine of a client that died at once, adopted by somebody who lives."""
    for name in ("server", "client"):
        os.mkfifo(tmp_path / name)
    pipes = {f"AI2THOR_FIFO_{name.upper()}_PIPE_PATH": str(tmp_path / name) for name in ("server", "client")}
    began_s = time.monotonic()
    run = subprocess.run(
        [evonav.thor.executable()], env=os.environ | pipes, capture_output=True, text=True, timeout=20, check=False
    )
    assert run.returncode == 1
    assert "no client opened" in run.stderr
    assert time.monotonic() - began_s < WITHIN_S + 3.0
