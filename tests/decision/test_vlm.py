"""The client of models against a real HTTP server: what is sent, what is kept, and everything that goes wrong."""

import json
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from evonav.decision.prompts import Picture, Prompt, Turn
from evonav.decision.vlm.account import Account, Price, Usage, image_tokens, read_prices
from evonav.decision.vlm.caching_client import ResponseCache, key_of
from evonav.decision.vlm.client import VlmClient, VlmConfig
from evonav.decision.vlm.errors import VlmError
from evonav.errors import DecisionError, InvalidArgumentError, StoreError
from vlm_stub import KEY, Stub, images_in, serving

IMAGE = np.random.default_rng(0).integers(0, 256, (30, 40, 3), dtype=np.uint8)
QUESTION = Prompt.of("What is this?", Picture(IMAGE), "One word.")


@pytest.fixture
def stub() -> Iterator[Stub]:
    with serving(lambda request: {"text": f"A mug, seen {len(images_in(request))} times."}) as stub:
        yield stub


@pytest.fixture
def config(stub: Stub) -> VlmConfig:
    return VlmConfig("gpt-4o", base_url=stub.url, api_key=KEY, timeout_s=5.0, max_retries=2)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "deep" / "exchanges.sqlite"


def told(client: VlmClient, question: Prompt = QUESTION) -> str:
    with pytest.raises(VlmError) as caught:
        client.ask(question)
    assert KEY not in str(caught.value)
    assert isinstance(caught.value, DecisionError)
    return caught.value.kind


def test_asks_and_counts(stub: Stub, config: VlmConfig) -> None:
    client = VlmClient(config, account=Account(Price(2.5, 10.0)))
    assert client.ask(QUESTION) == "A mug, seen 1 times."
    assert client.account.usage == Usage(1000, 100)
    assert client.account.cost_usd == pytest.approx(0.0035)
    assert stub.keys == {f"Bearer {KEY}"}
    (request,) = stub.requests
    assert np.array_equal(np.asarray(images_in(request)[0]), IMAGE)
    assert [part["type"] for part in request["messages"][0]["content"]] == ["text", "image_url", "text"]
    assert {**request, "messages": 0} == {
        "model": "gpt-4o",
        "messages": 0,
        "temperature": 0.0,
        "seed": 0,
        "max_tokens": 300,
    }


def test_conversations_and_schemas_are_sent(stub: Stub, config: VlmConfig) -> None:
    schema = {
        "type": "object",
        "properties": {"index": {"type": "integer"}},
        "required": ["index"],
        "additionalProperties": False,
    }
    question = Prompt((Turn("system", ("Be brief.",)), *QUESTION.turns), schema).then("Mug.", "Sure?")
    other = replace(config, temperature=None, seed=None, max_tokens_field="max_completion_tokens")
    VlmClient(other).ask(question)
    (request,) = stub.requests
    assert [message["role"] for message in request["messages"]] == ["system", "user", "assistant", "user"]
    assert request["messages"][2]["content"] == "Mug."
    assert request["response_format"]["json_schema"]["schema"] == schema
    assert request["max_completion_tokens"] == 300
    assert not {"temperature", "seed", "max_tokens"} & request.keys()


def test_what_was_kept_is_had_again_without_a_server(config: VlmConfig, path: Path) -> None:
    with serving(lambda _: {"text": "A mug. ☕"}) as stub:
        store = ResponseCache(path)
        first = VlmClient(replace(config, base_url=stub.url), store=store, mode="record").ask(QUESTION)
        store.close()
    store = ResponseCache(path)
    # Nobody listens there any more, and a replay does not even need a key.
    client = VlmClient(replace(config, base_url=stub.url, api_key=None), store=store, mode="replay")
    assert client.ask(QUESTION) == first == "A mug. ☕"
    assert (client.account.usage, client.account.num_replayed) == (Usage(), 1)
    assert told(client, Prompt.of("And this?")) == "not_recorded"
    assert told(client, Prompt.of("What is this?", Picture(IMAGE[::-1]), "One word.")) == "not_recorded"
    # Where the answer comes from is no part of the question, but the model is.
    assert VlmClient(replace(config, base_url="http://elsewhere"), store=store, mode="replay").is_cached(QUESTION)
    assert not VlmClient(replace(config, model="other"), store=store, mode="replay").is_cached(QUESTION)


