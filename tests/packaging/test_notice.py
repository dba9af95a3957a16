"""NOTICE lists what a wheel needs, and Rust packages have licences that deny.toml allows. No network is used."""

import re
import sys
from pathlib import Path

import notice

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
RUST, PYTHON = (ROOT / "NOTICE").read_text(encoding="utf-8").split("\nPython packages")
LINE = re.compile(r"^    ([\w-]+)(?: (\S+))?: (.+)$", re.MULTILINE)


def test_notice_has_the_rust_packages_of_the_lock_file() -> None:
    assert [(name, version) for name, version, _ in LINE.findall(RUST)] == notice.rust_packages(), "make notice"
    assert len(notice.rust_packages()) > 50


def test_notice_has_the_python_packages_that_are_required() -> None:
    listed = {name: licence for name, _, licence in LINE.findall(PYTHON)}
    assert set(notice.required()) <= listed.keys(), "make notice"
    assert "unknown" not in listed.values()
    locked = re.findall(r"^([\w.-]+)==", (ROOT / "requirements-dev.txt").read_text(encoding="utf-8"), re.MULTILINE)
    assert listed.keys() <= {re.sub("[-_.]+", "-", name).lower() for name in locked}, "make notice"


def is_allowed(expression: str, allowed: set[str]) -> bool:
    """Whether a licence expression can be met: every part of an AND, any part of an OR."""
    inner = re.search(r"\(([^()]*)\)", expression)
    if inner is not None:
        value = "yes" if is_allowed(inner[1], allowed) else "no"
        return is_allowed(expression.replace(inner[0], value), allowed)
    parts = [[one.strip() for one in part.split(" OR ")] for part in expression.split(" AND ")]
    return all(any(one in allowed or one == "yes" for one in choices) for choices in parts)


def test_rust_packages_have_licences_that_are_allowed() -> None:
    allowed = set(tomllib.loads((ROOT / "deny.toml").read_text(encoding="utf-8"))["licenses"]["allow"])
    refused = [(name, licence) for name, _, licence in LINE.findall(RUST) if not is_allowed(licence, allowed)]
    assert refused == []
    assert not is_allowed("GPL-3.0", allowed)
    assert not is_allowed("(MIT OR GPL-3.0) AND AGPL-3.0", allowed)
    assert is_allowed("(GPL-3.0 OR MIT) AND Unicode-3.0", allowed)
