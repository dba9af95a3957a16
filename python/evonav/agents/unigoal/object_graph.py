"""UniGoal's scene graph: object nodes with captions, one relation between every two, groups of nearby nodes.

Nodes are the entries of an `ObjectMap` that matches by overlap alone, whatever the label, so that a caption is the word
that most detections at a place gave.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from evonav.decision.candidates import ObjectCandidate
from evonav.memory.objects import ObjectMap, ObjectMapConfig
from evonav.points import Point2
from evonav.sensors.observation import View
from evonav.tasks.vocabulary import LABEL_TRANSLATION, relabelled

OVERLAP_ONLY = ObjectMapConfig(
    voxel_m=0.025, max_distance_m=math.inf, visual_weight=0.0, match_threshold=0.01, views_per_cleanup=0
)
"""UniGoal's association, which never cleans up, merges or drops entries."""
MIN_DETECTIONS = 3
"""Smallest number of detections of an entry that is a node."""
GROUP_EPS_M = 0.5
"""Nodes with centres this near belong to one group (DBSCAN, min. 1)."""
GROUP_CELL_M = 0.05
"""Centres are rounded to cells first."""
Node = ObjectCandidate
"""An object in the scene graph; its caption is the label."""
Relations = Mapping[tuple[int, int], str]
"""The relation of a node to another one, by the ids of both."""


def name_of(node: Node) -> str:
    """Return a node's name in questions."""
    return f"{node.label}_{node.entry_id}"


def middle_of(nodes: Sequence[Node]) -> Point2:
    """Return `(x, z)`: the mean of the nodes' middles."""
    return (
        math.fsum(node.ground_m[0] for node in nodes) / len(nodes),
        math.fsum(node.ground_m[1] for node in nodes) / len(nodes),
    )


def inside(relations: Relations, nodes: Iterable[Node]) -> dict[tuple[int, int], str]:
    """Return the relations between some nodes."""
    ids = {node.entry_id for node in nodes}
    return {pair: relation for pair, relation in relations.items() if ids.issuperset(pair)}


