"""The bytes of the pipes: what a client other than AI2-THOR's, or a broken one, may write."""

import json
import os
import select
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import evonav.thor
from evonav.thor.transport.fifo import MAX_MESSAGE_BYTES, ClientGone, Fifo, FramingError

HEADER = struct.Struct("!BI")
EOM = HEADER.pack(255, 0)
WITHIN_S = 10.0


def framed(body: bytes, kind: int = 2) -> bytes:
    return HEADER.pack(kind, len(body)) + body + EOM


class Pipes:
    """The client's ends."""

    def __init__(self, folder: Path) -> None:
        self.paths = [folder / "server.pipe", folder / "client.pipe"]
        for path in self.paths:
            path.unlink(missing_ok=True)
            os.mkfifo(path)
        self.answers = os.open(self.paths[0], os.O_RDONLY | os.O_NONBLOCK)
        self.requests = -1

    def write(self, data: bytes) -> None:
        if self.requests < 0:
            self.requests = os.open(self.paths[1], os.O_WRONLY)
        while data:
            data = data[os.write(self.requests, data) :]

    def close_requests(self) -> None:
        if self.requests >= 0:
            os.close(self.requests)
            self.requests = -1

    def close(self) -> None:
        self.close_requests()
        os.close(self.answers)

    def message(self) -> list[tuple[int, bytes]]:
        """The fields of the engine's next message."""
        fields: list[tuple[int, bytes]] = []
        while True:
            kind, length = HEADER.unpack(self._read(HEADER.size))
            if kind == 255:
                return fields
            fields.append((kind, self._read(length)))

    def agent(self) -> dict[str, Any]:
        metadata = msgpack.loads(self.message()[0][1])
        agent: dict[str, Any] = metadata["agents"][0] | {"sequenceId": metadata["sequenceId"]}
        return agent

    def _read(self, length: int) -> bytes:
        data = b""
        while len(data) < length:
            assert select.select([self.answers], [], [], WITHIN_S)[0], "the engine does not answer"
            part = os.read(self.answers, length - len(data))
            assert part, "the engine has gone"
            data += part
        return data


@pytest.fixture
def pipes(tmp_path: Path) -> Iterator[Pipes]:
    ends = Pipes(tmp_path)
    yield ends
    ends.close()


@pytest.fixture
def engine(pipes: Pipes) -> Iterator[subprocess.Popen[str]]:
    names = ("SERVER", "CLIENT")
    environment = {f"AI2THOR_FIFO_{n}_PIPE_PATH": str(path) for n, path in zip(names, pipes.paths, strict=True)}
    process = subprocess.Popen(
        [evonav.thor.executable(), "-screen-width", "32", "-screen-height", "24"],
        env=os.environ | environment,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert pipes.agent()["sequenceId"] == 0
    yield process
    process.kill()
    process.communicate()


BROKEN = {
    "a header cut short": b"\x02\x00",
    "a body cut short": HEADER.pack(2, 100) + b"{}",
    "no end of message": HEADER.pack(2, 2) + b"{}",
    "a wrong type": framed(b"{}", kind=1),
    "an unknown type": framed(b"{}", kind=77),
    "an empty message": EOM,
    "two actions in a message": HEADER.pack(2, 2) + b"{}" + framed(b"{}"),
    "an end of message with a body": HEADER.pack(2, 2) + b"{}" + HEADER.pack(255, 4) + b"{{}}",
    "more than fits": HEADER.pack(2, 2**32 - 1) + b"{}",
    "plain text": b"GET / HTTP/1.1\r\n\r\n" * 9,
}


@pytest.mark.parametrize("data", BROKEN.values(), ids=BROKEN.keys())
def test_broken_framing_ends_the_engine_with_a_message(
    engine: "subprocess.Popen[str]", pipes: Pipes, data: bytes
) -> None:
    pipes.write(data)
    pipes.close_requests()
    _, log = engine.communicate(timeout=WITHIN_S)
    assert engine.returncode == 1
    assert "ERROR ends: " in log
    assert "Traceback" not in log
    # The client's reader, which waits for an answer, gets the end of a message instead of a timeout.
    assert pipes.message() == []


def test_closing_between_messages_is_no_error(engine: "subprocess.Popen[str]", pipes: Pipes) -> None:
    pipes.write(framed(json.dumps({"action": "GetScenesInBuild", "sequenceId": 1}).encode()))
    assert pipes.agent()["actionReturn"] == ["Procedural"]
    pipes.close_requests()
    _, log = engine.communicate(timeout=WITHIN_S)
    assert engine.returncode == 0, log
    assert "Traceback" not in log


NO_ACTIONS = [
    b"",
    b"{",
    b"[]",
    b"null",
    b'"Pass"',
    b"\xff\xfe",
    b"{}",
    b'{"action": null}',
    b'{"action": ["Pass"]}',
    b'{"action": {"x": 1}, "sequenceId": "1"}',
    b'{"action": "Pass", "sequenceId": 1e400}',
    b'{"action": "Pass", "agentId": 3}',
    b'{"action": "\\ud800", "sequenceId": 5}',
    b'{"action": "Teleport", "x": NaN, "y": Infinity, "z": 1}',
    b'{"action": "CreateHouse", "house": ' + b"[" * 100_000 + b"]" * 100_000 + b"}",
    b'{"action": "CreateHouse", "house": ' + b'{"a":' * 900 + b"1" + b"}" * 900 + b"}",
    b'{"action": "Pass", "n": ' + b"9" * 10_000 + b"}",
]


def test_messages_without_an_action_fail(engine: "subprocess.Popen[str]", pipes: Pipes) -> None:
    for body in NO_ACTIONS:
        pipes.write(framed(body))
        agent = pipes.agent()
        succeeded = agent["lastActionSuccess"]
        assert not succeeded or body.startswith(b'{"action": "Pass"'), body[:100]
        assert succeeded or 0 < len(agent["errorMessage"]) < 5000, body[:100]
    pipes.write(framed(b'{"action": "Pass", "sequenceId": 17}'))
    agent = pipes.agent()
    assert agent["lastActionSuccess"]
    assert agent["sequenceId"] == 17


def _receive_all(fifo: Fifo) -> None:
    while True:
        fifo.receive()


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.binary(max_size=200), cuts=st.lists(st.integers(1, 40), max_size=6))
def test_any_bytes_are_a_message_or_an_error(tmp_path: Path, data: bytes, cuts: list[int]) -> None:
    """Whatever comes, in whatever portions: actions, then the end or a framing error, and nothing hangs."""
    pipes = Pipes(tmp_path)
    fifo = Fifo(*pipes.paths, lambda: False)

    def write() -> None:
        rest = data
        for cut in cuts:
            pipes.write(rest[:cut])
            rest = rest[cut:]
            time.sleep(0.0005)
        pipes.write(rest)
        pipes.close_requests()

    thread = threading.Thread(target=write)
    thread.start()
    try:
        with pytest.raises((ClientGone, FramingError)):
            _receive_all(fifo)
    finally:
        thread.join(WITHIN_S)
        fifo.close()
        pipes.close()


