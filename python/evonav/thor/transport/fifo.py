"""Speak AI2-THOR's FIFO transport: messages of typed fields over two named pipes that the client makes.

Framing, from `ai2thor.fifo_server`: a field is a header `!BI` (type, length) and a body; type 255 with length 0 ends
the message. The client sends one ACTION field. The answer is METADATA, or METADATA_PATCH, and images.
"""

import errno
import fcntl
import os
import select
import struct
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:  # NumPy takes longer to import than all the rest; the pipes must be open by then.
    from numpy.typing import NDArray

Body: TypeAlias = "bytes | NDArray[Any]"
"""Body of a field; an array is sent as it lies in memory."""

MAX_MESSAGE_BYTES = 256 * 2**20
"""Limit of a field's length: larger than any house, so a longer field means a broken header."""

_HEADER = struct.Struct("!BI")
# The client opens its end as soon as it has started the process. A client that has not done so by then is dead, even if
# the engine was adopted by another process too early to notice.
_CONNECT_TIMEOUT_S = 5.0
_WATCH_MS = 500
# A client in the middle of a message continues to read at once.
_STALL_MS = 500
# Linux's fcntl command. A whole event fits, so engine and client take turns once a step.
_SET_PIPE_SIZE, _PIPE_BYTES = 1031, 2**20
# Number of buffers of one `writev`; POSIX allows 16, Linux 1024.
_MAX_BUFFERS = 256


class FieldType(IntEnum):
    """First byte of a header."""

    METADATA = 1
    ACTION = 2
    RGB_IMAGE = 4
    DEPTH_IMAGE = 5
    CLASSES_IMAGE = 8
    IDS_IMAGE = 9
    THIRD_PARTY_IMAGE = 10
    METADATA_PATCH = 11
    THIRD_PARTY_DEPTH = 12
    THIRD_PARTY_IMAGE_IDS = 14
    THIRD_PARTY_CLASSES = 15
    END_OF_MESSAGE = 255


Field: TypeAlias = "tuple[FieldType, Body]"


class ClientGone(Exception):  # noqa: N818 - how a session ends
    """The client is not at the other end any more."""


class FramingError(Exception):
    """The client broke the framing, so the next message cannot be found."""


