"""A key is in nothing that a run leaves behind, whatever the model's server makes of it.

The key of these tests has characters that JSON, URLs and base64 write in other ways.
"""

import base64
import gzip
import html
import json
import os
import random
import subprocess
import sys
import urllib.parse
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import short_stages

from evonav.cli.doctor import all_checks
from evonav.decision.prompts import Picture, Prompt
from evonav.decision.vlm.caching_client import ResponseCache
from evonav.decision.vlm.client import VlmClient, VlmConfig
from evonav.decision.vlm.errors import VlmError
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.decision.vlm.mock_server import MockReply
from evonav.decision.vlm.secrets import without_secrets
from evonav.errors import DecisionError
from vlm_stub import Stub, check_request, serving

KEY = "sk-Canary/+7Zq0123<&\"'456789abcdefgh=="
QUESTION = Prompt.of("What is this?", Picture(np.zeros((4, 4, 3), np.uint8)))

FORMS: dict[str, Callable[[str], str]] = {
    "as it is": lambda key: key,
    "header": lambda key: f"Authorization: Bearer {key}",
    "JSON": lambda key: json.dumps(key)[1:-1],
    "JSON with slashes escaped": lambda key: json.dumps(key)[1:-1].replace("/", "\\/"),
    "JSON escapes": lambda key: "".join(f"\\u{ord(letter):04X}" for letter in key),
    "JSON in JSON": lambda key: json.dumps(json.dumps({"key": key}))[1:-1],
    "JSON escapes in JSON": lambda key: "".join(f"\\\\u{ord(letter):04x}" for letter in key),
    "Python": lambda key: repr(f"Bearer {key}".encode()),
    "URL": lambda key: urllib.parse.quote(key, safe=""),
    "URL, every character": lambda key: "".join(f"%{ord(letter):02X}" for letter in key),
    "URL in a URL": lambda key: urllib.parse.quote(urllib.parse.quote(key, safe=""), safe=""),
    "HTML": lambda key: html.escape(key),
    "HTML codes": lambda key: "".join(f"&#{ord(letter)};" for letter in key),
    "hexadecimal": lambda key: key.encode().hex().upper(),
    "base64": lambda key: base64.b64encode(key.encode()).decode(),
    "base64 of the header": lambda key: base64.b64encode(f"Bearer {key}".encode()).decode(),
    "base64 within": lambda key: base64.b64encode(f"k={key}; x".encode()).decode(),
    "base64 of URLs": lambda key: base64.urlsafe_b64encode(f"B {key}".encode()).decode(),
    "base64 in lines": lambda key: base64.encodebytes(f"Authorization: Bearer {key}{'x' * 40}".encode()).decode(),
    "small letters": lambda key: key.lower(),
    "wrapped": lambda key: f"{key[:10]}\n  {key[10:]}",
    "cut": lambda key: key[:-5],
}


def traces_of(key: str) -> list[bytes]:
    """What must be nowhere: any 12 characters of the key in a row, in the usual forms."""
    parts = [key[at : at + 12] for at in range(len(key) - 11)]
    forms = [part.encode() for part in parts]
    forms += [form(part).encode() for part in parts for form in (FORMS["JSON"], FORMS["URL"], html.escape)]
    forms += [base64.b64encode(key.encode()[at : at + 12]) for at in range(len(key) - 11)]
    forms += [key.encode()[at : at + 12].hex().encode() for at in range(len(key) - 11)]
    return sorted(set(forms))


def assert_traceless(content: bytes, where: object = "") -> None:
    lower = content.lower()
    for trace in TRACES:
        assert trace.lower() not in lower, (where, trace, content[:200])


TRACES = traces_of(KEY)


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_a_secret_is_removed_and_nothing_else(form: str) -> None:
    told = FORMS[form](KEY)
    text = f'{{"error": "wrong key {told}."}}'
    left = without_secrets(text, [KEY])
    assert_traceless(left.encode())
    assert left.startswith('{"error": "')
    assert left.endswith('."}')
    assert without_secrets(text.replace(told, "sk-Can"), [KEY]) == text.replace(told, "sk-Can")


