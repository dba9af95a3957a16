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
    "clean-up": Component(f"{_REFERENCES}:ObjectMapMemory", {"rule": "never", "min_detections": 2}),
    "numpy-list": Component(f"{_REFERENCES}:NumpyList"),
}
"""The reference memories: an object map with each forgetting rule, one with a clean-up, and a list in NumPy.

`clean-up` never forgets but by the clean-up of agents' maps, which drops entries with one detection.
"""
PEERS: dict[str, Component[Memory]] = {
    "open3d-faiss": Component("evonav.memory_benchmark.peers.open3d_faiss:Open3DFaissMemory"),
}
"""Memories of other libraries, which need the extra `bench`."""


def named_memories(names: Sequence[str]) -> list[NamedMemory]:
    """Return memories by their names.

    Args:
        names: References, which run in the workers; peers, `./file.py:Class` or `package.module:Class`, which run in
            processes of their own; none for all references.

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
        found.append(NamedMemory(name, known.get(name) or Component(name), runs_here=name in MEMORIES))
    return found
