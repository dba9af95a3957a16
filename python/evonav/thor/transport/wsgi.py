"""Speak AI2-THOR's WSGI transport: post each event to the client's HTTP server, which answers with an action.

The form, from `ai2thor.wsgi_server`: `POST /train`, multipart, with the fields `metadata` (JSON) and `token`, and the
images as files. The JSON answer comes when the client takes its next step, so the engine waits in the request.
"""

import http.client
import ipaddress
import json
import secrets
import select
from collections.abc import Callable, Iterable

import msgpack
from pydantic_core import to_json

from evonav.thor.transport.fifo import MAX_MESSAGE_BYTES, Body, ClientGone, Field, FieldType, FramingError

_NAMES = {
    FieldType.RGB_IMAGE: "image",
    FieldType.DEPTH_IMAGE: "image_depth",
    FieldType.CLASSES_IMAGE: "image_classes",
    FieldType.IDS_IMAGE: "image_ids",
    FieldType.THIRD_PARTY_IMAGE: "image-thirdParty-camera",
    FieldType.THIRD_PARTY_DEPTH: "image_thirdParty_depth",
    FieldType.THIRD_PARTY_IMAGE_IDS: "image_thirdParty_image_ids",
    FieldType.THIRD_PARTY_CLASSES: "image_thirdParty_classes",
}
_WATCH_MS = 500
# Time for what the client does at once: accepting the connection, and sending the rest of an answer.
_TIMEOUT_S = 10.0


class Wsgi:
    """The engine's side of the connection, with the methods of `Fifo`."""

    def __init__(self, host: str, port: int, token: str, is_orphan: Callable[[], bool]) -> None:
        """Store the address; nothing is sent yet.

        Args:
            host: Address of the client's server, on this machine.
            port: Port of the client's server.
            token: Secret sent with each event: the client refuses events of other engines.
            is_orphan: Whether the process that started the engine is gone.

        Raises:
            ValueError: The address is not on this machine.
        """
        if not is_loopback(host):
            message = (
                f"the client's address {host} is not on this machine (127.0.0.1, ::1, localhost): nothing is sent there"
            )
            raise ValueError(message)
        self._token = token
        self._is_orphan = is_orphan
        self._connection = http.client.HTTPConnection(host, port, timeout=_TIMEOUT_S)

    def send(self, fields: Iterable[Field]) -> None:
        """Post one event.

        Raises:
            ClientGone: The client does not accept the event.
        """
        boundary = secrets.token_hex(16)
        body = _form(fields, self._token, boundary)
        headers = {"Content-Type": f"multipart/form-data; boundary={boundary}"}
        try:
            self._connection.request("POST", "/train", body, headers)
        except (OSError, http.client.HTTPException) as error:
            raise ClientGone(f"the client takes no event: {error}") from error

    def receive(self) -> bytes:
        """Return the next action, as JSON: the answer to the event.

        Raises:
            ClientGone: The client is gone, so there is no action.
            FramingError: The client refused the event, or its answer is not an action.
        """
        try:
            self._wait()
            with self._connection.getresponse() as response:
                body = response.read(MAX_MESSAGE_BYTES + 1)
                status = response.status
        except (OSError, http.client.HTTPException) as error:
            raise ClientGone(f"the client closed the connection: {error!r}") from error
        if status != http.client.OK:
            raise FramingError(f"the client refused the event: HTTP {status}: {body[:200].decode(errors='replace')}")
        if len(body) > MAX_MESSAGE_BYTES:
            raise FramingError(f"a message of more than {MAX_MESSAGE_BYTES} bytes")
        if _is_goodbye(body):
            raise ClientGone("the client stopped")
        return body

    def close(self) -> None:
        """Close the connection; a client that waits for an event sees that the process has ended."""
        self._connection.close()

    def _wait(self) -> None:
        """Wait until the client answers, as long as it exists."""
        socket = self._connection.sock
        if socket is None:
            raise ClientGone("the client closed the connection")
        poll = select.poll()
        poll.register(socket, select.POLLIN)
        while not poll.poll(_WATCH_MS):
            if self._is_orphan():
                raise ClientGone("the client is gone")


def is_loopback(host: str) -> bool:
    """Return whether an address belongs to this machine alone."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _is_goodbye(body: bytes) -> bool:
    """Return whether the message is the one that `Server.stop` sends, which has no action."""
    if len(body) > 64:
        return False
    try:
        message = json.loads(body)
    except ValueError:
        return False
    return isinstance(message, dict) and message.keys() <= {"sequenceId"}


def _form(fields: Iterable[Field], token: str, boundary: str) -> bytes:
    """Return a multipart form, with headers spelled as the client's parser needs them."""
    parts: list[bytes] = []

    def add(kind: str, disposition: str, content: bytes) -> None:
        head = f"--{boundary}\r\nContent-Type: {kind}\r\nContent-disposition: form-data; {disposition}\r\n\r\n"
        parts.extend((head.encode(), content, b"\r\n"))

    for field_type, body in fields:
        if field_type is FieldType.METADATA:
            add('text/plain; charset="utf-8"', 'name="metadata"', _json_of(body))
        else:
            name = _NAMES[field_type]
            add(
                "application/octet-stream",
                f'name="{name}"; filename="{name}"',
                body if isinstance(body, bytes) else body.tobytes(),
            )
    add('text/plain; charset="utf-8"', 'name="token"', token.encode())
    parts.append(f"--{boundary}--\r\n".encode())
    return b"".join(parts)


def _json_of(packed: Body) -> bytes:
    """Return metadata, which the engine packs for the FIFO transport, as JSON."""
    metadata = msgpack.unpackb(packed, strict_map_key=False, unicode_errors="surrogatepass")
    try:
        return to_json(metadata, inf_nan_mode="constants")
    except ValueError:  # half of a surrogate pair, which JSON can express and UTF-8 cannot
        return json.dumps(metadata, separators=(",", ":")).encode()
