"""Fail-then-Update (paper, Sec. C.4): Frontier-Update that checks on arrival whether its target is there.

`FailThenUpdateIdentity` also checks whether it is the goal.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from evonav.agents.agent import AgentAction
from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.frontier_update.questions import ComparedDetection, IdentityQuestion, VerifyQuestion
from evonav.decision.pictures import Picture, picture_of
from evonav.memory.objects import ObjectEntry
from evonav.memory.presence import DepthEvidence
from evonav.points import Point3
from evonav.sensors.observation import Observation, View
from evonav.tasks.public import Goal

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

    config: FailThenUpdateConfig = FailThenUpdateConfig()
    _counted: ClassVar[tuple[str, ...]] = (*FrontierUpdate._counted, "verifications", "rejected_entries")
    _stops_at_sight_of_place = False

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal; entries rejected in the last stage are no longer in memory."""
        super().begin_stage(goal)
        self._rejected: list[tuple[int, str, Point3]] = []
        self._details = {}

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
        is_present = self.config.unanswered_means == "yes" if answer is None else answer
        if is_present:
            return self._stop("verified", entry.id)
        self._reject(entry)
        return None

    def _verify_question(self, entry: ObjectEntry, views: Sequence[View], images: list[Picture]) -> VerifyQuestion:
        """Ask about an entry by what views of its place show."""
        return VerifyQuestion(
            goal=self._goal,
            entry=self._shown(self._navigator.candidate(entry)),
            seen=[sighting for view in views for sighting in self._sightings(entry.id, view)],
            evidence=self._evidence(entry.id, views),
            views=images,
        )

    def _views_to_verify(self, observation: Observation) -> Sequence[View]:
        """Return the views of a round that verification looks at."""
        return observation.views if self.config.verify_views == "all" else observation.views[-1:]

    def _images_to_verify(self) -> list[Picture]:
        """Return the images of these views, if the model looks at images."""
        navigator = self._navigator
        views = navigator.round_views if self.config.verify_views == "all" else navigator.round_views[-1:]
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
        limit = self.config.hide_after_rejections
        is_offered = super()._is_offered(entry)
        if limit is None or not is_offered:
            return is_offered
        times = sum(
            label == entry.label and math.dist(centre_m, entry.centre_m) <= SAME_PLACE_M
            for _, label, centre_m in self._rejected
        )
        return times < limit


@dataclass(frozen=True, slots=True)
class IdentityConfig(FailThenUpdateConfig):
    """Values of the check of identity."""

    reserve_rounds: int = 8
    """Number of remaining rounds from which identity is no longer checked; as the text matcher's `hurry_rounds`."""


class FailThenUpdateIdentity(FailThenUpdate):
    """Sets an entry that is there, but contradicts the goal, aside for the stage.

    Entries that were set aside come back when nothing else is left, or at `reserve_rounds`; then none is checked.
    """

    config: IdentityConfig = IdentityConfig()
    _counted: ClassVar[tuple[str, ...]] = (*FailThenUpdate._counted, "identity_checks", "set_aside")

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal: what contradicted the last one may be it."""
        super().begin_stage(goal)
        self._set_aside: set[int] = set()
        """Entries of this stage that are there, but contradict the goal."""
        self._accepts_any = False
        """Whether identity is no longer checked in this stage."""

    def act(self, observation: Observation) -> AgentAction:
        """Act as Fail-then-Update does."""
        self._num_rounds_left = observation.num_rounds_left
        return super().act(observation)

    def _verify(self, entry: ObjectEntry, question: VerifyQuestion) -> AgentAction | None:
        if super()._verify(entry, question) is None:
            return None
        if self._may_be_goal(entry):
            return self._stop("verified", entry.id)
        self._counters["set_aside"] += 1
        self._set_aside.add(entry.id)
        self._details = {**self._details, "set_aside": sorted(self._set_aside)}
        return None

    def _may_be_goal(self, entry: ObjectEntry) -> bool:
        """Return whether an entry does not contradict the goal, or the agent has no time for another one."""
        if self._accepts_any or self._num_rounds_left <= self.config.reserve_rounds:
            return True
        self._counters["identity_checks"] += 1
        navigator = self._navigator
        remembered = [navigator.candidate(one) for one in navigator.objects.entries]
        question = IdentityQuestion(self._goal, self._shown(navigator.candidate(entry)), remembered)
        return self._queries.ask(question) is not False

    def _decide(self, observation: Observation) -> AgentAction:
        """Decide as Frontier-Update does; take entries back that were set aside if nothing else is left."""
        if self._set_aside and not self._is_anything_left(observation):
            self._set_aside.clear()
            self._accepts_any = True
        return super()._decide(observation)

    def _is_anything_left(self, observation: Observation) -> bool:
        """Return whether there is time, and a frontier or another entry with the goal's name."""
        if observation.num_rounds_left <= self.config.reserve_rounds:
            return False
        navigator = self._navigator
        goal = self._matcher.parsed(self._goal)
        return bool(navigator.explorer.frontiers) or any(
            self._is_offered(entry) and self._matcher.names_goal(goal, navigator.candidate(entry))
            for entry in navigator.objects.entries
        )

    def _is_offered(self, entry: ObjectEntry) -> bool:
        resolve = self._navigator.views.resolve
        return super()._is_offered(entry) and all(resolve(entry_id) != entry.id for entry_id in self._set_aside)
