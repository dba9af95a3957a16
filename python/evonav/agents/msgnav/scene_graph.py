"""MSGNav's multi-modal scene graph: which entries were seen together, and in which kept views.

Entries are those of the object map, images those of the view store; this holds the edges between them. An edge has no
text: it is the list of the views that show both of its ends.
"""

import heapq
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

Pair = tuple[int, int]
"""Two entries, the smaller id first; twice the same one for an entry by itself."""


@dataclass(slots=True)
class _Edge:
    bit: int
    """Its place in the views' masks."""
    view_ids: list[int] = field(default_factory=list)
    """Ascending."""


class SceneGraph:
    """Edges between entries that one view shows at most `max_edge_m` apart, an entry's edge to itself included."""

    def __init__(self, *, max_edge_m: float = 3.5) -> None:
        """A graph without edges.

        Args:
            max_edge_m: Largest distance on the ground plane between the middles of two ends.
        """
        self.max_edge_m = max_edge_m
        self._edges: dict[Pair, _Edge] = {}
        self._masks: dict[
            int, int
        ] = {}  # view id -> its edges as bits: a view is compared with all that is left at once
        self._next_bit = 0

    def __len__(self) -> int:
        """Number of edges."""
        return len(self._edges)

    @property
    def entry_ids(self) -> list[int]:
        """Entries with an edge, ascending."""
        return sorted({end for pair in self._edges for end in pair})

    @property
    def pairs(self) -> list[Pair]:
        """Ends of all edges, ascending."""
        return sorted(self._edges)

    def views_of(self, pair: Pair) -> Sequence[int]:
        """Views that show both ends, ascending; empty without such an edge."""
        edge = self._edges.get(pair)
        return [] if edge is None else list(edge.view_ids)

    def edges_of(self, view_id: int) -> list[Pair]:
        """Ends of the edges that a view shows, ascending."""
        mask = self._masks.get(view_id, 0)
        return sorted(pair for pair, edge in self._edges.items() if mask >> edge.bit & 1)

    def neighbours(self) -> dict[int, set[int]]:
        """Entries one edge away, by entry; an entry is not its own neighbour."""
        found: dict[int, set[int]] = {}
        for a, b in self._edges:
            ends = found.setdefault(a, set()), found.setdefault(b, set())
            if a != b:
                ends[0].add(b)
                ends[1].add(a)
        return found

    def add_view(self, view_id: int, centres_m: Mapping[int, tuple[float, float]]) -> None:
        """Joins the entries that a view shows.

        Args:
            view_id: Larger than those before.
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
        """Hands the edges of entries that became others to those; pairs as `ObjectUpdate.merged` has them."""
        for old, new in dict(merged).items():
            for pair in [pair for pair in self._edges if old in pair]:
                gone = self._drop(pair)
                a, b = (new if end == old else end for end in pair)
                edge = self._edge((min(a, b), max(a, b)))
                edge.view_ids = sorted({*edge.view_ids, *gone.view_ids})
                for view_id in gone.view_ids:
                    self._masks[view_id] |= 1 << edge.bit

    def prune(self, alive: Iterable[int]) -> None:
        """Drops the edges that have lost an end."""
        ids = set(alive)
        for pair in [pair for pair in self._edges if not ids.issuperset(pair)]:
            self._drop(pair)

    def subgraph(self, selected: Iterable[int]) -> "Subgraph":
        """The edges from selected entries to selected or adjacent ones.

        Args:
            selected: Entries; those without an edge have been seen in no view and are left out.
        """
        chosen = set(selected)
        kept = [pair for pair in self.pairs if pair[0] in chosen or pair[1] in chosen]
        return Subgraph(tuple(sorted({end for pair in kept for end in pair})), tuple(kept), self.cover(kept))

    def cover(self, pairs: Sequence[Pair]) -> tuple[int, ...]:
        """Few views that show all these edges: always the one that shows most of those left, the older of two as good.

        A heap holds the number of edges that each view had left when last counted. That number only falls, so a view
        that is still first after a recount is the best.
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
