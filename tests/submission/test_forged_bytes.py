"""Packed runs with records in other bytes, or in archives that others read otherwise: `verify` rejects each of them."""

import os
import struct
import subprocess
import sys
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from forged_pack import ForgedPack, assert_rejected, zipped

from evonav.agents.hosting.serving import peak_memory_mb
from evonav.submission.archive import MAX_LIST_BYTES, MAX_RATIO
from evonav.submission.file import MAX_LINE_BYTES, MAX_VALUES
from evonav.submission.verify import verify
from evonav.tasks.listing import TaskFile

LINES: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "other line ends": (lambda text: text.replace(b"\n", b"\r\n"), "not as evonav writes"),
    "no last line end": (lambda text: text[:-1], "a line without an end"),
    "an empty line": (lambda text: text + b"\n", "line 8: Invalid JSON"),
    "a mark at the start": (lambda text: b"\xef\xbb\xbf" + text, "Invalid JSON"),
    "no UTF-8": (lambda text: text.replace(b'"fu"', b'"f\xfc"', 1), "not UTF-8"),
    "cut": (lambda text: text[: len(text) // 2] + b"\n", "Invalid JSON"),
    "blanks": (lambda text: text.replace(b":", b": ", 1), "not as evonav writes"),
    "a key twice": (lambda text: text.replace(b"{", b'{"spl":1.0,', 1), "not as evonav writes"),
    "escaped letters": (lambda text: text.replace(b'"fu"', b'"\\u0066u"', 1), "not as evonav writes"),
    "a number in other digits": (lambda text: text.replace(b'"round":0', b'"round":0e0', 1), "not as evonav writes"),
    "nesting": (lambda text: text.replace(b'"details":{', b'"details":{"x":' + b"[" * 10**5, 1), "recursion limit"),
    "too many values": (
        lambda text: text.replace(b'"details":{', b'"details":{"x":[' + b"0,7," * MAX_VALUES + b"0],", 1),
        "2000000 values",
    ),
    "half of a letter": (lambda text: text.replace(b'"fu"', b'"\\ud800"', 1), "Invalid JSON"),
}


@pytest.mark.parametrize("name", LINES)
def test_records_in_other_bytes_are_rejected(
    parts: ForgedPack, tasks: list[TaskFile], tmp_path: Path, name: str
) -> None:
    forge, reason = LINES[name]
    members = parts.members()
    forged = forge(members[0])
    assert forged != members[0]
    header = parts.told([forged, members[1]])
    path = parts.write(tmp_path / "f.zip", header=header, members=[forged, members[1]])
    assert_rejected(verify(path, tasks, scores_only=True), "file", reason)


def contents(packed: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(packed) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def with_more(name: str) -> Callable[[Path, Path], None]:
    return lambda packed, target: zipped(target, {**contents(packed), name: b"x"}) and None


def with_bytes(change: Callable[[bytes], bytes]) -> Callable[[Path, Path], None]:
    return lambda packed, target: target.write_bytes(change(packed.read_bytes())) and None


def with_info(**fields: Any) -> Callable[[Path, Path], None]:
    """The records' member has other attributes."""

    def forge(packed: Path, target: Path) -> None:
        with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in contents(packed).items():
                info = zipfile.ZipInfo(name)
                info.compress_type = zipfile.ZIP_DEFLATED
                if name == "records/1.jsonl":
                    for field, value in fields.items():
                        setattr(info, field, value)
                archive.writestr(info, data)

    return forge


def in_list(offset: int, value: bytes) -> Callable[[Path, Path], None]:
    """The last member's entry in the list of members has other bytes at an offset."""

    def change(data: bytes) -> bytes:
        at = data.rindex(b"PK\1\2") + offset
        return data[:at] + value + data[at + len(value) :]

    return with_bytes(change)


def in_end(offset: int, value: bytes) -> Callable[[Path, Path], None]:
    return with_bytes(
        lambda data: data[: len(data) - 22 + offset] + value + data[len(data) - 22 + offset + len(value) :]
    )


def twice(packed: Path, target: Path) -> None:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, data in contents(packed).items():
            archive.writestr(name, data)
        archive.writestr("records/1.jsonl", b"x")


def bomb(packed: Path, target: Path) -> None:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in {**contents(packed), "records/1.jsonl": b" " * (MAX_RATIO * 40_000)}.items():
            archive.writestr(name, data)


def overlapping(packed: Path, target: Path) -> None:
    """Two members are the same bytes, as in archives that unpack to petabytes."""
    data = packed.read_bytes()
    first = data.index(b"PK\1\2")
    second = data.index(b"PK\1\2", first + 4)
    third = data.index(b"PK\1\2", second + 4)
    place = data[second + 42 : second + 46]
    target.write_bytes(data[: third + 42] + place + data[third + 46 :])


def other_local_name(packed: Path, target: Path) -> None:
    target.write_bytes(packed.read_bytes().replace(b"records/2.jsonl", b"records/9.jsonl", 1))


def gap(packed: Path, target: Path) -> None:
    """Bytes between the members and their list, which other readers take for a member."""
    data = packed.read_bytes()
    end = len(data) - 22
    start = struct.unpack("<I", data[end + 16 : end + 20])[0]
    moved = data[:end][:start] + b"hidden" + data[start:end]
    target.write_bytes(moved + data[end : end + 16] + struct.pack("<I", start + 6) + data[end + 20 :])


def comment(packed: Path, target: Path) -> None:
    target.write_bytes(packed.read_bytes())
    with zipfile.ZipFile(target, "a") as archive:
        archive.comment = b"read me"


def long_list(packed: Path, target: Path) -> None:
    with zipfile.ZipFile(target, "w") as archive:
        for number in range(MAX_LIST_BYTES // 60):
            archive.writestr(f"records/{number:07}.jsonl", b"")


def pipe(_packed: Path, target: Path) -> None:
    os.mkfifo(target)


ARCHIVES: dict[str, tuple[Callable[[Path, Path], None], str]] = {
    "text": (lambda _, target: target.write_bytes(b"not a zip" * 9) and None, "no end of a zip"),
    "nothing": (lambda _, target: target.write_bytes(b"") and None, "no end of a zip"),
    "an empty archive": (lambda _, target: zipped(target, {}) and None, "no submission.json"),
    "no file": (lambda _packed, _target: None, "No such file"),
    "a folder": (lambda _, target: target.mkdir(), "no regular file"),
    "a pipe": (pipe, "no regular file"),
    "cut": (with_bytes(lambda data: data[: len(data) // 2]), "no end of a zip"),
    "cut by a byte": (with_bytes(lambda data: data[:-1]), "no end of a zip"),
    "more behind": (with_bytes(lambda data: data + b"\n"), "more behind"),
    "a program before": (with_bytes(lambda data: b"#!/bin/sh\n" + data), "bytes before"),
    "a comment": (comment, "more behind"),
    "another archive behind": (with_bytes(lambda data: data + data), "bytes before the members, or a list"),
    "no header": (lambda packed, target: zipped(target, {"x": packed.read_bytes()}) and None, "no submission.json"),
    "a member more": (with_more("README"), "unknown: 'README'"),
    "a way out": (with_more("../x"), r"unknown: '\.\./x'"),
    "an absolute path": (with_more("/etc/x"), "unknown: '/etc/x'"),
    "a drive": (with_more("C:\\x"), "unknown: 'C:"),
    "another case": (with_more("Records/1.jsonl"), "unknown: 'Records/1.jsonl'"),
    "a name of other letters": (with_more("records/\u0661.jsonl"), "other compression|encrypted|not ASCII"),
    "a folder within": (with_more("records/"), "a link, a folder or a device"),
    "a member less": (
        lambda packed, target: zipped(target, {n: d for n, d in contents(packed).items() if "2" not in n}) and None,
        "missing or unknown: 'records/2.jsonl'",
    ),
    "a member twice": (twice, "'records/1.jsonl' is there twice"),
    "a link": (with_info(external_attr=0o120777 << 16), "a link"),
    "a device": (with_info(external_attr=0o020666 << 16), "a device"),
    "another compression": (with_info(compress_type=zipfile.ZIP_LZMA), "another compression"),
    "other fields": (with_info(extra=b"\x99\x99\x04\x00abcd"), "other fields"),
    "a member's comment": (with_info(comment=b"read me"), "a comment"),
    "encrypted": (in_list(8, b"\1"), "encrypted"),
    "patched data": (in_list(8, b"\x20"), "encrypted|compressed patched"),
    "a version to come": (in_list(6, b"\xff"), "version"),
    "another size": (in_list(24, b"\1\0\0\0"), "says of itself what the list"),
    "another checksum": (in_list(16, b"\1\2\3\4"), "says of itself what the list"),
    "a place beyond the file": (in_list(42, b"\xff\xff\xff\x7f"), "bytes between the members"),
    "another name inside": (other_local_name, "says of itself what the list"),
    "members in each other": (overlapping, "bytes between the members, or two in one"),
    "hidden bytes": (gap, "bytes between the members and their list"),
    "several parts": (in_end(4, b"\1"), "several parts"),
    "a list elsewhere": (in_end(16, b"\0\0\0\0"), "a list of them elsewhere"),
    "a long list": (long_list, "a list of members of"),
    "a list beyond the file": (in_end(12, b"\xff\xff\xff\xff"), "a list of members of 4294967295 B"),
    "a bomb": (bomb, r"records/1.jsonl': \d+ B from \d+"),
}


@pytest.mark.parametrize("name", ARCHIVES)
def test_a_forged_archive_is_rejected(packed: Path, tasks: list[TaskFile], tmp_path: Path, name: str) -> None:
    forge, reason = ARCHIVES[name]
    target = tmp_path / "f.zip"
    forge(packed, target)
    assert_rejected(verify(target, tasks, scores_only=True), "file", reason)


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
def test_the_largest_records_are_read_in_little_memory(packed: Path, tmp_path: Path, kind: str) -> None:
    """What an agent says of itself is no part of a score, so the file is accepted."""
    parts = ForgedPack.of(packed)
    members = parts.members()
    members[0] = members[0].replace(b'"details":{', b'"details":{' + LARGE[kind], 1)
    path = parts.write(tmp_path / "f.zip", header=parts.told(members), members=members)
    command = [sys.executable, "-c", VERIFY, "verify", str(path), "--scores-only", "--limit", "2"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert float(done.stderr.split()[-1]) < 500
