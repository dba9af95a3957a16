"""MSGNav's multi-modal scene graph: the entries that were seen together, and the stored views that show them.

Entries are those of the object map, images those of the view store; this module has the edges between them. An edge has
no text: it is the list of the views that show both of its ends.
"""

import heapq
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

Pair = tuple[int, int]
"""Ids of two entries, the smaller first; twice the same one for an entry's edge to itself."""


@dataclass(slots=True)
class _Edge:
    bit: int
    """The edge's bit in the views' masks."""
    view_ids: list[int] = field(default_factory=list)
    """Ids of the views that show both ends, ascending."""


class SceneGraph:
    """Edges between entries that one view shows at most `max_edge_m` apart, an entry's edge to itself included."""

    def __init__(self, *, max_edge_m: float = 3.5) -> None:
        """Create a graph without edges, which join middles up to `max_edge_m` apart on the ground plane."""
        self.max_edge_m = max_edge_m
        self._edges: dict[Pair, _Edge] = {}
        self._masks: dict[int, int] = {}
        """Edges of each view as bits, by its id, so that a view is compared with all remaining edges at once."""
        self._next_bit = 0

    def __len__(self) -> int:
        """Return the number of edges."""
        return len(self._edges)

    @property
    def entry_ids(self) -> list[int]:
        """Ids of the entries with an edge, ascending."""
        return sorted({end for pair in self._edges for end in pair})

    @property
    def pairs(self) -> list[Pair]:
        """Ends of all edges, ascending."""
        return sorted(self._edges)

    def views_of(self, pair: Pair) -> Sequence[int]:
        """Return the views that show both ends, ascending; empty without such an edge."""
        edge = self._edges.get(pair)
        return [] if edge is None else list(edge.view_ids)

    def neighbours(self) -> dict[int, set[int]]:
        """Return the entries one edge away, by entry; an entry is not its own neighbour."""
        found: dict[int, set[int]] = {}
        for a, b in self._edges:
            ends = found.setdefault(a, set()), found.setdefault(b, set())
            if a != b:
                ends[0].add(b)
                ends[1].add(a)
        return found

    def add_view(self, view_id: int, centres_m: Mapping[int, tuple[float, float]]) -> None:
        """Join the entries that a view shows.

        Args:
            view_id: Id of the view, larger than those before.
            centres_m: `(x, z)` of each entry that a detection of the view joined.
        """
        seen = sorted(centres_m.items())
        mask = 0
        for index, (a, (ax_m, az_m)) in enumerate(seen):
            for b, (bx_m, bz_m) in seen[index:]:
                if math.hypot(ax_m - bx_m, az_m - bz_m) <= self.max_edge_m:
                    edge = self._edge((a, b))
                    edge.view_ids.append(view_id)
                    mask |= 1 << edge.bit
        self._masks[view_id] = mask

    def follow(self, merged: Mapping[int, int] | Iterable[tuple[int, int]]) -> None:
        """Move the edges of merged entries to the entries that they became; pairs as in `ObjectUpdate.merged`."""
        for old, new in dict(merged).items():
            for pair in [pair for pair in self._edges if old in pair]:
                gone = self._drop(pair)
                a, b = (new if end == old else end for end in pair)
                edge = self._edge((min(a, b), max(a, b)))
                edge.view_ids = sorted({*edge.view_ids, *gone.view_ids})
                for view_id in gone.view_ids:
                    self._masks[view_id] |= 1 << edge.bit

    def prune(self, alive: Iterable[int]) -> None:
        """Drop the edges that have lost an end."""
        ids = set(alive)
        for pair in [pair for pair in self._edges if not ids.issuperset(pair)]:
            self._drop(pair)

    def subgraph(self, selected: Iterable[int]) -> "Subgraph":
        """Return the edges from selected entries to selected or adjacent ones.

        Args:
            selected: Ids of entries; those without an edge were seen in no view and are left out.
        """
        chosen = set(selected)
        pairs = [pair for pair in self.pairs if pair[0] in chosen or pair[1] in chosen]
        return Subgraph(tuple(sorted({end for pair in pairs for end in pair})), tuple(pairs), self.cover(pairs))

    def cover(self, pairs: Sequence[Pair]) -> tuple[int, ...]:
        """Return few views that show all these edges: always the one that shows most of the rest, the oldest of equals.

        A heap has the number of uncovered edges that each view had when it was last counted. The number only falls,
        so a view that is still first after a recount is the best.
        """
        left = 0
        for pair in pairs:
            if pair in self._edges:
                left |= 1 << self._edges[pair].bit
        heap = [(-(mask & left).bit_count(), view_id) for view_id, mask in self._masks.items() if mask & left]
        heapq.heapify(heap)
        chosen: list[int] = []
        while left and heap:
            count, view_id = heap[0]
            now = -(self._masks[view_id] & left).bit_count()
            if now != count:
                heapq.heapreplace(heap, (now, view_id))
                continue
            heapq.heappop(heap)
            chosen.append(view_id)
            left &= ~self._masks[view_id]
        return tuple(chosen)

    def _edge(self, pair: Pair) -> _Edge:
        edge = self._edges.get(pair)
        if edge is None:
            edge = self._edges[pair] = _Edge(self._next_bit)
            self._next_bit += 1
        return edge

    def _drop(self, pair: Pair) -> _Edge:
        edge = self._edges.pop(pair)
        for view_id in edge.view_ids:
            self._masks[view_id] &= ~(1 << edge.bit)
        return edge


@dataclass(frozen=True, slots=True)
class Subgraph:
    """The part of a graph that a question shows."""

    entry_ids: tuple[int, ...]
    """Its ends, ascending."""
    pairs: tuple[Pair, ...]
    """Its edges, ascending."""
    view_ids: tuple[int, ...]
    """Views that together show every edge, in the order in which they were chosen."""
