"""The part that all agents but UniGoal share: a map with frontiers, object entries, stored views, one committed target.

Specification: the common substrate of the paper's Sec. C.3 and C.4, with 3D-Mem's parameters.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

from evonav.agents.explorer import AS_THREE_D_MEM_PLUS, Explorer, ExplorerConfig
from evonav.agents.viewpoint import observation_point
from evonav.decision.candidates import FrontierCandidate, ObjectAppearance, ObjectCandidate
from evonav.decision.pictures import Picture, crop_of, picture_of
from evonav.decision.text.language import canonical
from evonav.memory import ObjectMap, ObjectMapConfig, forgetting
from evonav.memory.colours import Layout
from evonav.memory.objects import ObjectEntry, ObjectUpdate
from evonav.memory.occupancy import FREE, UNKNOWN
from evonav.memory.views import StoredView, ViewStore
from evonav.points import Point2
from evonav.sensors.observation import MapFrame, Observation, View

DAY_S = 86400.0
KNOWN_RADIUS_M = 1.0
"""Radius around an entry within which `ObjectAppearance.known_share` counts cells."""


@dataclass(frozen=True, slots=True)
class NavigatorConfig:
    """3D-Mem's constants, and values that the paper leaves open."""

    explorer: ExplorerConfig = field(default_factory=ExplorerConfig)
    objects: ObjectMapConfig = field(default_factory=ObjectMapConfig)
    forgetting: str = "never"
    """Rule by which object entries are forgotten (`evonav.memory.forgetting`); the paper's agents forget none."""
    observation_distance_m: float = 1.5
    """Distance from which to look at an object."""
    aim_again_m: float = 0.25
    """The place to stand is chosen again when the middle of the entry has shifted by more than this."""
    image_px: int = 360
    """Longest edge of an image in a prompt."""
    background: tuple[str, ...] = ("wall", "floor", "ceiling", "carpet", "door", "rug", "bath mat")
    """Nouns of what is not remembered: 3D-Mem's list, which has doors and not windows."""


WITH_FALLBACK = NavigatorConfig(explorer=AS_THREE_D_MEM_PLUS)
"""The configuration of agents whose map takes a cell's last observation, and that explore all that is unknown."""


@dataclass(frozen=True, slots=True)
class NavigationTarget:
    """An object entry that the agent is committed to."""

    entry_id: int
    goal_m: Point2
    """The place to stand."""
    centre_m: Point2
    keeps_place: bool = False
    """Whether the place to stand is kept when the middle of the entry shifts."""