class Fifo:
    """The engine's ends of both pipes.

    No call outlasts the client by more than a second. A closed pipe ends every wait; where another process holds the
    pipes open (a fork of the client), `is_orphan` ends it.
    """

    def __init__(self, server_pipe: Path, client_pipe: Path, is_orphan: Callable[[], bool]) -> None:
        """Open the pipes; the client waits for that.

        Args:
            server_pipe: The pipe that the engine writes.
            client_pipe: The pipe that the engine reads.
            is_orphan: Whether the process that started the engine is gone.

        Raises:
            ClientGone: Nobody reads the server pipe.
            OSError: A path is not a pipe that can be opened.
        """
        self.is_orphan = is_orphan
        self._pending = bytearray()
        self._is_sending = False
        self._out = self._opened_for_writing(server_pipe)
        with suppress(OSError):
            fcntl.fcntl(self._out, _SET_PIPE_SIZE, _PIPE_BYTES)
        self._in = os.open(client_pipe, os.O_RDONLY | os.O_NONBLOCK)

    def receive(self) -> bytes:
        """Return the next action, as JSON.

        Raises:
            ClientGone: The client is gone, so there is no action.
            FramingError: The bytes are not a message.
        """
        body: bytes | None = None
        while True:
            kind, num_bytes = _HEADER.unpack(self._read(_HEADER.size, is_start=body is None))
            if kind == FieldType.END_OF_MESSAGE and num_bytes == 0 and body is not None:
                if self.is_orphan():  # `_wait` does not check it for a client that never pauses
                    raise ClientGone("the process that started the engine is gone")
                return body
            if kind != FieldType.ACTION or body is not None:
                raise FramingError(f"field type {kind} of {num_bytes} bytes where an action belongs")
            if num_bytes > MAX_MESSAGE_BYTES:
                raise FramingError(f"a message of {num_bytes} bytes; {MAX_MESSAGE_BYTES} are the most")
            body = self._read(num_bytes)

    def send(self, fields: Iterable[Field]) -> None:
        """Send one message.

        Raises:
            ClientGone: The client does not read the message.
        """
        self._is_sending = True
        buffers: list[memoryview] = []
        for kind, body in fields:
            view = memoryview(body if isinstance(body, bytes) else body.data).cast("B")
            buffers += [memoryview(_HEADER.pack(kind, len(view))), view]
        buffers.append(memoryview(_HEADER.pack(FieldType.END_OF_MESSAGE, 0)))
        self._write(buffers)
        self._is_sending = False

    def close(self) -> None:
        """Close both pipes, and wake a client that waits for an answer.

        The client takes a closed pipe for a slow engine and waits for its timeout, 100 s. An empty message makes it
        raise.
        """
        if self._is_sending:
            self.break_off()
        else:
            with suppress(OSError):
                os.write(self._out, _HEADER.pack(FieldType.END_OF_MESSAGE, 0))
        os.close(self._out)
        os.close(self._in)

    def stop_reading(self) -> None:
        """Close the client's pipe alone, so that a client that writes sees that no other process reads it."""
        os.close(self._in)

    def break_off(self) -> None:
        """Wake a client wherever in a message it waits.

        Zeros complete any field. More zeros are a header of an unknown type, at which the client raises. The end of a
        message would make the client accept a broken message.
        """
        poll = select.poll()
        poll.register(self._out, select.POLLOUT)
        with suppress(OSError):
            while poll.poll(_STALL_MS):
                os.write(self._out, bytes(2**16))

    def _opened_for_writing(self, path: Path) -> int:
        deadline_s = time.monotonic() + _CONNECT_TIMEOUT_S
        while time.monotonic() < deadline_s:
            try:
                # A blocking call would wait for a client that may be dead.
                return os.open(path, os.O_WRONLY | os.O_NONBLOCK)
            except OSError as error:
                if error.errno != errno.ENXIO:
                    raise
            if self.is_orphan():
                raise ClientGone("the client went before it opened its pipe")
            time.sleep(0.002)
        raise ClientGone(f"no client opened {path} within {_CONNECT_TIMEOUT_S:.0f} s")

    def _read(self, num_bytes: int, *, is_start: bool = False) -> bytes:
        while len(self._pending) < num_bytes:
            self._wait(self._in, select.POLLIN)
            try:
                part = os.read(self._in, max(num_bytes - len(self._pending), 2**16))
            except BlockingIOError:
                continue
            if not part:
                if is_start and not self._pending:
                    raise ClientGone("the client closed its pipe")
                raise FramingError(f"the message ends after {len(self._pending)} of {num_bytes} bytes")
            self._pending += part
        taken = bytes(self._pending[:num_bytes])
        del self._pending[:num_bytes]
        return taken

    def _write(self, buffers: list[memoryview]) -> None:
        while buffers:
            try:
                num_sent = os.writev(self._out, buffers[:_MAX_BUFFERS])
            except BlockingIOError:
                self._wait(self._out, select.POLLOUT)
                continue
            except BrokenPipeError as error:
                raise ClientGone("the client closed its pipe") from error
            while buffers and num_sent >= len(buffers[0]):
                num_sent -= len(buffers.pop(0))
            if num_sent:
                buffers[0] = buffers[0][num_sent:]

    def _wait(self, file: int, event: int) -> None:
        """Wait until `file` is ready; a pipe without a reader is always an error on its writing end."""
        poll = select.poll()
        poll.register(self._out, 0)
        poll.register(file, event)
        while True:
            ready = dict(poll.poll(_WATCH_MS))
            if ready.get(file, 0) & event or ready.get(self._in, 0) & select.POLLHUP:
                return
            if ready or self.is_orphan():
                raise ClientGone("the client is gone")
