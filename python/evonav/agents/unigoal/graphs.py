"""UniGoal's reasoning: read the goal, relate the scene, match both graphs, and find where they point."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from evonav.agents.unigoal.goal_graph import GoalGraph, Match, MatchMode, match_graphs, similarity_transform
from evonav.agents.unigoal.object_graph import Node, ObjectGraph, inside, middle_of, name_of
from evonav.agents.unigoal.questions import (
    CategoryQuestion,
    DecomposeQuestion,
    DescribeQuestion,
    GoalRelationsQuestion,
    ObjectsQuestion,
)
from evonav.agents.unigoal.scene_questions import (
    RENAME,
    CorrectionQuestion,
    GroupScoreQuestion,
    LayoutQuestion,
    RelationLinesQuestion,
    RoomQuestion,
)
from evonav.decision.pictures import Picture
from evonav.decision.query import QuerySession
from evonav.decision.text.language import ROOMS, canonical
from evonav.decision.text.matcher import Matcher
from evonav.points import Point2
from evonav.sensors.observation import View
from evonav.tasks.public import Goal
from evonav.tasks.vocabulary import CODE_CATEGORIES, FALLBACK_CATEGORY, LABEL_OF_TYPE, MAP_CATEGORIES, NO_CATEGORY

MatchStage = Literal["zero", "partial", "perfect"]

ROOM_ZERO = "bedroom"
"""The room of every node in mode `code`: the released code provides no map of rooms."""
ELSEWHERE = "other room"


_WORD_OF_NOUN = {canonical(kind): canonical(word) for kind, word in LABEL_OF_TYPE.items()}


def scene_word(word: str) -> str:
    """Return one spelling for all nouns of a scene graph's word: `table` for a dining table, `sofa` for a couch."""
    noun = canonical(word)
    return _WORD_OF_NOUN.get(noun, noun)


@dataclass(frozen=True, slots=True)
class GraphConfig:
    """UniGoal's constants."""

    mode: MatchMode = "code"
    """`code`: as released, six categories and names that never match; `paper`: as published, all mapped categories."""
    goal_input: Literal["text", "category", "image"] = "text"
    """Source of the goal graph: the unified instruction (the paper's setting), the category, or the image."""
    steps_per_update: int = 2
    """Number of steps between two updates of the scene graph."""
    partial_score: float = 0.5
    perfect_score: float = 0.9
    num_decompositions: int = 10
    """Number of tries before the whole graph is the only subgraph."""
    num_category_tries: int = 10
    """Number of tries before the category is a chair, as released."""
    may_decline: bool = False
    """The category may be `none` in `code`, too: then no detection is taken for the goal."""
    correction_hops: int = 2
    correction_reach_m: float = 2.0
    """Longest edge of a hop: every two nodes are joined, so two hops without a limit would be the whole house."""


@dataclass(frozen=True, slots=True)
class Advice:
    """The place that the graphs point to."""

    stage: MatchStage
    score: float
    """The score S of the match."""
    num_anchors: int
    """Number of goal nodes found in the scene."""
    mid_term_m: Point2 | None = None
    """`(x, z)` that attracts exploration a little."""
    target: Node | None = None
    """The node to go to: the goal, completely matched."""
    reason: str = ""


