"""UniGoal's scene graph: object nodes with captions, one relation between every two, groups of nearby nodes.

Nodes are the entries of an `ObjectMap` that matches by overlap alone, whatever the label, so that a caption is the word
that most detections at a place gave.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from evonav.decision.candidates import ObjectCandidate
from evonav.memory.objects import ObjectMap, ObjectMapConfig
from evonav.points import Point2, Point3
from evonav.sensors.observation import View
from evonav.tasks.vocabulary import LABEL_TRANSLATION, relabelled


def overlap_only() -> ObjectMapConfig:
    """Return UniGoal's association, which never cleans up, merges or drops entries."""
    return ObjectMapConfig(
        voxel_m=0.025,
        max_distance_m=math.inf,
        visual_weight=0.0,
        match_threshold=0.01,
        views_per_cleanup=0,
    )


@dataclass(frozen=True, slots=True)
class ObjectGraphConfig:
    """UniGoal's constants."""

    objects: ObjectMapConfig = field(default_factory=overlap_only)
    min_detections: int = 3
    """Smallest number of detections of an entry that is a node."""
    group_eps_m: float = 0.5
    """Nodes with centres this near belong to one group (DBSCAN, min. 1)."""
    group_cell_m: float = 0.05
    """Centres are rounded to cells first."""


@dataclass(frozen=True, slots=True)
class SceneNode:
    """An object in the scene graph."""

    id: int
    caption: str
    centre_m: Point3
    size_m: Point3
    num_detections: int

    @property
    def name(self) -> str:
        """The node's name in questions."""
        return f"{self.caption}_{self.id}"

    @property
    def ground_m(self) -> Point2:
        """`(x, z)` of its middle."""
        return (self.centre_m[0], self.centre_m[2])

    @property
    def candidate(self) -> ObjectCandidate:
        """The node as a remembered object that rules compare."""
        return ObjectCandidate(self.id, self.caption, self.centre_m, self.size_m, self.num_detections)


@dataclass(frozen=True, slots=True)
class SceneEdge:
    """`subject` is `relation` `object`."""

    subject_id: int
    object_id: int
    relation: str


@dataclass(frozen=True, slots=True)
class NodeGroup:
    """Nodes that are near each other."""

    nodes: tuple[SceneNode, ...]

    @property
    def centre_m(self) -> Point2:
        """`(x, z)`: the mean of the nodes' middles."""
        num = len(self.nodes)
        return (
            math.fsum(node.ground_m[0] for node in self.nodes) / num,
            math.fsum(node.ground_m[1] for node in self.nodes) / num,
        )


@dataclass(frozen=True, slots=True)
class Verdict:
    """The model's decision about a node or an edge of the scene graph."""

    action: Literal["keep", "rename", "delete"]
    word: str = ""
    """The new caption or relation."""

    def __str__(self) -> str:
        """Return the verdict as answers spell it."""
        return f"rename to {self.word}" if self.action == "rename" else self.action


