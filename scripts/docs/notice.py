"""Write NOTICE: the packages that a wheel of evonav is built of and needs, with their licences (`make notice`).

Rust packages are those that `Cargo.lock` names for the extension, on any platform; Cargo says their licences. Python
packages are those that `pyproject.toml` requires without extras, and what these require here.
"""

import importlib.metadata
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
EXTENSION = "evonav-py"
_HEADER = """\
evonav
Copyright The evonav developers. Licensed under the Apache License 2.0, see LICENSE.

This list is written by `make notice`; a test compares it with Cargo.lock and pyproject.toml.
"""
_RUST = "Rust packages, compiled into the wheel"
_PYTHON = "Python packages, installed beside it; extras in pyproject.toml bring others, of which `yolo` is AGPL-3.0"


def rust_packages() -> list[tuple[str, str]]:
    """Return name and version of the packages that the extension is compiled of, from `Cargo.lock`."""
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))["package"]
    found: set[tuple[str, str]] = set()
    waiting = [EXTENSION]
    while waiting:
        name, _, version = waiting.pop().partition(" ")
        package = next(one for one in lock if one["name"] == name and version in ("", one["version"]))
        if (package["name"], package["version"]) in found:
            continue
        found.add((package["name"], package["version"]))
        needed = package.get("dependencies", [])
        if "source" not in package:  # of the workspace: the lock file names what its tests need, too
            manifest = tomllib.loads((ROOT / "rust" / name / "Cargo.toml").read_text(encoding="utf-8"))
            direct = manifest.get("dependencies", {}).keys() | manifest.get("build-dependencies", {}).keys()
            needed = [one for one in needed if one.partition(" ")[0] in direct]
        waiting += needed
    return sorted(one for one in found if not one[0].startswith("evonav"))


def rust_licences() -> dict[tuple[str, str], str]:
    """Return the licences of all packages that Cargo knows of, without a network."""
    command = ["cargo", "metadata", "--offline", "--locked", "--format-version", "1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    packages: list[dict[str, Any]] = json.loads(done.stdout)["packages"]
    return {(one["name"], one["version"]): (one["license"] or "unknown").replace("/", " OR ") for one in packages}


def required() -> list[str]:
    """Return the names of the Python packages that `pyproject.toml` requires without extras."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [_name(requirement) for requirement in project["dependencies"]]


def python_packages() -> dict[str, str]:
    """Return the licence of each required Python package, and of what it requires here, by name."""
    found: dict[str, str] = {}
    waiting = required()
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        try:
            metadata = importlib.metadata.metadata(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = _NOT_HERE.get(name, "unknown")
            continue
        found[name] = _licence(metadata)
        needed = importlib.metadata.requires(name) or []
        waiting += [_name(one) for one in needed if not _IS_CONDITIONAL.search(one)]
    return dict(sorted(found.items()))


_NOT_HERE = {"tomli": "MIT"}
"""Licences of packages that only other versions of Python need."""
_IS_CONDITIONAL = re.compile("extra ==|sys_platform|platform_system")
_SHORT = {
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD-3-Clause",
    "ISC License (ISCL)": "ISC",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
}


def _licence(metadata: importlib.metadata.PackageMetadata) -> str:
    expression = metadata.get("License-Expression")
    if expression:
        return str(expression)
    classifiers = [one.rpartition(" :: ")[2] for one in metadata.get_all("Classifier", []) if "License ::" in one]
    stated = str(metadata.get("License") or "unknown").splitlines()[0]
    return " OR ".join(_SHORT.get(one, one) for one in classifiers) or stated


def _name(requirement: str) -> str:
    name = re.match(r"[A-Za-z0-9._-]+", requirement)
    assert name is not None
    return re.sub(r"[-_.]+", "-", name[0]).lower()


def notice() -> str:
    """Return the text of NOTICE."""
    licences = rust_licences()
    rust = [f"{name} {version}: {licences[name, version]}" for name, version in rust_packages()]
    python = [f"{name}: {licence}" for name, licence in python_packages().items()]
    parts = [
        f"{title}\n\n" + "".join(f"    {line}\n" for line in lines)
        for title, lines in ((_RUST, rust), (_PYTHON, python))
    ]
    return "\n".join([_HEADER, *parts])


if __name__ == "__main__":
    (ROOT / "NOTICE").write_text(notice(), encoding="utf-8")
