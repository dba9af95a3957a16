"""MSGNav's memory beyond the shared one, the parts of questions made from it, and the choices among them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evonav.agents.msgnav.scene_graph import SceneGraph
from evonav.agents.navigator import Navigator
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.pictures import Picture, picture_of
from evonav.decision.text.language import canonical, similarity
from evonav.decision.text.matcher import Matcher
from evonav.memory.clouds import ViewClouds, clouds_of
from evonav.memory.views import StoredView
from evonav.points import Point2
from evonav.sensors.observation import Observation

_MIN_SIMILARITY = 0.4
"""Smallest similarity at which a word may name a label, as for `Matcher.label_score`."""
OTHER_ROOM = "others"
"""The room of entries whose surroundings point to no type of room, named as by the original's classifier."""


@dataclass(frozen=True, slots=True)
class GraphObject:
    """A node of the scene graph."""

    candidate: ObjectCandidate
    room: str
    """The type of room; `others` if it is unknown."""
    neighbour_ids: tuple[int, ...] = ()
    """Ids of entries that are one edge away, ascending."""

    @property
    def entry_id(self) -> int:
        """The id in the object memory."""
        return self.candidate.entry_id


@dataclass(frozen=True, slots=True)
class SeenObject:
    """A detection of an image."""

    label: str
    entry_id: int | None
    """The entry that it belongs to; `None` if it belongs to none, such as a distant object."""
    area_px: int
    centre_m: Point2 | None
    """`(x, z)`; `None` if it has no depth."""


@dataclass(frozen=True, slots=True)
class GraphImage:
    """A stored view: one of the graph's edges, or one of this round."""

    view_id: int
    is_egocentric: bool
    """True if the view is of this round."""
    seen: Sequence[SeenObject]
    """Detections, for models that do not look at images. Not part of the prompt."""
    picture: Picture | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class PastChoice:
    """A choice of an earlier round of this stage that did not lead to the goal."""

    round: int
    kind: Literal["object", "image", "explore"]
    id: int = -1
    """Id of the entry or of the view."""
    category: str = ""
    """The category that the image was said to show."""
    place_m: Point2 | None = None
    """`(x, z)` of the object that was not the goal. Not part of the prompt."""


@dataclass(frozen=True, slots=True)
class GraphChoice:
    """An object of the graph, something in an image, or neither."""

    kind: Literal["object", "image", "explore"]
    id: int = -1
    """Id of the entry, or number of the image."""
    category: str = ""
    """The category to go to in the image."""


