"""Serve the part of OpenAI's API that evonav uses, and misbehave on request.

It lets everything between an agent and a model be tried without a key: `python -m
evonav.decision.vlm.mock_server`. Tests script it.
"""

import json
import random
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Annotated, Any

import typer

from evonav.counted import counted
from evonav.decision.noisy import read_rates
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.errors import InvalidArgumentError

HOST = "127.0.0.1"

JsonObject = dict[str, Any]

MockReply = dict[str, Any]
"""The server's reaction to a request; every key is optional:

`text` or whole `message` of the answer, `finish_reason`; `status`, `headers` and `raw` bytes of the response; `cut`:
bytes announced but not sent, then the connection is closed; `hang_s`: seconds before anything is sent."""

FAULTS: dict[str, MockReply] = {
    "rate_limit": {
        "status": 429,
        "headers": {"Retry-After": "1"},
        "raw": b'{"error": {"message": "Rate limit reached", "type": "requests", "code": "rate_limit_exceeded"}}',
    },
    "server_error": {
        "status": 500,
        "raw": b'{"error": {"message": "The server had an error", "type": "server_error"}}',
    },
    "hang": {"text": "Too late.", "hang_s": 3600.0},
    "disconnect": {"raw": b'{"choices": [', "cut": 1000},
    "malformed": {"raw": b'{"id": "chatcmpl-1", "choices": [{"mess'},
    "broken_json": {"text": '{"answer": "Obj'},
    "truncated": {"text": "I think that the", "finish_reason": "length"},
    "refusal": {"message": {"role": "assistant", "content": None, "refusal": "I am sorry, I cannot help with that."}},
    "filtered": {"text": "", "finish_reason": "content_filter"},
    "empty": {"text": ""},
    "off_topic": {"text": "What a nice home! I would look in the kitchen first."},
}
"""Failures of models and servers, by name."""


class MockServer:
    """A mock server's behaviour, and the requests that it received."""

    def __init__(
        self, reply: Callable[[JsonObject], MockReply], check: Callable[[JsonObject], None] = lambda request: None
    ) -> None:
        """Create a server.

        Args:
            reply: Returns the reply to a request's body.
            check: Raises if a request is invalid; the server answers with 400 and the error's message.
        """
        self.reply = reply
        self.check = check
        self.script: list[MockReply] = []
        """Replies that come first, one a request."""
        self.requests: list[JsonObject] | None = []
        """Bodies of requests; `None` to store none."""
        self.keys: set[str] = set()
        """`Authorization` headers of requests."""
        self.num_requests = 0
        self.most_at_once = 0
        self.at_once = 0
        self.lock = threading.Lock()
        self.url = ""
        """URL of the API, once it serves."""

    def response(self, request: JsonObject) -> MockReply:
        """Return the reply to a request, by script or rule; 400 if the request is invalid."""
        with self.lock:
            self.num_requests += 1
            if self.requests is not None:
                self.requests.append(request)
            scripted = self.script.pop(0) if self.script else None
        try:
            self.check(request)
        except Exception as error:
            return {"status": 400, "raw": json.dumps({"error": {"message": str(error)[:300]}}).encode()}
        return self.reply(request) if scripted is None else scripted


def faulty(
    rates: Mapping[str, float], seed: int = 0, answer: Callable[[JsonObject], str] = mock_answer
) -> Callable[[JsonObject], MockReply]:
    """Return a function that replies as a faulty server does.

    Args:
        rates: Share of requests, by name in `FAULTS`.
        seed: Seed that selects the faulty requests, by their number.

    Raises:
        InvalidArgumentError: A fault is unknown, or the shares are not within 0 to 1.
    """
    for name, rate in rates.items():
        if name not in FAULTS:
            raise InvalidArgumentError(f"fault `{name}`: expected one of {', '.join(FAULTS)}")
        if not 0.0 <= rate <= 1.0:
            raise InvalidArgumentError(f"fault {name}: expected a share from 0 to 1, got {rate!r}")
    if sum(rates.values()) > 1.0:
        raise InvalidArgumentError(f"faults: shares add up to {sum(rates.values()):g}, more than 1")
    draws = random.Random(seed)  # noqa: S311 - not for secrets
    lock = threading.Lock()

    def reply(request: JsonObject) -> MockReply:
        with lock:
            share = draws.random()
        for name, rate in rates.items():
            if share < rate:
                return FAULTS[name]
            share -= rate
        return {"text": answer(request)}

    return reply


def without_schemas(request: JsonObject) -> None:
    """Check requests as a server does that supports no schema: `InvalidArgumentError` for a request with one."""
    if "response_format" in request:
        raise InvalidArgumentError("Unsupported parameter: 'response_format' of type 'json_schema'")


