"""MSGNav (arXiv 2511.10376) under the paper's protocol: a scene graph with images, and a verified stop.

docs/agents.md has its parameters and their sources. It shares 3D-Mem's mapping, frontiers and object entries, looks
around with seven views in every round, and forgets nothing: neither cells that contradict it nor entries that were not
there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import AgentAction, NavigateTo, SensorConfig, Stop, ViewSchedule
from evonav.agents.explorer import AS_THREE_D_MEM, ExplorerConfig
from evonav.agents.msgnav.memory import GraphMemory, GraphObject, PastChoice
from evonav.agents.msgnav.questions import ArrivalQuestion, FrontierImagesQuestion, GraphQuestion, SubgraphQuestion
from evonav.agents.msgnav.scene_graph import Subgraph
from evonav.agents.msgnav.viewpoint import Viewpoint, visible_viewpoint
from evonav.agents.navigator import NavigatorConfig
from evonav.agents.navigator_agent import NavigatorAgent
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.pictures import picture_of
from evonav.decision.question import DecisionModel
from evonav.memory import Frontier
from evonav.memory.occupancy import FREE
from evonav.points import Point2
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo


def navigator_config(explorer: ExplorerConfig) -> NavigatorConfig:
    """Return MSGNav's constants over a way to explore; its background is walls and floors alone."""
    return NavigatorConfig(explorer=explorer, image_px=512, background=("wall", "floor"))


@dataclass(frozen=True, slots=True)
class MsgNavConfig:
    """MSGNav's constants."""

    navigator: NavigatorConfig = field(default_factory=lambda: navigator_config(AS_THREE_D_MEM))
    """3D-Mem's exploration; images of 512 px at most; doors and windows are remembered."""
    max_edge_m: float = 3.5
    """Entries seen together have an edge up to this distance."""
    max_selected: int = 20
    """Largest number of objects in a key subgraph selection."""
    has_fixed_viewpoint: bool = True
    """The place to stand stays as it was when the target was chosen, as in the original.

    `False`: a place off the circle, such as that of a far target on unmapped floor, is chosen again in every round."""
    arrival_rounds: int = 5
    """Number of last rounds whose views are shown on arrival..."""
    arrival_views: int = 35
    """...and the largest number of these views."""
    looks_on_arrival: bool = False
    """The views from the place itself are among them; the original asks before it takes them."""
    num_tries: int = 3
    """Number of tries before a question without a valid answer counts as failed."""


@dataclass(frozen=True, slots=True)
class MsgNavTarget:
    """The place or object that the agent is committed to until it arrives."""

    candidate: ObjectCandidate
    """The entry as it was when it was chosen; or the object in an image, with the id -1."""
    viewpoint: Viewpoint
    """The place to stand."""
    view_id: int | None = None
    """Id of the image that shows it, unless it is an entry."""
    points_m: NDArray[np.float32] = field(
        default_factory=lambda: np.empty((0, 3), np.float32), compare=False, repr=False
    )
    """`(N, 3)` points when it was chosen."""

    @property
    def entry_id(self) -> int | None:
        """Id of the target's entry; `None` for an object in an image."""
        return self.candidate.entry_id if self.view_id is None else None

    @property
    def name(self) -> str:
        """The target's name in diagnostics."""
        if self.view_id is None:
            return f"object {self.candidate.entry_id}"
        return f"image {self.view_id}, {self.candidate.label}"