class GraphMemory:
    """Entries, stored views and their points, and the scene graph over them."""

    def __init__(self, navigator: Navigator, *, max_edge_m: float) -> None:
        self.navigator = navigator
        self.graph = SceneGraph(max_edge_m=max_edge_m)
        self._matcher = Matcher()
        self._clouds: list[ViewClouds] = []
        self._entry_ids: frozenset[int] = frozenset()

    def observe(self, observation: Observation) -> None:
        """Integrate a round's views: entries, map and frontiers, then the graph."""
        navigator, graph = self.navigator, self.graph
        observation = navigator.without_background(observation)
        navigator.observe(observation)
        became = {entry_id: navigator.views.resolve(entry_id) for entry_id in graph.entry_ids}
        graph.follow({old: new for old, new in became.items() if old != new})
        centres_m = {entry.id: (entry.centre_m[0], entry.centre_m[2]) for entry in navigator.objects.entries}
        graph.prune(centres_m)
        self._entry_ids = frozenset(centres_m)
        for view, stored in zip(observation.views, navigator.round_views, strict=True):
            self._clouds.append(clouds_of(view))
            found = {navigator.views.resolve(one.entry_id) for one in stored.seen if one.entry_id is not None}
            graph.add_view(stored.id, {entry_id: centres_m[entry_id] for entry_id in found if entry_id in centres_m})

    def nodes(self) -> list[GraphObject]:
        """Return every entry with its room and its neighbours.

        MSGNav asks CLIP which kind of room the whole image shows. There is no CLIP here: as for all other agents, the
        room follows from the objects around an entry (`Matcher.room_around`).
        """
        neighbours = self.graph.neighbours()
        candidates = [self.navigator.candidate(entry) for entry in self.navigator.objects.entries]
        signs = self._matcher.room_signs(candidates)
        return [
            GraphObject(
                candidate,
                self._matcher.room_of_signs(candidate.ground_m, signs) or OTHER_ROOM,
                tuple(sorted(neighbours.get(candidate.entry_id, ()))),
            )
            for candidate in candidates
        ]

    def images(self, view_ids: Sequence[int], image_px: int | None) -> list[GraphImage]:
        """Return stored views as questions show them, then those of this round.

        Args:
            view_ids: Views that cover the graph. A view of this round is shown once, among the first.
            image_px: Longest edge of the images; `None` for no images.
        """
        views = self.navigator.views.views
        now = [view.id for view in self.navigator.round_views]
        shown = [*view_ids, *(view_id for view_id in now if view_id not in view_ids)]
        return [self._image(views[view_id], view_id in now, image_px) for view_id in shown]

    def _image(self, view: StoredView, is_egocentric: bool, image_px: int | None) -> GraphImage:
        seen = []
        for one, box_m in zip(view.seen, self._clouds[view.id].boxes_m, strict=True):
            centre_m = None if box_m is None else (box_m[0][0], box_m[0][2])
            seen.append(SeenObject(one.label, self._alive(one.entry_id), one.area_px, centre_m))
        picture = None if image_px is None else picture_of(view, image_px)
        return GraphImage(view.id, is_egocentric, tuple(seen), picture)

    def _alive(self, entry_id: int | None) -> int | None:
        """Return the entry that an entry was merged into, if it still exists."""
        entry_id = None if entry_id is None else self.navigator.views.resolve(entry_id)
        return entry_id if entry_id in self._entry_ids else None

    def recent_views(self, num_rounds: int, max_views: int) -> list[StoredView]:
        """Return the views of the last rounds of this stage, the most recent first.

        Views of earlier stages are left out, since the house may have differed.

        Args:
            num_rounds: Number of rounds, this one included.
        """
        navigator = self.navigator
        recent: list[StoredView] = []
        for view in reversed(navigator.views.views):
            is_recent = view.stage == navigator.stage and view.round > navigator.round - num_rounds
            if not is_recent or len(recent) == max_views:
                break
            recent.append(view)
        return recent

    def detections(self, views: Sequence[StoredView]) -> list[ObjectCandidate]:
        """Return the detections in some views, each by its own points; those of no entry have negative ids."""
        found: list[ObjectCandidate] = []
        for view in views:
            for one, box_m in zip(view.seen, self._clouds[view.id].boxes_m, strict=True):
                if box_m is not None:
                    entry_id = self._alive(one.entry_id)
                    entry_id = -1 - len(found) if entry_id is None else entry_id
                    found.append(ObjectCandidate(entry_id, one.label, *box_m, num_detections=1))
        return found

    def largest_detection(self, view_id: int, category: str) -> tuple[str, NDArray[np.float32]] | None:
        """Return label and `(N, 3)` points of the largest object of a category in a stored view.

        This is the adaptive vocabulary update: MSGNav runs its detector on the image once more, with the category as
        its only word. Under ground truth the recorded masks answer: the one whose label names the category best, such
        as a dining table for a table.
        """
        noun = canonical(category)
        seen = self.navigator.views.views[view_id].seen
        scored = [(similarity(noun, one.label), one.area_px, -index) for index, one in enumerate(seen)]
        score, _, index = max(scored, default=(0.0, 0, 0))
        if score < _MIN_SIMILARITY:
            return None
        index = -index
        points_m = self._clouds[view_id].points_m(index)
        return (seen[index].label, points_m) if len(points_m) else None