def test_replay_imports_no_client(config: VlmConfig, path: Path) -> None:
    VlmClient(config, store=ResponseCache(path), mode="record").ask(Prompt.of("Hello?"))
    script = f"""
import sys
from evonav.decision.vlm.caching_client import ResponseCache
from evonav.decision.prompts import Prompt
from evonav.decision.vlm.client import VlmClient, VlmConfig
client = VlmClient(VlmConfig("gpt-4o"), store=ResponseCache({str(path)!r}), mode="replay")
print(client.ask(Prompt.of("Hello?")))
assert not {{"openai", "httpx", "httpx2"}} & sys.modules.keys()
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout == "A mug, seen 0 times.\n"


def test_modes(stub: Stub, config: VlmConfig, path: Path) -> None:
    store = ResponseCache(path)
    VlmClient(config, store=store, mode="live").ask(QUESTION)
    assert len(store) == 0
    auto = VlmClient(config, store=store)
    assert len({auto.ask(QUESTION) for _ in range(3)}) == 1
    assert (len(stub.requests), auto.account.num_replayed) == (2, 2)
    VlmClient(config, store=store, mode="record").ask(QUESTION)
    assert (len(stub.requests), len(store)) == (3, 1)
    with pytest.raises(InvalidArgumentError, match="needs a file"):
        VlmClient(config, mode="replay")
    with pytest.raises(InvalidArgumentError, match="expected one of"):
        VlmClient(config, store=store, mode="sometimes")


def test_the_same_exchanges_make_the_same_rows_and_images_are_kept_once(config: VlmConfig, tmp_path: Path) -> None:
    dumps = []
    for order in (1, -1):
        store = ResponseCache(tmp_path / f"{order}.sqlite")
        client = VlmClient(config, store=store, mode="record")
        questions = [Prompt.of(f"Number {i}?", Picture(IMAGE)) for i in range(4)]
        for question in questions[::order]:
            client.ask(question)
        store.close()
        with sqlite3.connect(store.path) as db:
            dumps.append(sorted(db.iterdump()))
            ((name, file),) = db.execute("SELECT name, file FROM pictures").fetchall()
        assert name == Picture(IMAGE).name
        assert np.array_equal(np.asarray(Image.open(BytesIO(file))), IMAGE)
        db.close()
    assert dumps[0] == dumps[1]


def test_an_image_that_an_agent_keeps_as_a_file_is_stored_as_that_file(tmp_path: Path) -> None:
    path = tmp_path / "exchanges.sqlite"
    buffer = BytesIO()
    Image.fromarray(IMAGE).save(buffer, "JPEG")
    picture = Picture(buffer.getvalue())
    with sqlite3.connect(path) as db:  # of an earlier version
        db.execute("CREATE TABLE pictures (name TEXT PRIMARY KEY, webp BLOB NOT NULL) STRICT")
    store = ResponseCache(path)
    store.store({"n": 1}, (picture,), {})
    store.close()
    with sqlite3.connect(path) as db:
        assert db.execute("SELECT * FROM pictures").fetchall() == [(picture.name, picture.source)]
    db.close()


def test_keys_are_in_no_file_and_no_words(stub: Stub, config: VlmConfig, path: Path) -> None:
    stub.script = [{"status": 401, "raw": json.dumps({"error": {"message": f"Incorrect key: {KEY}"}}).encode()}]
    client = VlmClient(config, store=ResponseCache(path))
    assert told(client) == "unauthorized"
    # Not even if the model says them, or a server that fails.
    stub.script = [
        {"text": f"Your key is {KEY}, and I live at {stub.url}."},
        {"status": 500, "raw": f"{KEY} at {stub.url}".encode(), "headers": {"Retry-After-Ms": "5"}},
    ]
    assert client.ask(QUESTION) == "Your key is ***, and I live at ***."
    keeping = VlmClient(replace(config, max_retries=0), store=client.store, keeps_failures=True)
    assert told(keeping, Prompt.of("Well?")) == "server"
    assert client.store.num_failures == 1
    client.store.close()
    assert KEY not in repr(config)
    assert KEY not in repr(client)
    for file in path.parent.iterdir():
        assert KEY.encode() not in file.read_bytes()
        assert stub.url.encode() not in file.read_bytes()


def test_a_key_of_one_letter_leaves_answers_whole(config: VlmConfig, stub: Stub) -> None:
    stub.script = [{"text": "Continue Exploration"}]
    assert VlmClient(replace(config, api_key="x")).ask(Prompt.of("?")) == "Continue Exploration"


def test_keys_come_from_the_environment(stub: Stub, config: VlmConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-from-environment")
    monkeypatch.setenv("OPENAI_BASE_URL", stub.url)
    VlmClient(replace(config, base_url=None, api_key=None)).ask(QUESTION)
    assert stub.keys == {"Bearer sk-from-environment"}
    monkeypatch.delenv("OPENAI_API_KEY")
    monkeypatch.delenv("OPENAI_BASE_URL")
    with pytest.raises(DecisionError, match="OPENAI_API_KEY"):
        VlmClient(replace(config, base_url=None, api_key=None)).ask(QUESTION)


@pytest.mark.parametrize(
    "fault",
    [
        {"status": 429, "headers": {"Retry-After": "1"}, "raw": b'{"error": {"message": "slow down"}}'},
        {"status": 429, "headers": {"Retry-After-Ms": "5"}, "raw": b"{}"},
        {"status": 500, "headers": {"Retry-After-Ms": "5"}, "raw": b"oops"},
        {"status": 503, "headers": {"Retry-After-Ms": "5"}, "raw": b""},
        {"raw": b'{"choices": [', "cut": 100},
    ],
)
def test_passing_faults_are_tried_again(stub: Stub, config: VlmConfig, fault: dict[str, Any]) -> None:
    stub.script = [fault]
    client = VlmClient(config)
    began_s = time.monotonic()
    assert client.ask(QUESTION).startswith("A mug")
    assert len(stub.requests) == 2
    # By itself the client would wait half a second at most.
    assert time.monotonic() - began_s > float(fault.get("headers", {}).get("Retry-After", 0.0)) - 0.05
    assert client.account.num_asked == 1


@pytest.mark.parametrize(
    ("reply", "kind"),
    [
        (
            {"status": 429, "raw": b'{"error": {"message": "quota"}}', "headers": {"Retry-After-Ms": "5"}},
            "rate_limited",
        ),
        (
            {
                "status": 429,
                "raw": b'{"error": {"message": "You exceeded your quota", "code": "insufficient_quota"}}',
                "headers": {"Retry-After-Ms": "5"},
            },
            "over_budget",
        ),
        ({"status": 500, "raw": b"oops", "headers": {"Retry-After-Ms": "5"}}, "server"),
        ({"status": 502, "raw": b"<html>", "headers": {"Retry-After-Ms": "5"}}, "server"),
        ({"status": 400, "raw": b'{"error": {"message": "no such model"}}'}, "bad_request"),
        ({"status": 403, "raw": b"{}"}, "unauthorized"),
        ({"status": 404, "raw": b"{}"}, "bad_request"),
        ({"raw": b'{"choices": [', "cut": 100}, "connection"),
        ({"raw": b'{"choices": ['}, "malformed"),
        ({"raw": b""}, "malformed"),
        ({"raw": b"[]"}, "malformed"),
        ({"raw": b"[" * 100_000}, "malformed"),
        ({"raw": b"<html>hello</html>"}, "malformed"),
        ({"raw": b"\xff\xfe"}, "malformed"),
        ({"raw": b'{"choices": []}'}, "malformed"),
        ({"raw": b'{"choices": [{"message": "hi"}]}'}, "malformed"),
        ({"message": {"role": "assistant", "content": 7}}, "malformed"),
        ({"message": {"role": "assistant", "content": None, "refusal": "I cannot help."}}, "refusal"),
        ({"text": "A", "finish_reason": "content_filter"}, "refusal"),
        ({"text": "Please navigate to the", "finish_reason": "length"}, "truncated"),
        ({"text": ""}, "empty"),
        ({"text": " \n"}, "empty"),
        ({"text": None}, "empty"),
        ({"text": "x" * 2_000_000}, "oversized"),
    ],
)
def test_faults_that_stay_have_names(stub: Stub, config: VlmConfig, reply: dict[str, object], kind: str) -> None:
    stub.reply = lambda _: reply
    assert told(VlmClient(replace(config, max_retries=1))) == kind


def test_a_server_that_hangs_or_is_gone(stub: Stub, config: VlmConfig) -> None:
    stub.reply = lambda _: {"text": "late", "hang_s": 0.6}
    assert told(VlmClient(replace(config, timeout_s=0.1, max_retries=0))) == "timeout"
    assert told(VlmClient(replace(config, base_url="http://127.0.0.1:9/v1", max_retries=0))) == "connection"


def test_answers_that_are_none_are_kept_but_broken_ones_are_not(stub: Stub, config: VlmConfig, path: Path) -> None:
    client = VlmClient(config, store=ResponseCache(path))
    stub.script = [{"raw": b"{}"}, {"text": "No", "finish_reason": "length"}]
    assert [told(client) for _ in range(3)] == ["malformed", "truncated", "truncated"]
    assert len(stub.requests) == 2


def test_the_first_outcome_kept_is_everybodys(path: Path) -> None:
    """Two processes that asked the same: the second to come back takes over what the first has kept."""
    first, second = ResponseCache(path), ResponseCache(path)
    for number, (ours, theirs) in enumerate(
        (({"a": 1}, {"a": 2}), (VlmError("timeout", "late"), {"a": 3}), ({"a": 4}, VlmError("server", "500")))
    ):
        request = {"number": number}
        assert first.store(request, (), ours) is ours
        for stored in (second.store(request, (), theirs), second.outcome(key_of(request))):
            assert (str(stored), type(stored)) == (str(ours), type(ours))
    assert (len(first), first.num_failures) == (2, 1)


def test_a_cache_opens_while_another_process_creates_it(path: Path) -> None:
    """SQLite refuses to switch a file to WAL at once, whatever the timeout, while another connection writes."""
    path.parent.mkdir(exist_ok=True)
    other = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    other.execute("CREATE TABLE other (x)")
    other.execute("BEGIN IMMEDIATE")
    timer = threading.Timer(0.1, other.execute, ("COMMIT",))
    timer.start()
    assert len(ResponseCache(path)) == 0
    timer.join()
    assert sqlite3.connect(path).execute("PRAGMA journal_mode").fetchone() == ("wal",)


def test_no_more_questions_at_a_time_than_asked_for(stub: Stub, config: VlmConfig) -> None:
    stub.reply = lambda _: {"text": "Yes.", "hang_s": 0.03}
    client = VlmClient(replace(config, max_concurrency=3))
    with ThreadPoolExecutor(12) as pool:
        list(pool.map(lambda i: client.ask(Prompt.of(f"{i}?")), range(24)))
    assert stub.most_at_once == 3
    assert client.account.num_asked == 24
    assert client.account.usage == Usage(24_000, 2400)


def test_the_limit_is_not_passed(stub: Stub, config: VlmConfig) -> None:
    """A question costs 0.0035 $; before it is asked, 0.0059 $ are set aside."""
    account = Account(Price(2.5, 10.0), max_cost_usd=0.0104)
    client = VlmClient(replace(config, max_concurrency=8), account=account)
    kinds = []

    def ask(index: int) -> None:
        try:
            client.ask(Prompt.of(f"{index}? " + "word " * 700))
        except VlmError as error:
            kinds.append(error.kind)

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(ask, range(4)))
    # One after the other, when nothing is set aside any more.
    for index in range(4, 8):
        ask(index)
    assert account.cost_usd == pytest.approx(0.0070)
    assert set(kinds) == {"over_budget"}
    assert len(stub.requests) == account.num_asked == 8 - len(kinds)
    with pytest.raises(InvalidArgumentError, match="prices"):
        Account(max_cost_usd=1.0)


def test_estimates_hold_what_is_used(config: VlmConfig) -> None:
    estimate = VlmClient(config).estimate(Prompt.of("word " * 300, Picture(np.zeros((300, 300, 3), np.uint8))))
    assert estimate.input_tokens >= 300 + 255
    assert estimate.output_tokens == 300
    # The figures of OpenAI's documentation.
    assert [image_tokens(size, "high") for size in ((360, 360), (640, 480), (1280, 1280))] == [255, 425, 765]
    assert image_tokens((4000, 3000), "low") == 85


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "should be an object"),
        ("{", "no price table: Invalid JSON"),
        ('{"gpt-4o": 3}', r"gpt-4o = 3"),
        ('{"gpt-4o": {"input_usd": 1}}', r"gpt-4o\.output_usd"),
        ('{"gpt-4o": {"input_usd": -1, "output_usd": 1}}', r"gpt-4o\.input_usd = -1: Input should be greater"),
        (
            '{"gpt-4o": {"input_usd": NaN, "output_usd": 1}}',
            r"gpt-4o\.input_usd = nan: Input should be a finite",
        ),
    ],
)
def test_bad_price_tables_are_told(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "prices.json"
    path.write_text(text)
    with pytest.raises(InvalidArgumentError, match=message):
        read_prices(path)
    path.write_text('{"gpt-4o": {"input_usd": 2.5, "output_usd": 10}}')
    assert read_prices(path) == {"gpt-4o": Price(2.5, 10.0)}


def test_bad_settings_and_files_are_told(config: VlmConfig, tmp_path: Path) -> None:
    for changes in ({"timeout_s": 0.0}, {"max_retries": -1}, {"max_concurrency": 0}, {"model": ""}):
        with pytest.raises(InvalidArgumentError, match=next(iter(changes))):
            replace(config, **changes)
    (tmp_path / "text").write_text("no database, and long enough to be taken for one" * 20)
    with pytest.raises(StoreError, match="text"):
        ResponseCache(tmp_path / "text")