def test_large_bodies_pass_in_portions(tmp_path: Path) -> None:
    """Larger than a pipe holds, both ways."""
    pipes = Pipes(tmp_path)
    fifo = Fifo(*pipes.paths, lambda: False)
    body = bytes(range(256)) * 20_000
    thread = threading.Thread(target=lambda: pipes.write(framed(body)))
    thread.start()
    assert fifo.receive() == body
    thread.join()
    thread = threading.Thread(target=lambda: fifo.send([(4, body), (5, b""), (6, body)]))  # type: ignore[list-item]
    thread.start()
    assert pipes.message() == [(4, body), (5, b""), (6, body)]
    thread.join()
    fifo.close()
    pipes.close()


def test_a_message_interrupted_anywhere_makes_the_client_raise() -> None:
    """AI2-THOR's own reader, which waits for its timeout at the end of a pipe; never is a torn picture an event."""
    fifo_server = pytest.importorskip("ai2thor.fifo_server")
    metadata = {"agents": [{"name": "agent"}], "activeAgentId": 0}
    packed = msgpack.packb(metadata)
    message = HEADER.pack(1, len(packed)) + packed + HEADER.pack(4, 12) + bytes(range(12)) + EOM
    for num_sent in range(len(message)):
        server = fifo_server.FifoServer(width=2, height=2)
        server.start()
        reader = os.open(server.server_pipe_path, os.O_RDONLY | os.O_NONBLOCK)
        with os.fdopen(reader, "rb", buffering=0) as server.server_pipe:
            fifo = Fifo(Path(server.server_pipe_path), Path(server.client_pipe_path), lambda: False)
            writer = os.open(server.server_pipe_path, os.O_WRONLY)
            os.write(writer, message[:num_sent])
            os.close(writer)
            thread = threading.Thread(target=fifo.break_off)
            thread.start()
            began_s = time.monotonic()
            if num_sent <= len(message) - len(EOM):
                with pytest.raises((KeyError, ValueError)):
                    server.receive()
            else:  # the end itself was begun: the message is whole
                assert server._recv_message(None) == (metadata, {"image": [bytes(range(12))]})
            assert time.monotonic() - began_s < WITHIN_S
        thread.join()
        fifo.close()
        server.tmp_dir.cleanup()


def test_the_limit_is_above_every_house() -> None:
    assert MAX_MESSAGE_BYTES > 100e6