class ObjectGraph:
    """Nodes, edges, and pairs of nodes without a proposed relation."""

    def __init__(self, config: ObjectGraphConfig | None = None) -> None:
        self.config = config or ObjectGraphConfig()
        self.objects = ObjectMap(self.config.objects)
        self._nodes: dict[int, SceneNode] = {}
        self._relations: dict[tuple[int, int], str] = {}
        self._renamed: dict[int, tuple[str, str]] = {}
        """Caption that a correction gave a node, and the label that detections gave it then, by node."""
        self.seen_ids: frozenset[int] = frozenset()
        """Ids of the entries that the last view showed."""
        self._types: dict[int, Counter[str]] = {}

    @property
    def nodes(self) -> list[SceneNode]:
        """Nodes by ascending id."""
        return list(self._nodes.values())

    @property
    def edges(self) -> list[SceneEdge]:
        """Edges in the order in which they were proposed."""
        return [SceneEdge(a, b, relation) for (a, b), relation in self._relations.items()]

    def node(self, node_id: int) -> SceneNode | None:
        """Return the node with an id, if it still exists."""
        return self._nodes.get(node_id)

    def type_of(self, node_id: int) -> str:
        """Return ProcTHOR's type of most detections at a node: for records, which judge entries by it."""
        return self._types[node_id].most_common(1)[0][0]

    def begin_stage(self, stage: int) -> None:
        """Start a stage; nodes and edges stay, stale or not."""
        self.objects.begin_stage(stage)

    def update(self, view: View) -> list[tuple[SceneNode, SceneNode]]:
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
            if entry is None or entry.num_detections < self.config.min_detections:
                continue
            caption = self._caption(entry.id, entry.label)
            known = self._nodes.get(entry.id)
            if known is None or known.caption != caption:
                self._drop_edges(entry.id)
                new_ids.append(entry.id)
            self.add(SceneNode(entry.id, caption, entry.centre_m, entry.size_m, entry.num_detections))
        old = [node for node in self._nodes.values() if node.id not in new_ids]
        new = [self._nodes[node_id] for node_id in new_ids]
        return [(node, other) for index, node in enumerate(new) for other in (*old, *new[index + 1 :])]

    def _caption(self, node_id: int, label: str) -> str:
        word, label_then = self._renamed.get(node_id, (label, label))
        return word if label_then == label else label

    def relate(self, pairs: Sequence[tuple[SceneNode, SceneNode]], relations: Sequence[str] | None) -> None:
        """Make edges of proposed pairs.

        Args:
            pairs: Pairs that `update` returned.
            relations: One relation a pair; `None` if there was no valid answer, and the pairs get no edge.
        """
        for (a, b), relation in zip(pairs, relations or (), strict=relations is not None):
            self._relations[(a.id, b.id)] = relation

    def groups(self, room_of: Callable[[SceneNode], str]) -> dict[str, list[NodeGroup]]:
        """Return groups by room: nodes connected by steps of at most `group_eps_m` from centre to centre.

        With a minimum of one, DBSCAN's clusters are just the connected components.
        """
        rooms: dict[str, list[SceneNode]] = {}
        for node in self._nodes.values():
            rooms.setdefault(room_of(node), []).append(node)
        return {room: self._clusters(nodes) for room, nodes in rooms.items()}

    def _clusters(self, nodes: Sequence[SceneNode]) -> list[NodeGroup]:
        cell_m = self.config.group_cell_m
        reach = round(self.config.group_eps_m / cell_m)
        cells = [tuple(math.floor(value / cell_m) for value in node.ground_m) for node in nodes]
        group_of = list(range(len(nodes)))  # by hand: SciPy takes an agent's process 0.3 s to import
        for i, cell in enumerate(cells):
            for k in range(i):
                if group_of[k] != group_of[i] and math.dist(cell, cells[k]) <= reach:
                    first, second = sorted((group_of[i], group_of[k]))
                    group_of = [first if group == second else group for group in group_of]
        members: dict[int, list[SceneNode]] = {}
        for node, group in zip(nodes, group_of, strict=True):
            members.setdefault(group, []).append(node)
        return [NodeGroup(tuple(group)) for group in members.values()]

    def neighbourhood(self, node_ids: Sequence[int], num_hops: int, reach_m: float) -> list[SceneNode]:
        """Return the nodes within some hops of others, along edges no longer than `reach_m`, by ascending id.

        Every two nodes are joined by an edge; without a limit to its length two hops would be the whole house.
        """
        inside = {node_id for node_id in node_ids if node_id in self._nodes}
        border = set(inside)
        for _ in range(num_hops):
            reached = {b if a in border else a for a, b in self._relations if (a in border) != (b in border)}
            border = {
                node_id
                for node_id in reached - inside
                if any(math.dist(self._nodes[node_id].ground_m, self._nodes[i].ground_m) <= reach_m for i in border)
            }
            inside |= border
        return [self._nodes[node_id] for node_id in sorted(inside)]

    def add(self, node: SceneNode) -> None:
        """Add a node, or replace the node with its id."""
        is_new = node.id not in self._nodes
        self._nodes[node.id] = node
        if is_new:
            self._nodes = dict(sorted(self._nodes.items()))

    def rename(self, node_id: int, word: str) -> None:
        """Change a node's caption, until its detections get another label."""
        node = self._nodes.get(node_id)
        if node is None or node.caption == word:
            return
        _, label = self._renamed.get(node_id, ("", node.caption))
        self._renamed[node_id] = (word, label)
        self.add(replace(node, caption=word))

    def delete(self, node_id: int) -> None:
        """Remove a node with its edges and its points; it comes back if it is detected again."""
        self._nodes.pop(node_id, None)
        self._renamed.pop(node_id, None)
        self._types.pop(node_id, None)
        self.objects.remove(node_id)
        self._drop_edges(node_id)

    def set_relation(self, edge: SceneEdge, relation: str | None) -> None:
        """Change an edge's relation; `None` removes the edge."""
        key = (edge.subject_id, edge.object_id)
        if relation is None:
            self._relations.pop(key, None)
        elif key in self._relations:
            self._relations[key] = relation

    def _drop_edges(self, node_id: int) -> None:
        for key in [key for key in self._relations if node_id in key]:
            del self._relations[key]