class Navigator:
    """Integrates observations, and turns choices into places to go."""

    def __init__(
        self,
        map_frame: MapFrame,
        config: NavigatorConfig,
        *,
        names_colours: bool = False,
        keeps_layouts: bool = False,
        keeps_detections: bool = True,
    ) -> None:
        """Create an empty memory.

        Args:
            names_colours: True to keep what views show by name, for rules that look, in place of their images.
            keeps_layouts: True to keep, with `names_colours`, what surrounds objects in views, too.
            keeps_detections: False to keep no detections of views, for an agent that never looks at them again.
        """
        self.config = config
        self._background = frozenset(canonical(noun) for noun in config.background)
        self._names_colours = names_colours
        self.explorer = Explorer(map_frame, config.explorer)
        self.objects = ObjectMap(config.objects)
        self._forgetting = forgetting.make(config.forgetting)
        self.views = ViewStore(
            names_colours=names_colours, keeps_layouts=keeps_layouts, keeps_detections=keeps_detections
        )
        self.observers: list[Callable[[ObjectMap, View, ObjectUpdate], None]] = []
        """Functions that are called after the object map has taken in a view, before anything is forgotten."""
        self.target: NavigationTarget | None = None
        self.round_views: list[StoredView] = []
        """Views of the last round, the heading view last."""
        self._detected_ids: list[int | None] = []
        """Ids that the entries of the last round's detections had then."""
        self._first_map_view = 0
        """Id of the first view in the present map."""
        self.stage = 1
        self.round = -1

    def begin_stage(self, stage: int) -> None:
        """Drop the target and start counting views to the next clean-up; everything else stays."""
        self.target = None
        self.stage = stage
        self.round = -1
        self.objects.begin_stage(stage)
        self._forgetting.begin_visit(self.objects, self._time_s)

    @property
    def _time_s(self) -> float:
        """Time for forgetting rules: agents have no clock, so a stage counts as a day."""
        return (self.stage - 1) * DAY_S

    def observe(self, observation: Observation) -> bool:
        """Integrate a round's views, without background: entries first, then cells and frontiers.

        Returns:
            Whether the views contradicted the map, which then holds this round's views alone; the target is dropped.
        """
        self.round += 1
        self.round_views = []
        self._detected_ids = []
        for view in map(self._without_background, observation.views):
            update = self.objects.update(view)
            self.views.follow(update.merged)
            self._detected_ids += update.entry_ids
            self.round_views.append(self.views.add(view, update.entry_ids, stage=self.stage, round_=self.round))
            for observer in self.observers:
                observer(self.objects, view, update)
            self._follow(update.removed)
            self._follow(self._forgetting.after_update(self.objects, view, update, self._time_s))
        is_outdated = self.explorer.observe(observation)
        if is_outdated:
            self.target = None
            self._first_map_view = self.round_views[0].id
        return is_outdated

    def explore_anew(self, observation: Observation) -> None:
        """Forget the map and its frontiers, and begin a new map with this round's views; entries stay as they are."""
        self.explorer.clear()
        self.explorer.observe(observation)
        self._first_map_view = self.round_views[0].id

    def without_background(self, observation: Observation) -> Observation:
        """Return an observation without the detections that are not remembered."""
        return replace(observation, views=tuple(self._without_background(view) for view in observation.views))

    def _without_background(self, view: View) -> View:
        labels = view.detections.labels
        left = [index for index, label in enumerate(labels) if canonical(label) not in self._background]
        return view if len(left) == len(labels) else replace(view, detections=view.detections.taken(left))

    def _follow(self, removed: Sequence[int]) -> None:
        """Follow the target's entry if it was merged into another; drop the target if the entry was removed."""
        target = self.target
        if target is None:
            return
        entry_id = self.views.resolve(target.entry_id)
        self.target = None if entry_id in removed else replace(target, entry_id=entry_id)

    def reached(self, observation: Observation) -> NavigationTarget | None:
        """Return the committed target if its place was reached, or cannot be approached any further."""
        is_done = observation.has_arrived or not observation.is_action_success
        return self.target if is_done else None

    def is_detected(self, entry_id: int) -> bool:
        """Return whether a view of the last round detects an entry."""
        return any(one is not None and self.views.resolve(one) == entry_id for one in self._detected_ids)

    def observation_point(self, centre_m: Point2) -> Point2 | None:
        """Return where to stand to look at a place; `None` if the map knows no free floor around it."""
        occupancy = self.explorer.map
        return observation_point(
            occupancy.cells == FREE, occupancy.map_frame, centre_m, self.config.observation_distance_m
        )

    def aim(self) -> None:
        """Update the target's place: the first view of a table may have shown only its corner."""
        target = self.target
        entry = None if target is None else self.objects.entry(target.entry_id)
        if target is None or target.keeps_place or entry is None:
            return
        centre_m = (entry.centre_m[0], entry.centre_m[2])
        if math.dist(centre_m, target.centre_m) > self.config.aim_again_m:
            goal_m = self.observation_point(centre_m) or target.goal_m
            self.target = NavigationTarget(entry.id, goal_m, centre_m)

    def candidate(self, entry: ObjectEntry, *, with_looks: bool = True) -> ObjectCandidate:
        """Return an entry of the object memory as questions describe it, without images.

        Args:
            with_looks: False to leave out what its views show, which takes time.
        """
        candidate = _candidate_of(entry)
        if not (self._names_colours and with_looks):
            return candidate
        return replace(candidate, appearance=self._appearance(entry))

    def candidates(self, entries: Sequence[ObjectEntry]) -> list[ObjectCandidate]:
        """Return entries as `candidate` describes each."""
        return [self.candidate(entry) for entry in entries] if self._names_colours else [*map(_candidate_of, entries)]

    def _appearance(self, entry: ObjectEntry) -> ObjectAppearance | None:
        """Return what the views of an entry show; `None` without any."""
        largest, latest = self.views.largest(entry.id), self.views.latest(entry.id)
        shares = [seen.colours for _, seen in largest if seen.colours is not None]
        if not shares or latest is None:
            return None
        around = [seen.layout for _, seen in largest if seen.layout is not None]
        shown = (seen.entry_id for view in (*(view for view, _ in largest), latest) for seen in view.seen)
        layout = Layout(_mean([one.near for one in around]), _mean([one.whole for one in around])) if around else None
        return ObjectAppearance(
            colours=_mean(shares),
            shown_ids=frozenset(self.views.resolve(entry_id) for entry_id in shown if entry_id is not None),
            known_share=self.explorer.map.known_share((entry.centre_m[0], entry.centre_m[2]), KNOWN_RADIUS_M),
            layout=layout,
        )

    def unseen_m2(self) -> float:
        """Return the area that the map does not know; 0 if there is no frontier behind which it could lie."""
        if not self.explorer.frontiers:
            return 0.0
        cells = self.explorer.map.cells
        return float((cells == UNKNOWN).sum()) * self.explorer.map.map_frame.cell_m**2

    def with_images(self, candidate: ObjectCandidate) -> ObjectCandidate:
        """Return a candidate with the best crop of its entry, and the view in which the entry was last seen."""
        best, latest = self.views.best(candidate.entry_id), self.views.latest(candidate.entry_id)
        return replace(
            candidate,
            crop=None if best is None else crop_of(best[0], best[1].box_px),
            view=None if latest is None else picture_of(latest, self.config.image_px),
        )

    def frontier_candidates(self, here: Point2, *, with_images: bool = False) -> list[FrontierCandidate]:
        """Return all frontiers as questions describe them."""
        frontiers = self.explorer.frontiers
        if self._names_colours:
            distances_m = self.explorer.ways_m(here, [frontier.position_m for frontier in frontiers])
        else:
            distances_m = [math.dist(frontier.position_m, here) for frontier in frontiers]
        return [
            FrontierCandidate(
                frontier.id,
                frontier.position_m,
                distance_m,
                self.image_towards(frontier.position_m) if with_images else None,
                is_current=self.explorer.is_going_to(frontier),
            )
            for frontier, distance_m in zip(frontiers, distances_m, strict=True)
        ]

    def image_towards(self, place_m: Point2) -> Picture | None:
        """Return a frontier as the agent saw it: the stored view whose axis points most nearly at it.

        3D-Mem renders a fresh view for each new frontier. Here one of the stored views must do, since no agent may look
        around without spending a round. Views from before the map was rebuilt are not used: they are outdated.
        """
        best: tuple[float, StoredView] | None = None
        for view in reversed(self.views.views[self._first_map_view :]):
            if view.jpeg is None or (best is not None and view.stage != best[1].stage):
                break
            dx_m, dz_m = place_m[0] - view.pose.x_m, place_m[1] - view.pose.z_m
            distance_m = math.hypot(dx_m, dz_m)
            off_axis_rad = abs(math.remainder(math.atan2(dx_m, dz_m) - view.pose.yaw_rad, math.tau))
            cost = off_axis_rad + 0.1 * distance_m
            if best is None or cost < best[0]:
                best = (cost, view)
        return None if best is None else picture_of(best[1], self.config.image_px)


@lru_cache(maxsize=1024)  # an entry that has not changed is the same object as before
def _candidate_of(entry: ObjectEntry) -> ObjectCandidate:
    return ObjectCandidate(entry.id, entry.label, entry.centre_m, entry.size_m, entry.num_detections)


def _mean(rows: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
    """Return the mean of each column."""
    return tuple(math.fsum(column) / len(rows) for column in zip(*rows, strict=True))
