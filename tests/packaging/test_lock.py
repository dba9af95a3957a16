"""`requirements-dev.txt` holds one version of each package for every Python and system, and no address of an index."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from evonav.toml import tomllib

ROOT = Path(__file__).parents[2]
LOCK = "requirements-dev.txt"
SYSTEMS = {"linux": "Linux", "darwin": "Darwin", "win32": "Windows"}


@pytest.fixture(scope="module")
def pyproject() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def lines() -> list[str]:
    return (ROOT / LOCK).read_text(encoding="utf-8").splitlines()


def pythons(pyproject: dict[str, Any]) -> list[str]:
    names = pyproject["project"]["classifiers"]
    return [name.rpartition(" :: ")[2] for name in names if re.search(r"Python :: 3\.\d+$", name)]


def environment(python: str, platform: str) -> dict[str, str]:
    return {
        "python_version": python,
        "python_full_version": f"{python}.9",
        "sys_platform": platform,
        "platform_system": SYSTEMS[platform],
        "platform_machine": "x86_64",
        "implementation_name": "cpython",
        "platform_python_implementation": "CPython",
        "extra": "",
    }


def requirements(pyproject: dict[str, Any], group: str) -> list[Requirement]:
    """Return what a group asks for, with the groups that it includes."""
    found = []
    for one in pyproject["dependency-groups"][group]:
        found += [Requirement(one)] if isinstance(one, str) else requirements(pyproject, one["include-group"])
    return found


def test_every_requirement_has_one_version_that_it_allows(pyproject: dict[str, Any], lines: list[str]) -> None:
    pins = [Requirement(line) for line in lines if line and not line.lstrip().startswith("#")]
    assert all(re.fullmatch(r"==[\w.+!]+", str(pin.specifier)) for pin in pins)
    asked = [Requirement(text) for text in pyproject["project"]["dependencies"]] + requirements(pyproject, "dev")
    for python in pythons(pyproject):
        for platform in SYSTEMS:
            where = environment(python, platform)
            here = [pin for pin in pins if pin.marker is None or pin.marker.evaluate(where)]
            versions = {canonicalize_name(pin.name): str(pin.specifier)[2:] for pin in here}
            assert len(versions) == len(here), f"Python {python} on {platform}: a package has two versions"
            for one in asked:
                if one.marker is None or one.marker.evaluate(where):
                    version = versions.get(canonicalize_name(one.name))
                    assert version is not None, f"Python {python} on {platform}: {one} is missing: run `make lock`"
                    assert one.specifier.contains(version), f"{one}: {version} is locked: run `make lock`"


def test_the_lock_names_no_index(lines: list[str]) -> None:
    assert [line for line in lines if re.search(r"://|--(index|extra|find|trusted)", line)] == []


def test_make_dependabot_and_the_lock_agree(pyproject: dict[str, Any], lines: list[str]) -> None:
    """Dependabot repeats the command of the second line; Python versions after the last tested one are not locked."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    command = lines[1].lstrip("# ")
    assert command.startswith("uv pip compile pyproject.toml --universal --python-version ")
    assert f"$(BIN)/{command}" in makefile.replace(" --upgrade", "")
    first, *_, last = pythons(pyproject)
    assert f"--python-version {first} " in command
    after = f"3, {int(last.partition('.')[2]) + 1}"
    assert f"sys.version_info < ({after}) and print('--constraint {LOCK}')" in makefile
    updates = yaml.safe_load((ROOT / ".github" / "dependabot.yml").read_text(encoding="utf-8"))["updates"]
    assert "uv" in {update["package-ecosystem"] for update in updates}