class MsgNav(NavigatorAgent):
    """Chooses from a graph, goes where the choice can be seen, asks if it is the goal, and remembers rejections."""

    def __init__(self, config: MsgNavConfig | None = None, decision: DecisionModel | None = None) -> None:
        self.config = config or MsgNavConfig()
        every_round = ViewSchedule(7, 40.0)
        super().__init__(
            self.config.navigator,
            decision,
            num_tries=self.config.num_tries,
            sensors=SensorConfig(every_round, every_round),
        )

    def begin_task(self, task: TaskInfo) -> None:
        """Forget everything."""
        super().begin_task(task)
        self._memory = GraphMemory(self._navigator, max_edge_m=self.config.max_edge_m)

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal; graph, images and map stay, target and history do not."""
        super().begin_stage(goal)
        self._target: MsgNavTarget | None = None
        self._history: list[PastChoice] = []
        self._candidates = ()

    def act(self, observation: Observation) -> AgentAction:
        """Look; go on to the committed target; on arrival, ask whether it is the goal; without a target, decide."""
        self._queries.begin_round()
        self._candidates = ()
        is_over = observation.has_arrived or not observation.is_action_success
        looks_first = self.config.looks_on_arrival
        if looks_first:
            self._memory.observe(observation)
        target = self._followed()
        # The original asks right after the move: it shows what was seen on the way, and not from the place itself.
        arrival = self._arrival_question(target, observation) if target is not None and is_over else None
        if not looks_first:
            self._memory.observe(observation)
            target = self._followed()
        if target is not None and arrival is not None:
            self._target = None
            self._counters["verifications"] += 1
            if self._queries.ask(arrival) is True:  # no valid answer counts as no
                self._record_round(target.name, "verified", target.entry_id)
                return Stop("verified")
            self._reject(target)
        elif target is not None:
            return self._approach_target(self._aimed(target, observation))
        return self._decide(observation)

    def _followed(self) -> MsgNavTarget | None:
        """Return the target; if its entry was merged into another, by the other's id."""
        target = self._target
        if target is None or target.view_id is not None:
            return target
        entry_id = self._navigator.views.resolve(target.candidate.entry_id)
        self._target = replace(target, candidate=replace(target.candidate, entry_id=entry_id))
        return self._target

    def _aimed(self, target: MsgNavTarget, observation: Observation) -> MsgNavTarget:
        """Return the target with the place to stand that the map now allows, if it may change."""
        if self.config.has_fixed_viewpoint or target.viewpoint.found == "circle":
            return target
        here = (observation.pose.x_m, observation.pose.z_m)
        return replace(target, viewpoint=self._viewpoint(target.points_m, here))

    def _arrival_question(self, target: MsgNavTarget, observation: Observation) -> ArrivalQuestion:
        """Return the question whether the goal is here, about the views of the rounds before this one."""
        memory, config = self._memory, self.config
        navigator = self._navigator
        views = memory.recent_views(config.arrival_rounds, config.arrival_views)
        entry = navigator.objects.entry(target.candidate.entry_id) if target.view_id is None else None
        images = [picture_of(view, config.navigator.image_px) for view in views] if self._shows_images else []
        return ArrivalQuestion(
            goal=self._goal,
            target=target.candidate if entry is None else navigator.candidate(entry),
            seen=memory.detections(views),
            num_views=len(views),
            num_frontiers=len(navigator.explorer.frontiers),
            num_rounds_left=observation.num_rounds_left,
            views=[image for image in images if image is not None],
        )

    def _reject(self, target: MsgNavTarget) -> None:
        """Remember a rejected target until the stage ends; the entry stays as it is."""
        self._counters["rejected_choices"] += 1
        self._history.append(
            PastChoice(
                round=self._navigator.round,
                kind="object" if target.view_id is None else "image",
                id=target.candidate.entry_id if target.view_id is None else target.view_id,
                category=target.candidate.label,
                place_m=target.candidate.ground_m,
            )
        )

    def _decide(self, observation: Observation) -> AgentAction:
        """Select the key subgraph, then choose: an object of it, something in an image, or exploration."""
        memory, navigator = self._memory, self._navigator
        pose = observation.pose
        here = (pose.x_m, pose.z_m)
        nodes = memory.nodes()
        subgraph = Subgraph((), (), ())
        if nodes:
            selected = self._queries.ask(SubgraphQuestion(self._goal, nodes, here, self.config.max_selected))
            subgraph = memory.graph.subgraph(selected or ())
        question = self._graph_question(nodes, subgraph, observation)
        self._candidates = subgraph.entry_ids
        choice = self._queries.ask(question)
        if choice is None:
            return self._random_frontier()
        if choice.kind == "explore":
            return self._explore(here, [node.candidate for node in nodes])
        if choice.kind == "object":
            points_m = navigator.objects.points_m(choice.id)
            candidate = next((node.candidate for node in question.objects if node.entry_id == choice.id), None)
            view_id = None
        else:
            view_id = question.images[choice.id].view_id
            label, points_m = memory.largest_detection(view_id, choice.category) or ("", None)
            candidate = None if points_m is None else _candidate_of(label, points_m)
        if candidate is None or points_m is None:
            self._counters["empty_detections"] += 1
            return self._random_frontier()
        self._counters[f"{choice.kind}_choices"] += 1
        viewpoint = self._viewpoint(points_m, here)
        if viewpoint.found != "circle":
            self._counters[f"viewpoints_{viewpoint.found}"] += 1
        return self._approach_target(MsgNavTarget(candidate, viewpoint, view_id, points_m), self._queries.reason)

    def _graph_question(
        self, nodes: Sequence[GraphObject], subgraph: Subgraph, observation: Observation
    ) -> GraphQuestion:
        """Return the main question, with as few images as show every edge."""
        memory, config = self._memory, self.config
        images = memory.images(subgraph.view_ids, config.navigator.image_px if self._shows_images else None)
        number_of = {image.view_id: number for number, image in enumerate(images)}
        shown = set(subgraph.entry_ids)
        edges = []
        for a, b in subgraph.pairs:
            numbers = [number_of[view_id] for view_id in memory.graph.views_of((a, b)) if view_id in number_of]
            if a != b:
                edges.append((a, b, tuple(sorted(numbers))))
        return GraphQuestion(
            goal=self._goal,
            objects=[node for node in nodes if node.entry_id in shown],
            edges=edges,
            images=images,
            history=tuple(self._history),
            round=self._navigator.round,
            max_rounds=self._navigator.round + observation.num_rounds_left,
            num_frontiers=len(self._navigator.explorer.frontiers),
            unseen_m2=self._unseen_m2(),
        )

    def _viewpoint(self, points_m: NDArray[np.float32], here: Point2) -> Viewpoint:
        """Return the place from which most of a target can be seen."""
        navigator = self._navigator
        occupancy = navigator.explorer.map
        return visible_viewpoint(navigator.objects, points_m, occupancy.cells == FREE, occupancy.map_frame, here)

    def _approach_target(self, target: MsgNavTarget, reason: str = "") -> AgentAction:
        """Commit to a target and continue towards it; the heading on arrival is the direction of travel."""
        self._target = target
        self._navigator.explorer.stop_exploring()
        self._record_round(target.name, reason, target.entry_id)
        return NavigateTo(target.viewpoint.position_m)

    def _explore(self, here: Point2, remembered: Sequence[ObjectCandidate]) -> AgentAction:
        """Go to the only frontier, or to the one that the model chooses by its image."""
        navigator = self._navigator
        frontiers = navigator.explorer.frontiers
        if len(frontiers) < 2:
            return self._go_to_frontier(frontiers[0], "the only one") if frontiers else self._stop("nothing to explore")
        index = self._queries.ask(
            FrontierImagesQuestion(
                goal=self._goal,
                frontiers=self._frontier_candidates(here),
                surroundings=remembered,
            )
        )
        if index is None:
            return self._random_frontier()
        return self._go_to_frontier(frontiers[index], self._queries.reason)

    def _random_frontier(self) -> AgentAction:
        """Go to a frontier drawn from the task's seed, the stage and the round alone, after any invalid answer."""
        navigator = self._navigator
        frontiers = navigator.explorer.frontiers
        if not frontiers:
            return self._stop("nothing to explore")
        self._counters["random_frontiers"] += 1
        stream = np.random.default_rng([self._task.seed % 2**63, navigator.stage, navigator.round])
        return self._go_to_frontier(frontiers[int(stream.integers(len(frontiers)))], "no valid answer: drawn")

    def _go_to_frontier(self, frontier: Frontier, reason: str) -> AgentAction:
        self._history.append(PastChoice(self._navigator.round, "explore"))
        return super()._go_to_frontier(frontier, reason)

    def _round_counters(self) -> Mapping[str, int]:
        return {**super()._round_counters(), "edges": len(self._memory.graph)}


def _candidate_of(label: str, points_m: NDArray[np.float32]) -> ObjectCandidate:
    """Return an object that is no entry, by its points."""
    low, high = points_m.min(axis=0).astype(np.float64), points_m.max(axis=0).astype(np.float64)
    x_m, y_m, z_m = ((low + high) / 2.0).tolist()
    width_m, height_m, depth_m = (high - low).tolist()
    return ObjectCandidate(-1, label, (x_m, y_m, z_m), (width_m, height_m, depth_m), num_detections=1)
