"""Fail-then-Update (paper, Sec. C.4): Frontier-Update that checks on arrival whether its target is there."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from evonav.agents.agent import AgentAction
from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.frontier_update.questions import ComparedDetection, VerifyQuestion
from evonav.decision.pictures import Picture, picture_of
from evonav.decision.question import DecisionModel
from evonav.memory.objects import ObjectEntry
from evonav.memory.presence import DepthEvidence
from evonav.points import Point3
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

    def _act_at_place(self, entry_id: int, observation: Observation) -> AgentAction | None:
        entry = self._navigator.objects.entry(entry_id)
        if entry is None:
            return None
        views, images = self._views_to_verify(observation), self._images_to_verify()
        return self._verify(entry, self._verify_question(entry, views, images))

    def _verify(self, entry: ObjectEntry, question: VerifyQuestion) -> AgentAction | None:
        """Ask whether an entry's object is there; stop if it is, else delete the entry and return `None`."""
        self._counters["verifications"] += 1
        answer = self._queries.ask(question)
        is_present = self._verification.unanswered_means == "yes" if answer is None else answer
        if is_present:
            return self._stop("verified", entry.id)
        self._reject(entry)
        return None

    def _verify_question(self, entry: ObjectEntry, views: Sequence[View], images: list[Picture]) -> VerifyQuestion:
        """Ask about an entry by what views of its place show."""
        remembered = self._navigator.candidate(entry)
        return VerifyQuestion(
            goal=self._goal,
            entry=self._navigator.with_images(remembered) if self._shows_images else remembered,
            seen=[sighting for view in views for sighting in self._sightings(entry.id, view)],
            evidence=self._evidence(entry.id, views),
            views=images,
        )

    def _views_to_verify(self, observation: Observation) -> Sequence[View]:
        """Return the views of a round that verification looks at."""
        return observation.views if self._verification.verify_views == "all" else observation.views[-1:]

    def _images_to_verify(self) -> list[Picture]:
        """Return the images of these views, if the model looks at images."""
        navigator = self._navigator
        views = navigator.round_views if self._verification.verify_views == "all" else navigator.round_views[-1:]
        images = (picture_of(view, navigator.config.image_px) for view in views)
        return [image for image in images if image is not None]

    def _evidence(self, entry_id: int, views: Sequence[View]) -> DepthEvidence:
        """Return what the view that hides least of an entry shows of it."""
        found = [evidence for view in views for evidence in self._navigator.objects.depth_evidence([entry_id], view)]
        return max(found, key=lambda evidence: (evidence.num_not_hidden, evidence.num_in_view))

    def _sightings(self, entry_id: int, view: View) -> list[ComparedDetection]:
        compared = self._navigator.objects.compare(entry_id, view)
        return [
            ComparedDetection(label, overlap, distance_m)
            for label, overlap, distance_m in zip(
                view.detections.labels, compared.overlap.tolist(), compared.distance_m.tolist(), strict=True
            )
        ]

    def _reject(self, entry: ObjectEntry) -> None:
        """Delete an entry whose object is not at its place."""
        self._navigator.objects.remove(entry.id)
        self._counters["rejected_entries"] += 1
        self._rejected.append((entry.id, entry.label, entry.centre_m))
        self._details = {**self._details, "rejected": [rejected_id for rejected_id, _, _ in self._rejected]}

    def _is_offered(self, entry: ObjectEntry) -> bool:
        limit = self._verification.hide_after_rejections
        is_offered = super()._is_offered(entry)
        if limit is None or not is_offered:
            return is_offered
        times = sum(
            label == entry.label and math.dist(centre_m, entry.centre_m) <= SAME_PLACE_M
            for _, label, centre_m in self._rejected
        )
        return times < limit