class ObjectGraph:
    """Nodes, edges, and pairs of nodes without a proposed relation."""

    def __init__(self) -> None:
        self.objects = ObjectMap(OVERLAP_ONLY)
        self._nodes: dict[int, Node] = {}
        self.relations: dict[tuple[int, int], str] = {}
        """Edges in the order in which they were proposed."""
        self._renamed: dict[int, tuple[str, str]] = {}
        """Caption that a correction gave a node, and the label that detections gave it then, by node."""
        self.seen_ids: frozenset[int] = frozenset()
        """Ids of the entries that the last view showed."""
        self._types: dict[int, Counter[str]] = {}

    @property
    def nodes(self) -> list[Node]:
        """Nodes by ascending id."""
        return list(self._nodes.values())

    def node(self, node_id: int) -> Node | None:
        """Return the node with an id, if it still exists."""
        return self._nodes.get(node_id)

    def type_of(self, node_id: int) -> str:
        """Return ProcTHOR's type of most detections at a node: for records, which judge entries by it."""
        return self._types[node_id].most_common(1)[0][0]

    def begin_stage(self, stage: int) -> None:
        """Start a stage; nodes and edges stay, stale or not."""
        self.objects.begin_stage(stage)

    def update(self, view: View) -> list[tuple[Node, Node]]:
        """Add a view's detections.

        Returns:
            Pairs that need a relation: every new node with each old one and each other new one. A node whose caption
            has changed is new, and its edges are gone.
        """
        update = self.objects.update(replace(view, detections=relabelled(view.detections, LABEL_TRANSLATION)))
        types = [label for label in view.detections.labels if label in LABEL_TRANSLATION]
        for entry_id, kind in zip(update.entry_ids, types, strict=True):
            if entry_id is not None:
                self._types.setdefault(entry_id, Counter())[kind] += 1
        self.seen_ids = frozenset(entry_id for entry_id in update.entry_ids if entry_id is not None)
        new_ids = []
        for entry_id in sorted(self.seen_ids):  # all other entries are unchanged
            entry = self.objects.entry(entry_id)
            if entry is None or entry.num_detections < MIN_DETECTIONS:
                continue
            caption = self._caption(entry.id, entry.label)
            known = self._nodes.get(entry.id)
            if known is None or known.label != caption:
                self._drop_edges(entry.id)
                new_ids.append(entry.id)
            self.add(Node(entry.id, caption, entry.centre_m, entry.size_m, entry.num_detections))
        old = [node for node in self._nodes.values() if node.entry_id not in new_ids]
        new = [self._nodes[node_id] for node_id in new_ids]
        return [(node, other) for index, node in enumerate(new) for other in (*old, *new[index + 1 :])]

    def _caption(self, node_id: int, label: str) -> str:
        word, label_then = self._renamed.get(node_id, (label, label))
        return word if label_then == label else label

    def relate(self, pairs: Sequence[tuple[Node, Node]], relations: Sequence[str] | None) -> None:
        """Make edges of proposed pairs.

        Args:
            pairs: Pairs that `update` returned.
            relations: One relation a pair; `None` if there was no valid answer, and the pairs get no edge.
        """
        for (a, b), relation in zip(pairs, relations or (), strict=relations is not None):
            self.relations[(a.entry_id, b.entry_id)] = relation

    def groups(self, room_of: Callable[[Node], str]) -> dict[str, list[list[Node]]]:
        """Return groups by room: nodes connected by steps of at most `GROUP_EPS_M` from centre to centre.

        With a minimum of one, DBSCAN's clusters are just the connected components.
        """
        rooms: dict[str, list[Node]] = {}
        for node in self._nodes.values():
            rooms.setdefault(room_of(node), []).append(node)
        return {room: self._clusters(nodes) for room, nodes in rooms.items()}

    def _clusters(self, nodes: Sequence[Node]) -> list[list[Node]]:
        reach = round(GROUP_EPS_M / GROUP_CELL_M)
        cells = [tuple(math.floor(value / GROUP_CELL_M) for value in node.ground_m) for node in nodes]
        group_of = list(range(len(nodes)))  # by hand: SciPy takes an agent's process 0.3 s to import
        for i, cell in enumerate(cells):
            for k in range(i):
                if group_of[k] != group_of[i] and math.dist(cell, cells[k]) <= reach:
                    first, second = sorted((group_of[i], group_of[k]))
                    group_of = [first if group == second else group for group in group_of]
        members: dict[int, list[Node]] = {}
        for node, group in zip(nodes, group_of, strict=True):
            members.setdefault(group, []).append(node)
        return list(members.values())

    def neighbourhood(self, node_ids: Sequence[int], num_hops: int, reach_m: float) -> list[Node]:
        """Return the nodes within some hops of others, along edges no longer than `reach_m`, by ascending id.

        Every two nodes are joined by an edge; without a limit to its length two hops would be the whole house.
        """
        found = {node_id for node_id in node_ids if node_id in self._nodes}
        border = set(found)
        for _ in range(num_hops):
            reached = {b if a in border else a for a, b in self.relations if (a in border) != (b in border)}
            border = {
                node_id
                for node_id in reached - found
                if any(math.dist(self._nodes[node_id].ground_m, self._nodes[i].ground_m) <= reach_m for i in border)
            }
            found |= border
        return [self._nodes[node_id] for node_id in sorted(found)]

    def add(self, node: Node) -> None:
        """Add a node, or replace the node with its id."""
        is_new = node.entry_id not in self._nodes
        self._nodes[node.entry_id] = node
        if is_new:
            self._nodes = dict(sorted(self._nodes.items()))

    def rename(self, node_id: int, word: str) -> None:
        """Change a node's caption, until its detections get another label."""
        node = self._nodes.get(node_id)
        if node is None or node.label == word:
            return
        _, label = self._renamed.get(node_id, ("", node.label))
        self._renamed[node_id] = (word, label)
        self.add(replace(node, label=word))

    def delete(self, node_id: int) -> None:
        """Remove a node with its edges and its points; it comes back if it is detected again."""
        self._nodes.pop(node_id, None)
        self._renamed.pop(node_id, None)
        self._types.pop(node_id, None)
        self.objects.remove(node_id)
        self._drop_edges(node_id)

    def _drop_edges(self, node_id: int) -> None:
        for key in [key for key in self.relations if node_id in key]:
            del self.relations[key]
