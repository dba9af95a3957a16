"""Fail-then-Update (paper, Sec. C.4): Frontier-Update that checks on arrival whether its target is there."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from evonav.agents.agent import AgentAction
from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.frontier_update.questions import Sighting, VerifyQuestion, identity_question
from evonav.agents.frontier_update.relook import FirstLook, RelookConfig, place_from_another_side
from evonav.agents.navigator import Target
from evonav.decision.pictures import Picture, picture_of
from evonav.decision.question import DecisionModel
from evonav.memory.objects import ObjectEntry
from evonav.memory.presence import DepthEvidence, Presence
from evonav.records import Point2, Point3
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
    relook: RelookConfig | None = None
    """Conditions of a second look, from another side, before the question is asked; `None` for no such look.

    It is offered where neither detections nor depth tell whether the object is there, once an entry and stage."""
    checks_identity: bool = False
    """Whether an entry that is there, but contradicts the goal, is set aside for the stage in place of ending it.

    Entries that were set aside come back when nothing else is left, or at `reserve_rounds`; then none is checked."""
    reserve_rounds: int = 8
    """Number of remaining rounds from which identity is no longer checked; as the text matcher's `hurry_rounds`."""
    stop_within_m: float | None = None
    """Distance to the middle of the chosen entry from which the agent asks at once, if a view of the round detects it.

    `None`: it asks at the place to stand, 1.5 m from the middle."""


