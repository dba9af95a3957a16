"""Fail-then-Update (paper, Sec. C.4): Frontier-Update that looks whether its target is there before it stops."""

import math
from typing import Literal

from evonav.agents.frontier_update import FrontierUpdate, FrontierUpdateConfig
from evonav.decision.questions.frontier_update import Sighting, VerifyQuestion
from evonav.decision.questions.question import DecisionModel
from evonav.memory.views import pixels_of
from evonav.sensors.observation import Observation, View


class FailThenUpdate(FrontierUpdate):
    """On arrival it asks whether the present view supports the entry; if not, the entry goes and the search goes on."""

    def __init__(
        self,
        config: FrontierUpdateConfig | None = None,
        decision: DecisionModel | None = None,
        verify_views: Literal["facing", "all"] = "facing",
    ) -> None:
        super().__init__(config, decision)
        self._verify_views = verify_views

    def _stops_at_sight_of_place(self) -> bool:
        return False

    def _is_confirmed(self, entry_id: int, observation: Observation) -> bool:
        navigator = self._navigator
        entry = navigator.objects.entry(entry_id)
        if entry is None:
            return False
        first = 0 if self._verify_views == "all" else -1
        views, stored = observation.views[first:], navigator.round_views[first:]
        images = [pixels_of(view, navigator.config.image_px) for view in stored]
        self._counters["verifications"] += 1
        is_present = self._asker.ask(
            VerifyQuestion(
                goal=self._goal,
                entry=navigator.candidate(entry, with_images=self.sensing.needs_rgb),
                seen=[sighting for view in views for sighting in self._sightings(entry_id, view)],
                image_share=image_share(observation.views[-1], entry.centre_m, entry.size_m),
                views=[image for image in images if image is not None],
            )
        )
        return is_present is not False  # without an answer the entry stays, and the stage ends here

    def _sightings(self, entry_id: int, view: View) -> list[Sighting]:
        compared = self._navigator.objects.compare(entry_id, view)
        return [
            Sighting(label, overlap, distance_m)
            for label, overlap, distance_m in zip(
                view.detections.labels, compared.overlap.tolist(), compared.distance_m.tolist(), strict=True
            )
        ]

    def _reject(self, entry_id: int) -> None:
        if self._navigator.objects.remove(entry_id):
            self._counters["rejected_entries"] += 1


def image_share(view: View, centre_m: tuple[float, float, float], size_m: tuple[float, float, float]) -> float:
    """About how much of an image an object fills: its box's largest face seen from the camera's distance, 0..1."""
    pose, intrinsics = view.pose, view.intrinsics
    distance_m = max(math.dist(pose.position_m, centre_m), 0.1)
    edges_px = sorted((edge_m / distance_m * intrinsics.focal_px for edge_m in size_m), reverse=True)
    return min(1.0, edges_px[0] * edges_px[1] / (intrinsics.width_px * intrinsics.height_px))
