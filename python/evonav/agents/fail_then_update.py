"""Fail-then-Update (paper, Sec. C.4): Frontier-Update that looks whether its target is there before it stops."""

import math
from typing import Literal

from evonav.agents.frontier_update import FrontierUpdate, FrontierUpdateConfig, _candidate
from evonav.decision.questions import DecisionModel, Sighting, VerifyQuestion
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
        entry = self._objects.entry(entry_id)
        if entry is None or self._goal is None:
            return False
        views = observation.views if self._verify_views == "all" else observation.views[-1:]
        seen = [sighting for view in views for sighting in self._sightings(entry_id, view)]
        self._counters["verifications"] += 1
        share = image_share(observation.views[-1], entry.centre_m, entry.size_m)
        return self._decision.verify(VerifyQuestion(self._goal, _candidate(entry), seen, share)).is_present

    def _sightings(self, entry_id: int, view: View) -> list[Sighting]:
        compared = self._objects.compare(entry_id, view)
        return [
            Sighting(label, overlap, distance_m)
            for label, overlap, distance_m in zip(
                view.detections.labels, compared.overlap.tolist(), compared.distance_m.tolist(), strict=True
            )
        ]

    def _reject(self, entry_id: int) -> None:
        if self._objects.remove(entry_id):
            self._counters["rejected_entries"] += 1


def image_share(view: View, centre_m: tuple[float, float, float], size_m: tuple[float, float, float]) -> float:
    """About how much of an image an object fills: its box's largest face seen from the camera's distance, 0..1."""
    pose, intrinsics = view.pose, view.intrinsics
    distance_m = max(math.dist(pose.position_m, centre_m), 0.1)
    edges_px = sorted((edge_m / distance_m * intrinsics.focal_px for edge_m in size_m), reverse=True)
    return min(1.0, edges_px[0] * edges_px[1] / (intrinsics.width_px * intrinsics.height_px))
