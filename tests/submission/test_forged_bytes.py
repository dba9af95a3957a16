"""Packed runs in other bytes than evonav writes: `verify` rejects each of them."""

import gzip
import os
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
from forged_pack import ForgedPack, assert_rejected, gzipped

from evonav.agents.hosting.serving import peak_memory_mb
from evonav.submission import file
from evonav.submission.file import MAX_HEADER_BYTES, MAX_LINE_BYTES, MAX_VALUES
from evonav.submission.verify import verify
from evonav.tasks.listing import TaskFile

RECORDS: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "other line ends": (lambda text: text.replace(b"\n", b"\r\n"), "line 2: not as evonav writes"),
    "no last line end": (lambda text: text[:-1], "line 15: without an end"),
    "an empty line": (lambda text: text + b"\n", "line 16: Invalid JSON"),
    "a mark at the start": (lambda text: b"\xef\xbb\xbf" + text, "line 2: Invalid JSON"),
    "no UTF-8": (lambda text: text.replace(b'"fu"', b'"f\xfc"', 1), "line 2: Invalid JSON: invalid unicode"),
    "cut": (lambda text: text[: len(text) // 2] + b"\n", "Invalid JSON"),
    "blanks": (lambda text: text.replace(b":", b": ", 1), "not as evonav writes"),
    "a key twice": (lambda text: text.replace(b"{", b'{"spl":1.0,', 1), "not as evonav writes"),
    "escaped letters": (lambda text: text.replace(b'"fu"', b'"\\u0066u"', 1), "not as evonav writes"),
    "a number in other digits": (
        lambda text: text.replace(b'"round":0', b'"round":0e0', 1),
        r"= 0\.0: .*integer",
    ),
    "nesting": (lambda text: text.replace(b'"details":{', b'"details":{"x":' + b"[" * 10**5, 1), "recursion limit"),
    "too many values": (
        lambda text: text.replace(b'"details":{', b'"details":{"x":[' + b"0,7," * MAX_VALUES + b"0],", 1),
        "2000000 values",
    ),
    "half of a letter": (lambda text: text.replace(b'"fu"', b'"\\ud800"', 1), "Invalid JSON"),
    "a line without an end in sight": (lambda _: b" " * (MAX_LINE_BYTES + 10**6), "line 2: longer than 50000000 B"),
}


@pytest.mark.parametrize("name", RECORDS)
def test_records_in_other_bytes_are_rejected(
    parts: ForgedPack, tasks: list[TaskFile], tmp_path: Path, name: str
) -> None:
    forge, reason = RECORDS[name]
    header, *records = parts.lines()
    before = b"".join(line + b"\n" for line in records)
    after = forge(before)
    assert after != before
    path = gzipped(tmp_path / "f.gz", header + b"\n" + after)
    assert_rejected(verify(path, tasks, scores_only=True), "file", reason)


HEADERS: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "a key twice": (lambda text: text.replace(b"{", b'{"evonav":"9.9",', 1), "not as evonav writes"),
    "blanks": (lambda text: text.replace(b":", b": ", 1), "not as evonav writes"),
    "infinity": (lambda text: text.replace(b'"seed":0', b'"seed":1e999'), "not as evonav writes"),
    "no number": (lambda text: text.replace(b'"seed":0', b'"seed":NaN'), "not as evonav writes"),
    "nesting": (lambda text: text.replace(b'"seed":0', b'"seed":' + b"[" * 10**5 + b"]" * 10**5), "recursion limit"),
    "too many values": (
        lambda text: text.replace(b'"seed":0', b'"seed":[' + b"0," * MAX_VALUES + b"0]"),
        "2000000 values",
    ),
    "too large": (lambda text: text + b" " * MAX_HEADER_BYTES, "longer than 8388608 B"),
    "half of it": (lambda text: text[: len(text) // 2], "Invalid JSON"),
    "no JSON": (lambda _: b"\xff\xfe", "Invalid JSON"),
    "a list": (lambda _: b"[]", "object"),
    "nothing": (lambda _: b"", "Invalid JSON"),
    "half of a letter": (lambda text: text.replace(b'"title":""', b'"title":"\\ud800"'), "Invalid JSON"),
}


@pytest.mark.parametrize("name", HEADERS)
def test_a_header_in_other_bytes_is_rejected(
    parts: ForgedPack, tasks: list[TaskFile], tmp_path: Path, name: str
) -> None:
    forge, reason = HEADERS[name]
    before, *records = parts.lines()
    after = forge(before)
    assert after != before
    path = parts.write(tmp_path / "f.gz", [after, *records])
    assert_rejected(verify(path, tasks, scores_only=True), "file", f"line 1: .*{reason}|{reason}")


def with_bytes(change: Callable[[bytes], bytes]) -> Callable[[Path, Path], None]:
    return lambda packed, target: target.write_bytes(change(packed.read_bytes())) and None


def with_byte(place: int, value: int) -> Callable[[Path, Path], None]:
    """The file has another byte at a place, from the end if it is negative."""

    def change(data: bytes) -> bytes:
        changed = bytearray(data)
        changed[place] = value if data[place] != value else value ^ 1
        return bytes(changed)

    return with_bytes(change)


def pipe(_packed: Path, target: Path) -> None:
    os.mkfifo(target)


FILES: dict[str, tuple[Callable[[Path, Path], None], str]] = {
    "text": (lambda _, target: target.write_bytes(b"no gzip" * 9) and None, "Not a gzipped file"),
    "nothing": (lambda _, target: target.write_bytes(b"") and None, "it is empty"),
    "an empty archive": (lambda _, target: gzipped(target, b"") and None, "it is empty"),
    "no compression": (with_bytes(gzip.decompress), "Not a gzipped file"),
    "another compression": (with_bytes(lambda data: zlib.compress(gzip.decompress(data))), "Not a gzipped file"),
    "compressed twice": (with_bytes(gzip.compress), "line 1: "),
    "no file": (lambda _packed, _target: None, "No such file"),
    "a folder": (lambda _, target: target.mkdir(), "no regular file"),
    "a pipe": (pipe, "no regular file"),
    "a program before": (with_bytes(lambda data: b"#!/bin/sh\n" + data), "Not a gzipped file"),
    "cut": (with_bytes(lambda data: data[: len(data) // 2]), "ended before"),
    "cut by a byte": (with_bytes(lambda data: data[:-1]), "ended before"),
    "cut in its first bytes": (with_bytes(lambda data: data[:6]), "damaged"),
    "more behind": (with_bytes(lambda data: data + b"\n"), "Not a gzipped file"),
    "another pack behind": (with_bytes(lambda data: data + data), "line 16: agents: Extra inputs|line 16: "),
    "records behind": (with_bytes(lambda data: data + gzip.compress(b"{}\n")), "line 16: missing"),
    "another method": (with_byte(2, 9), "compression method"),
    "another checksum": (with_byte(-8, 0), "CRC check failed"),
    "another size": (with_byte(-4, 0), "length of data"),
    "a flipped bit": (with_bytes(lambda data: data[:-99] + bytes([data[-99] ^ 64]) + data[-98:]), r"line \d+: "),
}


@pytest.mark.parametrize("name", FILES)
def test_a_forged_file_is_rejected(packed: Path, tasks: list[TaskFile], tmp_path: Path, name: str) -> None:
    forge, reason = FILES[name]
    target = tmp_path / "f.gz"
    forge(packed, target)
    assert_rejected(verify(target, tasks, scores_only=True), "file", reason)


@pytest.mark.parametrize("limit", [10**5, 10**4])
def test_a_file_beyond_the_limit_is_rejected(
    packed: Path, tasks: list[TaskFile], monkeypatch: pytest.MonkeyPatch, limit: int
) -> None:
    """By what it unpacks to, and by what it takes."""
    assert len(gzip.decompress(packed.read_bytes())) > 10**5 > packed.stat().st_size > 10**4
    monkeypatch.setattr(file, "MAX_TOTAL_BYTES", limit)
    assert_rejected(verify(packed, tasks, scores_only=True), "file", f"the limit is {limit}")


LARGE = {
    "text": b'"x":"' + b"y" * (MAX_LINE_BYTES - 10**6) + b'",',
    "lists": b'"x":[' + b"[]," * (MAX_VALUES // 2 - 10_000) + b"[]],",
    "numbers": b'"x":[' + b"0.1234567890123456," * (MAX_VALUES - 100_000) + b"0.5],",
}


VERIFY = """
import sys
from evonav.agents.hosting.serving import peak_memory_mb
from evonav.cli import main
try:
    main()
finally:
    print(peak_memory_mb(), file=sys.stderr)
"""
"""What the system tells a parent of a child's memory includes the parent's own from before the start."""


@pytest.mark.skipif(peak_memory_mb() is None, reason="the system does not tell a process's memory")
@pytest.mark.parametrize("kind", LARGE)
def test_the_largest_records_are_read_in_little_memory(parts: ForgedPack, tmp_path: Path, kind: str) -> None:
    """What an agent says of itself is no part of a score, so the file is accepted."""
    header, first, *others = parts.lines()
    large = first.replace(b'"details":{', b'"details":{' + LARGE[kind], 1)
    path = parts.write(tmp_path / "f.gz", [header, large, *others])
    command = [sys.executable, "-c", VERIFY, "verify", str(path), "--scores-only", "--limit", "2"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert float(done.stderr.split()[-1]) < 500
