"""A real HTTP server that speaks `/v1/chat/completions`, and misbehaves on request."""

import base64
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from typing import Any

import jsonschema
from PIL import Image

KEY = "sk-test-0123456789abcdefghijklmnop"

PART = {
    "oneOf": [
        {
            "type": "object",
            "required": ["type", "text"],
            "additionalProperties": False,
            "properties": {"type": {"const": "text"}, "text": {"type": "string", "minLength": 1}},
        },
        {
            "type": "object",
            "required": ["type", "image_url"],
            "additionalProperties": False,
            "properties": {
                "type": {"const": "image_url"},
                "image_url": {
                    "type": "object",
                    "required": ["url"],
                    "additionalProperties": False,
                    "properties": {"url": {"type": "string"}, "detail": {"enum": ["auto", "low", "high"]}},
                },
            },
        },
    ]
}
REQUEST = {
    "type": "object",
    "required": ["model", "messages"],
    "additionalProperties": False,
    "properties": {
        "model": {"type": "string", "minLength": 1},
        "messages": {
            "type": "array",
            "minItems": 1,
            "items": {
                "type": "object",
                "required": ["role", "content"],
                "additionalProperties": False,
                "properties": {
                    "role": {"enum": ["system", "user", "assistant"]},
                    "content": {"oneOf": [{"type": "string"}, {"type": "array", "minItems": 1, "items": PART}]},
                },
            },
        },
        "temperature": {"type": "number", "minimum": 0, "maximum": 2},
        "seed": {"type": "integer"},
        "max_tokens": {"type": "integer", "minimum": 1},
        "max_completion_tokens": {"type": "integer", "minimum": 1},
        "top_p": {"type": "number", "minimum": 0, "maximum": 1},
        "response_format": {
            "type": "object",
            "required": ["type", "json_schema"],
            "additionalProperties": False,
            "properties": {
                "type": {"const": "json_schema"},
                "json_schema": {
                    "type": "object",
                    "required": ["name", "schema"],
                    "additionalProperties": False,
                    "properties": {
                        "name": {"type": "string", "pattern": "^[a-zA-Z0-9_-]{1,64}$"},
                        "strict": {"type": "boolean"},
                        "schema": {"type": "object"},
                    },
                },
            },
        },
    },
}
"""The part of OpenAI's published API that is used; anything else is refused with 400."""

_STRICT_KEYWORDS = {
    "type", "properties", "required", "additionalProperties", "items", "enum", "const", "anyOf", "description", "title",
    "pattern", "format", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "multipleOf", "minItems",
    "maxItems",
}  # fmt: skip
"""What the documentation of structured outputs lists; other keywords of JSON Schema are refused."""


def check_strict(schema: dict[str, Any]) -> None:
    """Holds a schema to what strict mode takes: closed objects, all required, known keywords, few values."""
    unknown = schema.keys() - _STRICT_KEYWORDS
    assert not unknown, f"response_format: keywords {sorted(unknown)} are not supported"
    if schema.get("type") == "object":
        properties = schema["properties"]
        assert schema.get("additionalProperties") is False, "response_format: additionalProperties must be false"
        assert schema.get("required") == list(properties), "response_format: every property must be required"
        for part in properties.values():
            check_strict(part)
    if schema.get("type") == "array":
        check_strict(schema["items"])
    for part in schema.get("anyOf", []):
        check_strict(part)
    assert len(schema.get("enum", [])) <= 1000, "response_format: too many values"
    assert schema.get("enum") != [], "response_format: enum must not be empty"


Reply = dict[str, Any]
"""`text` or `message`, `finish_reason`, `status`, `headers`, `raw` bytes, `cut` (announce more than is sent),
`hang_s`."""


def images_in(request: dict[str, Any]) -> list[Image.Image]:
    """Decoded, so that a broken image is an error."""
    images = []
    for message in request["messages"]:
        for part in message["content"] if isinstance(message["content"], list) else []:
            if part["type"] == "image_url":
                head, _, data = part["image_url"]["url"].partition(",")
                assert head == "data:image/png;base64", head
                image = Image.open(BytesIO(base64.b64decode(data, validate=True)))
                image.load()
                images.append(image)
    return images


class Stub:
    """What the server does and saw."""

    def __init__(self, reply: Callable[[dict[str, Any]], Reply]) -> None:
        self.reply = reply
        self.script: list[Reply] = []
        """Replies that come first, one a request."""
        self.requests: list[dict[str, Any]] = []
        self.keys: set[str] = set()
        self.most_at_once = 0
        self.at_once = 0
        self.lock = threading.Lock()
        self.url = ""


@contextmanager
def serving(reply: Callable[[dict[str, Any]], Reply]) -> Iterator[Stub]:
    stub = Stub(reply)

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        wbufsize = -1
        disable_nagle_algorithm = True

        def do_POST(self) -> None:
            with stub.lock:
                stub.at_once += 1
                stub.most_at_once = max(stub.most_at_once, stub.at_once)
            try:
                self.answer()
            finally:
                with stub.lock:
                    stub.at_once -= 1

        def answer(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            request = json.loads(body)
            with stub.lock:
                stub.keys.add(self.headers.get("Authorization", ""))
                stub.requests.append(request)
                scripted = stub.script.pop(0) if stub.script else None
            try:
                assert self.path == "/v1/chat/completions", self.path
                jsonschema.validate(request, REQUEST)
                images_in(request)
                if "response_format" in request:
                    schema = request["response_format"]["json_schema"]
                    assert not schema.get("strict") or schema["schema"]["type"] == "object"
                    check_strict(schema["schema"])
            except Exception as error:
                return self.send(400, json.dumps({"error": {"message": str(error)[:300]}}).encode())
            reply = stub.reply(request) if scripted is None else scripted
            time.sleep(reply.get("hang_s", 0.0))
            message = reply.get("message", {"role": "assistant", "content": reply.get("text"), "refusal": None})
            response = {
                "id": "chatcmpl-1",
                "object": "chat.completion",
                "created": 0,
                "model": request["model"] + "-2024-08-06",
                "system_fingerprint": "fp_1",
                "choices": [{"index": 0, "message": message, "finish_reason": reply.get("finish_reason", "stop")}],
                "usage": {"prompt_tokens": 1000, "completion_tokens": 100, "total_tokens": 1100},
            }
            data = reply.get("raw", json.dumps(response).encode())
            return self.send(reply.get("status", 200), data, reply.get("headers", {}), reply.get("cut", 0))

        def send(self, status: int, data: bytes, headers: dict[str, str] | None = None, cut: int = 0) -> None:
            self.send_response(status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(data) + cut))
            for name, value in (headers or {}).items():
                self.send_header(name, value)
            self.end_headers()
            try:
                self.wfile.write(data)
                self.wfile.flush()
            except (BrokenPipeError, ConnectionResetError):
                pass
            self.close_connection = cut > 0

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    stub.url = f"http://127.0.0.1:{server.server_port}/v1"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield stub
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
