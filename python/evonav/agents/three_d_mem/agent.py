"""3D-Mem (paper, Sec. C.3): choose from snapshots and frontiers by a decision model, and trust the memory."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from evonav import _core
from evonav.agents.agent import AgentAction
from evonav.agents.explorer import AS_THREE_D_MEM
from evonav.agents.navigator import NavigationTarget, NavigatorConfig
from evonav.agents.navigator_agent import NavigatorAgent
from evonav.agents.three_d_mem.questions import PrefilterQuestion, SnapshotCandidate, SnapshotQuestion
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.pictures import crop_of, picture_of
from evonav.decision.question import DecisionModel
from evonav.decision.text.language import is_structure
from evonav.memory.objects import ObjectEntry
from evonav.memory.views import StoredView, ViewStore
from evonav.points import Point2
from evonav.sensors.observation import Observation
from evonav.tasks.public import TaskInfo

NO_ANSWER = "aborted: no valid answer"
"""The reason of a stop when the decision model gave no valid answer."""
NOTHING_LEFT = "aborted: no snapshot and no frontier left"
"""The reason of a stop when there was nothing to ask about."""


@dataclass(frozen=True, slots=True)
class ThreeDMemConfig:
    """3D-Mem's constants."""

    navigator: NavigatorConfig = field(default_factory=lambda: NavigatorConfig(explorer=AS_THREE_D_MEM))
    max_classes: int = 10
    """Largest number of classes that pass the prefilter."""
    recluster_reach_m: float = 4.0
    """Entries nearer to the agent than this are clustered again in each round: its 3.5 m of detections and 0.5 m."""
    num_tries: int = 3
    """Number of tries before a question without a valid answer counts as failed."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A view, and the entries that it represents."""

    view: StoredView
    entry_ids: tuple[int, ...]
    """Ids of the entries, at least one; all are seen in the view."""


class SnapshotMemory:
    """Keeps each entry in exactly one snapshot, whose view shows it.

    Frames (views with their detections) and snapshots follow entries that merge or vanish.
    """

    def __init__(self, reach_m: float) -> None:
        """Create a memory that clusters entries nearer to the agent than `reach_m` again at each update."""
        self.reach_m = reach_m
        self.snapshots: list[Snapshot] = []
        """Snapshots by ascending id of their views."""
        self._frames: dict[int, dict[int, float]] = {}
        """Confidences of the remembered entries that each view shows, by ids, for views that show one."""
        self._num_views = 0

    def update(self, views: ViewStore, entries: Sequence[ObjectEntry], agent_m: Point2) -> None:
        """Add the views that came since the last update, and cluster the entries that are new or near the agent.

        Args:
            views: The view store, the same at each call.
        """
        self._add_frames(views, {entry.id for entry in entries})
        frame_of_view = {view_id: index for index, view_id in enumerate(self._frames)}
        before = [
            (frame_of_view[snapshot.view.id], list(snapshot.entry_ids))
            for snapshot in self.snapshots
            if snapshot.view.id in frame_of_view
        ]
        after = _core.update_snapshots(
            [(entry.id, (entry.centre_m[0], entry.centre_m[2])) for entry in entries],
            [list(frame.items()) for frame in self._frames.values()],
            before,
            agent_m=agent_m,
            reach_m=self.reach_m,
        )
        view_ids = list(self._frames)
        self.snapshots = [Snapshot(views.views[view_ids[frame]], tuple(entry_ids)) for frame, entry_ids in after]

    def _add_frames(self, views: ViewStore, remembered: set[int]) -> None:
        """Make frames of new views, and drop forgotten entries from all frames."""
        for view in views.views[self._num_views :]:
            self._frames[view.id] = {}
            for seen in view.seen:
                if seen.entry_id is not None:
                    _note(self._frames[view.id], views.resolve(seen.entry_id), seen.confidence)
        self._num_views = len(views.views)
        for view_id, frame in list(self._frames.items()):
            if not frame.keys() <= remembered:
                renamed: dict[int, float] = {}
                for entry_id, confidence in frame.items():
                    _note(renamed, views.resolve(entry_id), confidence)
                frame = {entry_id: confidence for entry_id, confidence in renamed.items() if entry_id in remembered}
                self._frames[view_id] = frame
            if not frame:
                del self._frames[view_id]