@contextmanager
def serving(server: MockServer, *, port: int = 0) -> Iterator[MockServer]:
    """Serve while the context lasts, at `server.url`; `InvalidArgumentError` if the port is not available."""
    try:
        http = _QuietServer((HOST, port), _handler(server))
    except OSError as error:
        raise InvalidArgumentError(f"{HOST}:{port}: {error}") from error
    server.url = f"http://{HOST}:{http.server_port}/v1"
    thread = threading.Thread(target=http.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        http.shutdown()
        http.server_close()
        thread.join()


class _QuietServer(ThreadingHTTPServer):
    """Prints no traceback for a client that has gone, as those of an interrupted run have."""

    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ANN401 - as in the library
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)


def _handler(server: MockServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        wbufsize = -1
        disable_nagle_algorithm = True

        def do_GET(self) -> None:
            models = {"object": "list", "data": [{"id": "mock", "object": "model", "created": 0, "owned_by": "evonav"}]}
            is_known = self.path == "/v1/models"
            self.send(200 if is_known else 404, json.dumps(models if is_known else {"error": {}}).encode())

        def do_POST(self) -> None:
            with server.lock:
                server.at_once += 1
                server.most_at_once = max(server.most_at_once, server.at_once)
            try:
                self.answer()
            finally:
                with server.lock:
                    server.at_once -= 1

        def answer(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            with server.lock:
                server.keys.add(self.headers.get("Authorization", ""))
            if self.path != "/v1/chat/completions":
                return self.send(404, json.dumps({"error": {"message": f"no {self.path} here"}}).encode())
            try:
                request = json.loads(body)
            except ValueError as error:
                return self.send(400, json.dumps({"error": {"message": str(error)}}).encode())
            reply = server.response(request)
            time.sleep(reply.get("hang_s", 0.0))
            raw = reply.get("raw") if "raw" in reply else json.dumps(_completion(request, reply)).encode()
            return self.send(reply.get("status", 200), raw or b"", reply.get("headers", {}), reply.get("cut", 0))

        def send(self, status: int, data: bytes, headers: Mapping[str, str] | None = None, cut: int = 0) -> None:
            self.send_response(status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(data) + cut))
            for name, value in (headers or {}).items():
                self.send_header(name, value)
            try:
                self.end_headers()
                self.wfile.write(data)
                self.wfile.flush()
            except (BrokenPipeError, ConnectionResetError):
                pass  # the client did not wait
            self.close_connection = cut > 0

        def log_message(self, *_: object) -> None:
            pass

    return Handler


def _completion(request: JsonObject, reply: MockReply) -> JsonObject:
    message = reply.get("message", {"role": "assistant", "content": reply.get("text"), "refusal": None})
    model = request.get("model", "mock")
    return {
        "id": "chatcmpl-1",
        "object": "chat.completion",
        "created": 0,
        "model": f"{model}-2024-08-06",
        "system_fingerprint": "fp_1",
        "choices": [{"index": 0, "message": message, "finish_reason": reply.get("finish_reason", "stop")}],
        "usage": {"prompt_tokens": 1000, "completion_tokens": 100, "total_tokens": 1100},
    }


def main(
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="Port; 0 takes any free one.")] = 8000,
    faults: Annotated[
        str, typer.Option(metavar="NAME=RATE", help="Share of requests that fail, such as refusal=0.1,rate_limit=0.05.")
    ] = "",
    schemas: Annotated[
        bool,
        typer.Option(help="Accept JSON Schemas and follow them; with --no-schemas reject them, as some servers do."),
    ] = True,
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Seed that decides which requests fail.")] = 0,
    latency: Annotated[float, typer.Option(min=0.0, metavar="X", help="Seconds before each answer.")] = 0.0,
) -> None:
    """Serve a simulated model, to test runs that ask one.

    It has an OpenAI-compatible API on this machine and answers by rules. Faults: rate_limit (429 with Retry-After),
    server_error (500), hang, disconnect, malformed (broken JSON around the answer), broken_json (in it), truncated,
    refusal, filtered, empty, off_topic.
    """

    def answer(request: JsonObject) -> str:
        time.sleep(latency)
        return mock_answer(request)

    try:
        rates = read_rates(faults, list(FAULTS))
    except InvalidArgumentError as error:
        raise typer.BadParameter(f"--faults {error}") from None
    server = MockServer(faulty(rates, seed, answer))
    server.requests = None
    if not schemas:
        server.check = without_schemas
    with serving(server, port=port):
        typer.echo(f"serving {server.url}; in another terminal:")
        typer.echo(f"  evonav evaluate --decision vlm --model mock --base-url {server.url} --limit 1 --out out/mock")
        try:
            while True:
                time.sleep(3600.0)
        except KeyboardInterrupt:
            typer.echo(f"{counted(server.num_requests, 'request')} served")


if __name__ == "__main__":
    typer.run(main)