def test_texts_without_secrets_stay() -> None:
    text = "The mug is on the table. " * 100 + json.dumps({"answer": "object 3", "reason": "Cafe \u00e9 100%"})
    assert without_secrets(text, [KEY, "", "x", "table"]) == text


@pytest.fixture
def stub() -> Iterator[Stub]:
    with serving(lambda _: {"text": "A mug."}) as stub:
        yield stub


def leaking(told: str) -> list[MockReply]:
    """Replies of a server that repeats something, in each place where it can."""
    raw = json.dumps({"error": {"message": f"{told} is wrong", "code": told, "type": told, "param": told}}).encode()
    late = json.dumps({"error": {"message": "x" * (490 - len(told) // 2) + told}}).encode()
    no_wait = {"Retry-After-Ms": "1"}
    statuses: list[MockReply] = [
        {"status": status, "raw": body, "headers": {**no_wait, "X-Request-Id": "1"}}
        for status in (400, 401, 429, 500)
        for body in (raw, late, told.encode())
    ]
    return [
        *statuses,
        {"status": 307, "raw": raw, "headers": {"Location": f"http://127.0.0.1:9/{urllib.parse.quote(told)}"}},
        {"text": f"object 1\n{told}"},
        {"message": {"role": "assistant", "content": None, "refusal": f"I refuse {told}"}},
        {"message": {"role": told, "content": [told], told: told}},
        {"text": told, "finish_reason": told},
        {"raw": told.encode()},
        {"raw": f'{{"choices": "{told}'.encode()},
        {"raw": json.dumps([told]).encode()},
        {"raw": json.dumps({"choices": [], "usage": told, "model": told}).encode()},
        {"raw": told.encode(), "cut": 50},
    ]


@pytest.mark.parametrize(
    "form", [pytest.param(form, marks=() if form == "JSON" else pytest.mark.slow) for form in FORMS]
)
def test_no_error_answer_or_exchange_has_a_key_that_the_server_repeats(stub: Stub, tmp_path: Path, form: str) -> None:
    config = VlmConfig("m", base_url=stub.url, api_key=KEY, timeout_s=5.0, max_retries=0)
    store = ResponseCache(tmp_path / "exchanges.sqlite")
    client = VlmClient(config, store=store, mode="auto", keeps_failures=True)
    for number, reply in enumerate(leaking(FORMS[form](KEY))):
        stub.script = [reply]
        try:
            told = repr(client.ask(QUESTION, attempt=number))
        except VlmError as error:
            told = f"{error!r} {error} {error.message}"
        assert_traceless(told.encode(), reply)
    store.close()
    for path in tmp_path.iterdir():
        assert_traceless(path.read_bytes(), path)


def test_no_question_goes_to_the_server_that_another_one_names(stub: Stub) -> None:
    with serving(lambda _: {"text": "I heard you."}) as other:
        for status in (301, 302, 303, 307, 308):
            stub.script = [{"status": status, "headers": {"Location": f"{other.url}/chat/completions"}}]
            client = VlmClient(VlmConfig("m", base_url=stub.url, api_key=KEY))
            with pytest.raises(VlmError, match=r"bad_request: the server redirects to 127.0.0.1:\d+: give"):
                client.ask(QUESTION)
        assert other.num_requests == 0


def test_a_password_in_the_address_is_removed(stub: Stub) -> None:
    password = "Swordfish/1234567890"
    url = stub.url.replace("//", f"//me:{urllib.parse.quote(password, safe='')}@")
    stub.script = [{"status": 400, "raw": json.dumps({"error": {"message": f"no {password} here"}}).encode()}]
    with pytest.raises(VlmError) as caught:
        VlmClient(VlmConfig("m", base_url=url, api_key=KEY)).ask(QUESTION)
    assert "Swordfish" not in str(caught.value)


@pytest.mark.parametrize("broken", [f"{KEY}\nX-Evil: 1", f"{KEY}\u2026", f"{KEY}\x00"])
def test_a_key_that_no_header_can_hold_is_named_and_not_shown(stub: Stub, broken: str) -> None:
    with pytest.raises(DecisionError, match="OPENAI_API_KEY: holds characters that no key has") as caught:
        VlmClient(VlmConfig("m", base_url=stub.url, api_key=broken)).ask(QUESTION)
    assert_traceless(str(caught.value).encode())


def test_a_line_end_after_a_key_is_no_part_of_it(stub: Stub) -> None:
    assert VlmClient(VlmConfig("m", base_url=stub.url, api_key=f"{KEY}\r\n")).ask(QUESTION) == "A mug."
    assert stub.keys == {f"Bearer {KEY}"}


def test_doctor_sends_no_key_to_another_server(stub: Stub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stub knows `/v1/models` alone, and sends everybody else on."""
    from http.server import BaseHTTPRequestHandler, HTTPServer
    from threading import Thread

    heard = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            heard.append((self.path, self.headers.get("Authorization")))
            self.send_response(302 if self.path == "/v1/models" else 200)
            self.send_header("Location", f"http://localhost:{server.server_port}/elsewhere")
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    Thread(target=server.serve_forever, daemon=True).start()
    for key in (KEY, f"{KEY}\nX: 1"):
        monkeypatch.setenv("OPENAI_API_KEY", key)
        checks = list(all_checks(tmp_path, base_url=f"http://127.0.0.1:{server.server_port}/v1"))
        assert_traceless(repr(checks).encode())
    server.shutdown()
    server.server_close()
    assert heard == [("/v1/models", f"Bearer {KEY}")]


def contents(path: Path) -> Iterator[bytes]:
    yield path.read_bytes()
    if path.suffix == ".gz":
        yield gzip.decompress(path.read_bytes())


@pytest.mark.slow
def test_a_run_against_a_leaking_server_leaves_no_trace_of_its_key(tmp_path: Path) -> None:
    """Command, processes, records, logs, exchanges, pages, packed file."""
    draws = random.Random(1)
    # A connection that is cut is tried again after seconds, and 401 ends a stage at once.
    replies = [
        reply
        for form in FORMS.values()
        for reply in leaking(form(KEY))
        if reply.get("status") != 401 and "cut" not in reply
    ]
    told: list[tuple[object, int, bytes]] = []
    environment = {**os.environ, "OPENAI_API_KEY": KEY, "PYTHONPATH": str(Path(short_stages.__file__).parent)}
    rate = 0.0

    def reply(request: dict[str, Any]) -> MockReply:
        form = FORMS[draws.choice(list(FORMS))]
        return draws.choice(replies) if draws.random() < rate else {"text": f"{mock_answer(request)}\n{form(KEY)}"}

    def evonav(*words: object) -> None:
        command = [sys.executable, "-m", "short_stages", *map(str, words)]
        done = subprocess.run(command, capture_output=True, cwd=tmp_path, env=environment, check=False)
        assert_traceless(done.stdout + done.stderr, words)
        told.append((words[0], done.returncode, done.stderr[-500:]))

    with serving(reply) as stub:
        stub.check = check_request
        given = ("--decision", "vlm", "--model", "m", "--base-url", stub.url, "--limit", 1, "--workers", 1)
        evonav("evaluate", "--agent", "fu", *given, "--out", "run")
        rate = 0.2
        evonav("evaluate", "--agent", "msgnav,unigoal", *given, "--out", "broken")
        assert stub.num_requests > 50
        assert stub.keys == {f"Bearer {KEY}"}
    for run in ("run", "broken"):
        evonav("failures", run)
        evonav("report", run)
    evonav("view", "run")
    evonav("pack", "run")
    assert [code for _, code, _ in told] == [0, 3, 0, 0, 0, 0, 0, 0], told
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert {"records.sqlite", "exchanges.sqlite", "index.html", "run.evonav.jsonl.gz"} <= {
        path.name for path in files
    }, told
    for path in files:
        for content in contents(path):
            assert_traceless(content, path)
            assert stub.url.encode() not in content, path
