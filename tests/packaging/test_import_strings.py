"""Strings that name a module keep the layers of `pyproject.toml`: import-linter sees import statements only."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from evonav.toml import tomllib

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "python"
NAMED = re.compile(r"(evonav(?:\.\w+)+)\.?(?::[\w.]+)?")


def layers() -> list[list[str]]:
    """The modules of each layer, the highest layer first."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    (found,) = (contract["layers"] for contract in contracts if contract["type"] == "layers")
    return [re.split(r"\s*[:|]\s*", line) for line in found]


def layer_of(module: str) -> int | None:
    """The number of a module's layer, 0 for the highest; `None` for a module outside of the layers."""
    for number, names in enumerate(layers()):
        if any(module == name or module.startswith(f"{name}.") for name in names):
            return number
    return None


def named_modules(text: str) -> Iterator[tuple[int, str]]:
    """Line and module of each string in a Python file that is an import path."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and (named := NAMED.fullmatch(node.value)):
            yield node.lineno, named[1]


def violations(module: str, text: str) -> list[str]:
    mine = layer_of(module)
    found = [(line, name, layer_of(name)) for line, name in named_modules(text)]
    return [
        f"{module}, line {line}, names {name}, which is in a higher layer"
        for line, name, theirs in found
        if mine is not None and theirs is not None and theirs < mine
    ]


@pytest.mark.slow
def test_no_string_names_a_module_of_a_higher_layer() -> None:
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        module = ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")
        found += violations(module, path.read_text(encoding="utf-8"))
    assert found == []


@pytest.mark.parametrize(
    ("module", "text", "num_found"),
    [
        ("evonav.perception.shorthand", 'MAKE = "evonav.evaluation.run.components:ground_truth"', 1),
        ("evonav.perception.shorthand", 'MAKE = "evonav.perception.simulated:noisy_perception"', 0),
        ("evonav.agents.hosting.wire", 'OURS = ("evonav.evaluation.", "evonav.agents.hosting.wire")', 1),
        ("evonav.evaluation.run.components", 'MAKE = "evonav.perception.simulated:noisy_perception"', 0),
        ("evonav.perception.shorthand", '"""Words of `evonav.evaluation.run`."""', 0),
    ],
)
def test_import_paths_in_strings_are_found(module: str, text: str, num_found: int) -> None:
    assert len(violations(module, text)) == num_found