class FailThenUpdate(FrontierUpdate):
    """Asks on arrival whether the present view supports the entry; if not, it deletes the entry and searches on."""

    def __init__(self, config: FailThenUpdateConfig | None = None, decision: DecisionModel | None = None) -> None:
        self._verification = config or FailThenUpdateConfig()
        super().__init__(self._verification, decision)
        self._rejected: list[tuple[int, str, Point3]] = []
        self._set_aside: set[int] = set()
        """Entries of this stage that are there, but contradict the goal."""
        self._accepts_any = False
        """Whether identity is no longer checked in this stage."""
        self._first_looks: list[FirstLook] = []
        """Looks of this stage that told nothing and led to a second one."""

    def begin_task(self, task: TaskInfo) -> None:
        """Forget everything."""
        super().begin_task(task)
        self._counters.update(verifications=0, rejected_entries=0)
        if self._verification.checks_identity:
            self._counters.update(identity_checks=0, set_aside=0)
        if self._verification.stop_within_m is not None:
            self._counters.update(early_looks=0)
        if self._verification.relook is not None:
            self._counters.update(relooks=0, relooks_yes=0, relooks_no=0, relooks_unknown=0, relooks_without_place=0)

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal; entries rejected in the last stage are no longer in memory."""
        super().begin_stage(goal)
        self._rejected.clear()
        self._set_aside.clear()
        self._accepts_any = False
        self._first_looks.clear()
        self._details = {}

    def _stops_at_sight_of_place(self) -> bool:
        return False

    def _in_reach(self, observation: Observation) -> Target | None:
        """Return the committed target if it is near and this round's views detect it."""
        target, within_m = self._navigator.target, self._verification.stop_within_m
        if target is None or within_m is None or math.dist(target.centre_m, _here(observation)) >= within_m:
            return None
        if not self._navigator.is_detected(target.entry_id):
            return None
        self._counters["early_looks"] += 1
        return target

    def _act_at_place(self, entry_id: int, observation: Observation) -> AgentAction | None:
        navigator = self._navigator
        entry = navigator.objects.entry(entry_id)
        if entry is None:
            return None
        first_look = next((it for it in self._first_looks if navigator.views.resolve(it.entry_id) == entry_id), None)
        question = self._verify_question(entry, observation, first_look)
        presence, why = question.presence(self._matcher)
        if presence is Presence.UNKNOWN and first_look is None:
            action = self._look_again(entry, observation, why)
            if action is not None:
                return action
        self._counters["verifications"] += 1
        answer = self._queries.ask(question)
        is_present = self._verification.unanswered_means == "yes" if answer is None else answer
        if first_look is not None:
            outcome = "no" if not is_present else "unknown" if presence is Presence.UNKNOWN else "yes"
            self._counters[f"relooks_{outcome}"] += 1
        if not is_present:
            self._reject(entry)
            return None
        if self._verification.checks_identity and not self._may_be_goal(entry, observation):
            self._counters["set_aside"] += 1
            self._set_aside.add(entry_id)
            self._details = {**self._details, "set_aside": sorted(self._set_aside)}
            return None
        return self._stop("verified", entry_id)

    def _may_be_goal(self, entry: ObjectEntry, observation: Observation) -> bool:
        """Return whether an entry does not contradict the goal, or the agent has no time for another one."""
        if self._accepts_any or observation.num_rounds_left <= self._verification.reserve_rounds:
            return True
        self._counters["identity_checks"] += 1
        question = identity_question(self._goal, entry, self._navigator, with_images=self._shows_images)
        return self._queries.ask(question) is not False

    def _decide(self, observation: Observation) -> AgentAction:
        """Decide as Frontier-Update does; take entries back that were set aside if nothing else is left."""
        if self._set_aside and not self._is_anything_left(observation):
            self._set_aside.clear()
            self._accepts_any = True
        return super()._decide(observation)

    def _is_anything_left(self, observation: Observation) -> bool:
        """Return whether there is time, and a frontier or another entry with the goal's name."""
        if observation.num_rounds_left <= self._verification.reserve_rounds:
            return False
        navigator = self._navigator
        goal = self._matcher.parsed(self._goal)
        return bool(navigator.explorer.frontiers) or any(
            self._is_offered(entry) and self._matcher.names_goal(goal, navigator.candidate(entry))
            for entry in navigator.objects.entries
        )

    def _verify_question(
        self, entry: ObjectEntry, observation: Observation, first_look: FirstLook | None
    ) -> VerifyQuestion:
        """Ask about an entry by what is in view now, and by what the first look at its place showed."""
        navigator = self._navigator
        remembered = navigator.candidate(entry)
        views, images = self._views_to_verify(observation), self._images_to_verify()
        if first_look is not None:
            views, images = [*first_look.views, *views], [*first_look.images, *images]
        return VerifyQuestion(
            goal=self._goal,
            entry=navigator.with_images(remembered) if self._shows_images else remembered,
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

    def _look_again(self, entry: ObjectEntry, observation: Observation, why: str) -> AgentAction | None:
        """Go to another side of an entry that the first look told nothing about; `None` if there is no such place."""
        config = self._verification.relook
        if config is None:
            return None
        max_way_m = min(config.max_way_m, (observation.num_rounds_left - 2) * self.sensors.max_travel_m)
        views = self._views_to_verify(observation)
        place = place_from_another_side(self._navigator, entry, views[-1].pose, max_way_m, config)
        if place is None:
            self._counters["relooks_without_place"] += 1
            return None
        self._counters["relooks"] += 1
        self._first_looks.append(FirstLook(entry.id, tuple(views), tuple(self._images_to_verify())))
        self._details = {**self._details, "relooks": [look.entry_id for look in self._first_looks]}
        centre_m = (entry.centre_m[0], entry.centre_m[2])
        reason = f"a second look from {place.turn_deg:.0f} degrees around, {place.way_m:.1f} m away: {why}"
        return self._approach(Target(entry.id, place.position_m, centre_m, keeps_place=True), reason)

    def _evidence(self, entry_id: int, views: Sequence[View]) -> DepthEvidence:
        """Return what the view that hides least of an entry shows of it."""
        found = [evidence for view in views for evidence in self._navigator.objects.depth_evidence([entry_id], view)]
        return max(found, key=lambda evidence: (evidence.num_not_hidden, evidence.num_in_view))

    def _sightings(self, entry_id: int, view: View) -> list[Sighting]:
        compared = self._navigator.objects.compare(entry_id, view)
        return [
            Sighting(label, overlap, distance_m)
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
        is_offered = super()._is_offered(entry) and not self._is_set_aside(entry)
        if limit is None or not is_offered:
            return is_offered
        times = sum(
            label == entry.label and math.dist(centre_m, entry.centre_m) <= SAME_PLACE_M
            for _, label, centre_m in self._rejected
        )
        return times < limit

    def _is_set_aside(self, entry: ObjectEntry) -> bool:
        return any(self._navigator.views.resolve(entry_id) == entry.id for entry_id in self._set_aside)


def _here(observation: Observation) -> Point2:
    return (observation.pose.x_m, observation.pose.z_m)