class ThreeDMem(NavigatorAgent):
    """Walks to an object in a snapshot and stops there, whether or not it is still there."""

    def __init__(self, config: ThreeDMemConfig | None = None, decision: DecisionModel | None = None) -> None:
        self.config = config or ThreeDMemConfig()
        super().__init__(self.config.navigator, decision, num_tries=self.config.num_tries)

    def begin_task(self, task: TaskInfo) -> None:
        """Forget everything."""
        super().begin_task(task)
        self._snapshots = SnapshotMemory(self.config.recluster_reach_m)

    def act(self, observation: Observation) -> AgentAction:
        """Stop at the committed object if it was reached; else look, cluster, decide and move on."""
        self._queries.begin_round()
        self._candidates = ()
        navigator = self._navigator
        self._details: dict[str, Any] = {"num_snapshots_before": len(self._snapshots.snapshots)}
        reached = navigator.reached(observation)
        if reached is not None:
            return self._stop("arrived", reached.entry_id)
        committed = navigator.target
        navigator.observe(observation)
        if navigator.target is None:
            navigator.target = committed  # until arrival, even where a clean-up dropped its entry
        here = (observation.pose.x_m, observation.pose.z_m)
        self._snapshots.update(navigator.views, navigator.objects.entries, here)
        if navigator.target is not None:
            navigator.aim()
            return self._approach(navigator.target)
        return self._decide(observation)

    def _decide(self, observation: Observation) -> AgentAction:
        """Ask which classes matter, then where to go: to an object of a snapshot, or to a frontier."""
        navigator = self._navigator
        here = (observation.pose.x_m, observation.pose.z_m)
        remembered = {entry.id: navigator.candidate(entry) for entry in navigator.objects.entries}
        shown = self._surviving(remembered)
        frontiers = navigator.explorer.frontiers
        if not shown and not frontiers:
            self._counters["aborts_nothing_left"] += 1
            return self._stop(NOTHING_LEFT)
        question = SnapshotQuestion(
            goal=self._goal,
            position_m=here,
            snapshots=[self._candidate(snapshot, remembered) for snapshot in shown],
            frontiers=self._frontier_candidates(here),
            surroundings=list(remembered.values()),
            num_rounds_left=observation.num_rounds_left,
            unseen_m2=self._unseen_m2(),
            heading_view=self._heading_view(),
        )
        self._candidates = tuple(entry_id for snapshot in shown for entry_id in snapshot.entry_ids)
        choice = self._queries.ask(question)
        if choice is None:
            self._counters["aborts_no_answer"] += 1
            return self._stop(NO_ANSWER)
        reason = self._queries.reason
        if choice.snapshot is None:
            return self._go_to_frontier(frontiers[choice.index], reason)
        self._details["snapshot"] = shown[choice.snapshot].view.id
        return self._go_to_object(question.snapshots[choice.snapshot].objects[choice.index], reason)

    def _surviving(self, remembered: Mapping[int, ObjectCandidate]) -> list[Snapshot]:
        """Return the snapshots with objects of the useful classes, without other objects."""
        snapshots = self._snapshots.snapshots
        labels = {remembered[entry_id].label for snapshot in snapshots for entry_id in snapshot.entry_ids}
        names = sorted(label for label in labels if not is_structure(label))  # a window is never the goal
        useful: tuple[str, ...] = ()
        if names:
            answer = self._queries.ask(PrefilterQuestion(self._goal, names, self.config.max_classes))
            useful = answer or ()  # without an answer there are no snapshots, as in the original
        self._details["prefilter"] = list(useful)
        filtered = [
            Snapshot(snapshot.view, tuple(i for i in snapshot.entry_ids if remembered[i].label in useful))
            for snapshot in snapshots
        ]
        surviving = [snapshot for snapshot in filtered if snapshot.entry_ids]
        self._details["num_snapshots_shown"] = len(surviving)
        return surviving

    def _candidate(self, snapshot: Snapshot, remembered: Mapping[int, ObjectCandidate]) -> SnapshotCandidate:
        """Return a snapshot as the question shows it; crops are from its own view."""
        navigator, view = self._navigator, snapshot.view
        objects: list[ObjectCandidate] = []
        for entry_id in snapshot.entry_ids:
            seen = navigator.views.seen_in(view, entry_id) if self._shows_images else None
            crop = None if seen is None else crop_of(view, seen.box_px)
            objects.append(replace(remembered[entry_id], crop=crop))
        image = picture_of(view, navigator.config.image_px) if self._shows_images else None
        return SnapshotCandidate(view.id, objects, image)

    def _go_to_object(self, chosen: ObjectCandidate, reason: str) -> AgentAction:
        """Commit to an entry, wherever it is."""
        goal_m = self._navigator.observation_point(chosen.ground_m)
        if goal_m is None:
            self._counters["unmapped_choices"] += 1
            goal_m = chosen.ground_m  # the planner ends at the nearest free point
        return self._approach(NavigationTarget(chosen.entry_id, goal_m, chosen.ground_m), reason)

    def _round_counters(self) -> Mapping[str, int]:
        counters = self._navigator.explorer.counters
        return {**super()._round_counters(), **{name: counters[name] for name in ("conflicts", "cells_cleared")}}

    def _round_details(self, reason: str) -> Mapping[str, Any]:
        return {
            **self._details,
            "num_snapshots": len(self._snapshots.snapshots),
            **super()._round_details(reason),
        }


def _note(frame: dict[int, float], entry_id: int, confidence: float) -> None:
    """Store a detection's confidence; of several detections of an entry the largest counts."""
    frame[entry_id] = max(confidence, frame.get(entry_id, confidence))
