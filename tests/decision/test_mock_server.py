"""The mock server of a model is quiet about clients that go, and about nothing else."""

import socket
import struct
import time
from contextlib import suppress
from urllib.parse import urlsplit

import pytest

from evonav.decision.vlm import mock_server
from evonav.decision.vlm.mock_server import MockServer, serving


@pytest.mark.parametrize("is_broken", [False, True])
def test_a_client_that_goes_leaves_no_traceback(capfd, monkeypatch, is_broken):
    server = MockServer(lambda request: {"text": "yes"})
    if is_broken:
        monkeypatch.setattr(mock_server.json, "dumps", lambda value: 1 / 0)
    with serving(server):
        place = urlsplit(server.url)
        with socket.create_connection((place.hostname, place.port)) as client, suppress(OSError):
            client.sendall(b"GET /v1/models HTTP/1.1\r\nHost: here\r\n\r\n")
            client.recv(1000)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # the end is a reset
        time.sleep(0.3)
    said = capfd.readouterr().err
    assert ("ZeroDivisionError" in said) is is_broken
    assert "ConnectionResetError" not in said