class GraphReasoner:
    """Scene graph of the task, goal graph of the stage."""

    def __init__(self, config: GraphConfig, queries: QuerySession) -> None:
        self.config = config
        self.scene = ObjectGraph()
        self.goal_graph: GoalGraph | None = None
        self.subgraphs: tuple[GoalGraph, ...] = ()
        self.category: str | None = None
        """Category of the goal's detections; `None` if the detector has no category for it."""
        self._queries = queries
        self._matcher = Matcher()

    def begin_stage(self, goal: Goal) -> None:
        """Drop the goal graph; the scene graph stays."""
        self._goal = goal
        self.scene.begin_stage(goal.stage)
        self.goal_graph, self.subgraphs, self.category = None, (), None

    def understand(self) -> None:
        """Read the goal, once a stage: objects, relations, subgraphs, the detector's category."""
        goal, ask = self._goal, self._queries.ask
        text: str | None = goal.unified_instruction
        objects: tuple[str, ...]
        if self.config.goal_input == "image":
            text = ask(DescribeQuestion(goal, Picture(goal.reference_image)))
        if self.config.goal_input == "category" or text is None:
            text, objects = goal.category, (canonical(goal.category),)
            self.goal_graph = GoalGraph(objects)
        else:
            objects = ask(ObjectsQuestion(goal, text)) or (canonical(goal.category),)
            edges = ask(GoalRelationsQuestion(goal, text, objects)) if len(objects) > 1 else ()
            self.goal_graph = GoalGraph(objects, edges or ())
        if len(objects) > 1:
            parts = ask(DecomposeQuestion(goal, self.goal_graph), self.config.num_decompositions)
            self.subgraphs = parts or (self.goal_graph,)
        else:
            self.subgraphs = (self.goal_graph,)
        self.category = self._category(text, objects[0])

    def _category(self, text: str, target: str) -> str | None:
        """Return what the detector looks for; as released, it is always one of six categories."""
        is_released = self.config.mode == "code"
        categories = CODE_CATEGORIES if is_released else MAP_CATEGORIES
        if is_released and not self.config.may_decline:
            question = CategoryQuestion(self._goal, text, target, categories, may_decline=False)
            return self._queries.ask(question, self.config.num_category_tries) or FALLBACK_CATEGORY
        category = self._queries.ask(CategoryQuestion(self._goal, text, target, categories, may_decline=True))
        return None if category == NO_CATEGORY else category

    def observe(self, view: View) -> None:
        """Add a view and relate its new nodes; an answer with a wrong number of relations relates none of them."""
        pairs = self.scene.update(view)
        if pairs:
            self.scene.relate(pairs, self._queries.ask(RelationLinesQuestion(self._goal, pairs), 1))

    def advise(self, is_given_up: Callable[[Node], bool]) -> Advice:
        """Match the first subgraph with the scene; as released, the other subgraphs are never used.

        Args:
            is_given_up: True for a node whose place was visited in vain; it does not match.
        """
        match = self._match(is_given_up)
        if self._is_perfect(match):
            self._correct(match)
            match = self._match(is_given_up)
        subgraph, num = self.subgraphs[0], len(match.anchors)
        if self._is_perfect(match):
            node = self.scene.node(match.anchors[subgraph.nodes[0]])
            return Advice("perfect", match.score, num, target=node, reason="the goal's own node")
        if match.score >= self.config.partial_score and num >= 2:
            place_m = self._predicted(match)
            return Advice("partial", match.score, num, mid_term_m=place_m, reason="mean predicted place")
        group = self._best_group()
        if group is None:
            return Advice("zero", match.score, num, reason="no group fits")
        names = ", ".join(map(name_of, group))
        return Advice("zero", match.score, num, mid_term_m=middle_of(group), reason=f"by {names}")

    def _match(self, is_given_up: Callable[[Node], bool]) -> Match:
        nodes = [node for node in self.scene.nodes if not is_given_up(node)]
        return match_graphs(self.subgraphs[0], nodes, self.scene.relations, self.config.mode, scene_word)

    def _is_perfect(self, match: Match) -> bool:
        """Return whether the graph is matched, its target included; released code also needs fewer than two anchors."""
        if match.score < self.config.perfect_score or self.subgraphs[0].nodes[0] not in match.anchors:
            return False
        return self.config.mode == "paper" or len(match.anchors) < 2

    def _correct(self, match: Match) -> None:
        """Keep, rename or delete nodes and edges around the match, as the model answers."""
        config, scene = self.config, self.scene
        nodes = scene.neighbourhood(tuple(match.anchors.values()), config.correction_hops, config.correction_reach_m)
        relations = inside(scene.relations, nodes)
        verdicts = self._queries.ask(CorrectionQuestion(self._goal, self.subgraphs[0], nodes, relations))
        if verdicts is None:
            return
        for pair, verdict in zip(relations, verdicts[len(nodes) :], strict=True):
            if verdict == "delete":
                del scene.relations[pair]
            elif verdict != "keep":
                scene.relations[pair] = verdict.removeprefix(RENAME)
        for node, verdict in zip(nodes, verdicts, strict=False):
            if verdict == "delete":
                scene.delete(node.entry_id)
            elif verdict != "keep":
                scene.rename(node.entry_id, verdict.removeprefix(RENAME))

    def _predicted(self, match: Match) -> Point2 | None:
        """Return the mean place of the unmatched goal nodes, computed from the first two matched ones.

        As in the original, the similarity transform of two anchors turns guessed relative places into places in the
        scene.
        """
        subgraph = self.subgraphs[0]
        anchors = {word: node for word, i in match.anchors.items() if (node := self.scene.node(i)) is not None}
        layout = self._queries.ask(LayoutQuestion(self._goal, subgraph, anchors))
        if layout is None:
            return None
        first, second = list(anchors)[:2]
        ends = (anchors[first].ground_m, anchors[second].ground_m)
        missing = [word for word in subgraph.nodes if word not in anchors]
        places = [similarity_transform((layout[first], layout[second]), ends, layout[word]) for word in missing]
        found = [place for place in places if place is not None]
        if not found:
            return ends[0]
        return (sum(x for x, _ in found) / len(found), sum(z for _, z in found) / len(found))

    def _best_group(self) -> list[Node] | None:
        """Return the likeliest group of the likeliest room; `None` if no group is likely at all."""
        groups = self.scene.groups(self._room_of())
        if not groups:
            return None
        goal, subgraph = self._goal, self.subgraphs[0]
        rooms = tuple(sorted(groups))
        room = self._queries.ask(RoomQuestion(goal, subgraph, rooms)) or rooms[0]
        nodes = self.scene.nodes
        best: tuple[float, list[Node]] | None = None
        for group in groups[room]:
            question = GroupScoreQuestion(goal, subgraph, group, inside(self.scene.relations, group), nodes)
            score = self._queries.ask(question, 1) or 0.0
            if score > (0.0 if best is None else best[0]):
                best = (score, group)
        return None if best is None else best[1]

    def _room_of(self) -> Callable[[Node], str]:
        """Return a function that gives a node's room: as published, by nearby objects; as released, always room 0."""
        if self.config.mode == "code":
            return lambda _: ROOM_ZERO

        def room_of(node: Node) -> str:
            room = self._matcher.room_around(node.ground_m, self.scene.nodes)
            return room if room in ROOMS else ELSEWHERE

        return room_of
