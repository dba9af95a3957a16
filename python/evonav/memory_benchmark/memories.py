"""Find memories by name: the references, the peers, and those of a user's own file."""

from collections.abc import Sequence

from evonav.component import Component
from evonav.errors import InvalidArgumentError
from evonav.memory.forgetting import RULES
from evonav.memory_benchmark.benchmark import NamedMemory
from evonav.memory_benchmark.protocol import Memory

_REFERENCES = "evonav.memory_benchmark.references"
MEMORIES: dict[str, Component[Memory]] = {
    **{rule: Component(f"{_REFERENCES}:ObjectMapMemory", {"rule": rule}) for rule in RULES},
    "numpy-list": Component(f"{_REFERENCES}:NumpyList"),
}
"""The reference memories: an object map with each forgetting rule, and a list in NumPy."""
PEERS: dict[str, Component[Memory]] = {
    "open3d-faiss": Component("evonav.memory_benchmark.peers.open3d_faiss:Open3DFaissMemory"),
}
"""Memories of other libraries, which need the extra `bench`."""


def named_memories(names: Sequence[str]) -> list[NamedMemory]:
    """Return memories by their names.

    Args:
        names: References, peers, `./file.py:Class` or `package.module:Class`; none for all references.

    Raises:
        InvalidArgumentError: A name is none of these.
    """
    known = {**MEMORIES, **PEERS}
    found = []
    for name in names or MEMORIES:
        if name not in known and ":" not in name:
            raise InvalidArgumentError(
                f"no memory {name!r}: expected one of {', '.join(known)}, or ./file.py:Class or package.module:Class"
            )
        found.append(NamedMemory(name, known.get(name) or Component(name)))
    return found
