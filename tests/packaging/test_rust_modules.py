"""The Rust core's modules import each other in one direction: neither files nor folders form a circle."""

import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "rust" / "evonav-core" / "src"
Module = tuple[str, ...]
Graph = dict[str, set[str]]

_COMMENT = re.compile(r"//.*")
_USE = re.compile(r"^\s*(pub(?:\([^)]*\))?\s+)?use\s+([^;]+);", re.MULTILINE)
_PATH = re.compile(r"\b((?:[A-Za-z_]\w*::)+[A-Za-z_]\w*)")


def expand(tree: str) -> Iterator[list[str]]:
    """Yield the single paths of a `use` tree such as `a::{b, c::{self, D}}`."""
    head, brace, rest = tree.strip().partition("{")
    prefix = [part for part in head.split(" as ")[0].strip().split("::") if part]
    if not brace:
        yield [part for part in prefix if part != "self"] if prefix[-1] == "self" else prefix
        return
    depth, start, inner = 0, 0, rest[: rest.rindex("}")]
    for at, char in enumerate(inner + ","):
        depth += (char == "{") - (char == "}")
        if char == "," and depth == 0:
            if inner[start:at].strip():
                for path in expand(inner[start:at]):
                    yield prefix + path
            start = at + 1


class Crate:
    """The files of a crate, and where each path in them leads.

    Args:
        files: Text of every file by its path below `src`.
    """

    def __init__(self, files: dict[str, str]) -> None:
        self.files = {name: _COMMENT.sub("", text) for name, text in files.items()}
        self.modules = {self._module(name): name for name in files}
        self.exports: dict[tuple[Module, str], list[str]] = {}
        for module, name in self.modules.items():
            for is_public, tree in _USE.findall(self.files[name]):
                for path in expand(tree) if is_public else ():
                    self.exports[module, path[-1]] = self._absolute(module, path)

    @staticmethod
    def _module(name: str) -> Module:
        parts = Path(name).with_suffix("").parts
        return parts[:-1] if parts[-1] in ("mod", "lib") else parts

    def _absolute(self, module: Module, path: list[str]) -> list[str]:
        """Return a path from the crate's root; other crates' paths stay as they are."""
        if path[0] == "crate":
            return path[1:]
        here = list(module)
        if path[0] in ("self", "super"):
            while path and path[0] in ("self", "super"):
                here = here[:-1] if path[0] == "super" else here
                path = path[1:]
            return here + path
        return here + path if (*module, path[0]) in self.modules else ["::", *path]

    def resolve(self, path: list[str]) -> str | None:
        """Return the file that holds an item, behind re-exports; None if it is another crate's."""
        if path[:1] == ["::"]:
            return None
        length = next(n for n in range(len(path), -1, -1) if tuple(path[:n]) in self.modules)
        module = tuple(path[:length])
        exported = self.exports.get((module, path[length])) if length < len(path) else None
        return self.resolve(exported) if exported else self.modules[module]

    def imports(self) -> Graph:
        """Return the files that each file names; a file's own re-exports are not counted."""
        graph: Graph = {name: set() for name in self.files}
        for module, name in self.modules.items():
            text = self.files[name]
            paths = [p for public, tree in _USE.findall(text) if not public for p in expand(tree)]
            paths += [found.split("::") for found in _PATH.findall(_USE.sub("", text))]
            targets = {self.resolve(self._absolute(module, path)) for path in paths}
            graph[name] = {target for target in targets if target not in (None, name)}  # type: ignore[misc]
        return graph


def circle(graph: Graph) -> list[str]:
    """Return the nodes of a circle; none if there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return sorted(set(error.args[1]))
    return []


def siblings(graph: Graph, folder: tuple[str, ...]) -> Graph:
    """Return the imports between the files and folders directly below `folder`."""
    depth = len(folder)
    between: Graph = {}
    for name, targets in graph.items():
        parts = Path(name).parts
        if parts[:depth] != folder:
            continue
        inside = {Path(target).parts for target in targets if Path(target).parts[:depth] == folder}
        here = between.setdefault(parts[depth], set())
        here |= {target[depth] for target in inside} - {parts[depth]}
    return between


@pytest.fixture(scope="module")
def graph() -> Graph:
    files = {path.relative_to(SOURCE).as_posix(): path.read_text("utf-8") for path in SOURCE.rglob("*.rs")}
    return Crate(files).imports()


def test_files_do_not_import_each_other_in_a_circle(graph: Graph) -> None:
    assert circle(graph) == []


def test_folders_do_not_import_each_other_in_a_circle(graph: Graph) -> None:
    folders = {Path(name).parent.parts[:depth] for name in graph for depth in range(len(Path(name).parts))}
    found = {folder: circle(siblings(graph, folder)) for folder in folders}
    assert not any(found.values()), {folder: nodes for folder, nodes in found.items() if nodes}


def test_a_circle_through_a_re_export_is_found() -> None:
    files = {
        "lib.rs": "pub mod a;\npub mod b;\npub use b::deep::Deep;\n",
        "a.rs": "use crate::{Deep, b::deep::{self, Other}};\n// use crate::c;\n",
        "b/mod.rs": "pub mod deep;\nmod side;\npub use deep::Deep;\n",
        "b/deep.rs": "fn f() { super::side::g() }\n",
        "b/side.rs": "use crate::a::A;\n",
    }
    graph = Crate(files).imports()
    assert graph == {
        "lib.rs": set(),
        "a.rs": {"b/deep.rs"},
        "b/mod.rs": set(),
        "b/deep.rs": {"b/side.rs"},
        "b/side.rs": {"a.rs"},
    }
    assert circle(graph) == ["a.rs", "b/deep.rs", "b/side.rs"]
    assert circle(siblings(graph, ())) == ["a.rs", "b"]
