"""Fail-then-Update (paper, Sec. C.4): Frontier-Update that checks on arrival whether its target is there."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.frontier_update.questions import Sighting, VerifyQuestion
from evonav.decision.candidates import Point3
from evonav.decision.question import DecisionModel
from evonav.memory.objects import ObjectEntry
from evonav.memory.presence import DepthEvidence
from evonav.memory.views import pixels_of
from evonav.sensors.observation import Observation, View
from evonav.tasks.public import Goal, TaskInfo

SAME_PLACE_M = 0.5
"""An entry whose middle is this near that of a rejected one with its label counts as the same."""


@dataclass(frozen=True, slots=True)
class FailThenUpdateConfig(FrontierUpdateConfig):
    """Values that the paper leaves open about the look on arrival."""

    verify_views: Literal["facing", "all"] = "facing"
    """Views in the question: the one towards the entry, or all of the round."""
    unanswered_means: Literal["yes", "no"] = "yes"
    """The answer assumed if there is no valid one; `yes` ends the stage, `no` deletes the entry."""
    hide_after_rejections: int | None = None
    """A safeguard: an entry that was rejected this often at one place in a stage is no candidate for the rest of it.
    `None`: it is offered again."""


class FailThenUpdate(FrontierUpdate):
    """Asks on arrival whether the present view supports the entry; if not, it deletes the entry and searches on."""

    def __init__(self, config: FailThenUpdateConfig | None = None, decision: DecisionModel | None = None) -> None:
        self._verification = config or FailThenUpdateConfig()
        super().__init__(self._verification, decision)
        self._rejected: list[tuple[int, str, Point3]] = []

    def begin_task(self, task: TaskInfo) -> None:
        """Forget everything."""
        super().begin_task(task)
        self._counters.update(verifications=0, rejected_entries=0)

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal; entries rejected in the last stage are no longer in memory."""
        super().begin_stage(goal)
        self._rejected.clear()
        self._details = {}

    def _stops_at_sight_of_place(self) -> bool:
        return False

    def _is_confirmed(self, entry_id: int, observation: Observation) -> bool:
        navigator = self._navigator
        entry = navigator.objects.entry(entry_id)
        if entry is None:
            return False
        remembered = navigator.candidate(entry)
        first = 0 if self._verification.verify_views == "all" else -1
        images = [pixels_of(view, navigator.config.image_px) for view in navigator.round_views[first:]]
        self._counters["verifications"] += 1
        is_present = self._queries.ask(
            VerifyQuestion(
                goal=self._goal,
                entry=navigator.with_images(remembered) if self._shows_images else remembered,
                seen=[sighting for view in observation.views[first:] for sighting in self._sightings(entry_id, view)],
                evidence=self._evidence(entry_id, observation.views[first:]),
                views=[image for image in images if image is not None],
            )
        )
        return self._verification.unanswered_means == "yes" if is_present is None else is_present

    def _evidence(self, entry_id: int, views: Sequence[View]) -> DepthEvidence:
        """Return what the view with the most of an entry's points in it shows of them."""
        found = [evidence for view in views for evidence in self._navigator.objects.depth_evidence([entry_id], view)]
        return max(found, key=lambda evidence: evidence.num_in_view)

    def _sightings(self, entry_id: int, view: View) -> list[Sighting]:
        compared = self._navigator.objects.compare(entry_id, view)
        return [
            Sighting(label, overlap, distance_m)
            for label, overlap, distance_m in zip(
                view.detections.labels, compared.overlap.tolist(), compared.distance_m.tolist(), strict=True
            )
        ]

    def _reject(self, entry_id: int) -> None:
        entry = self._navigator.objects.entry(entry_id)
        if entry is None:
            return
        self._navigator.objects.remove(entry_id)
        self._counters["rejected_entries"] += 1
        self._rejected.append((entry_id, entry.label, entry.centre_m))
        self._details = {"rejected": [rejected_id for rejected_id, _, _ in self._rejected]}

    def _is_offered(self, entry: ObjectEntry) -> bool:
        limit = self._verification.hide_after_rejections
        if limit is None:
            return True
        times = sum(
            label == entry.label and math.dist(centre_m, entry.centre_m) <= SAME_PLACE_M
            for _, label, centre_m in self._rejected
        )
        return times < limit
