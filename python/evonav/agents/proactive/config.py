"""Parameters of Belief-Weighted Search, each part of which can be switched off."""

from dataclasses import dataclass, field

from evonav.agents.explorer import AS_THREE_D_MEM_PLUS
from evonav.agents.navigator import NavigatorConfig


@dataclass(frozen=True, slots=True)
class ChangePrior:
    """Probabilities of a change between two stages."""

    change: float
    """Probability that a room changes."""
    modes: tuple[float, ...]
    """Probability of each way in which it changes, if it does."""
    moved: tuple[float, ...]
    """Share of the room's objects that move, by that way."""
    visited_weight: float = 1.0
    """Weight of a room that the agent visited in the last stage, relative to others."""
    repeated_weight: float = 1.0
    """Factor of a room that seems to have changed before the last stage."""
    same_room: float = 0.5
    """Probability that an object that moved is still in its room (kappa)."""
    knows_rooms: bool = True
    """Whether it knows which objects are frequent in which rooms."""

    @property
    def mean_moved(self) -> float:
        """Probability that an object of a changed room moved."""
        return sum(mode * moved for mode, moved in zip(self.modes, self.moved, strict=True))


FITTED = ChangePrior(change=0.55, modes=(0.45, 0.41, 0.14), moved=(0.26, 0.85, 0.87), same_room=0.99)
"""Counts of 60 training tasks by `scripts/data/fit_priors.py`: 168 transitions, 93 changes, 1,118 moved objects.

The tasks are those of the first 60 houses of `procthor-generated/houses-train`, seed 0. All objects that moved stayed
in their rooms."""


@dataclass(frozen=True, slots=True)
class ProactiveConfig:
    """Parts, and numbers of the rules. All numbers are ours."""

    prior: ChangePrior = FITTED
    """Expectations of changes before any was seen."""

    uses_text: bool = True
    """Weigh entries by how well the goal's text fits what is around them; else all namesakes weigh alike."""
    checks_identity: bool = True
    """Ask before a stop whether the object contradicts the goal."""
    sees_through: bool = True
    """Lower the belief in entries whose places are seen empty, wherever the agent goes."""
    uses_rooms: bool = True
    """Let evidence in a room raise or lower the belief that this room changed, and with it its other entries."""
    explains_away: bool = True
    """Let proof that one room changed raise the trust in all others."""
    searches_rooms: bool = True
    """Believe that an object that is not at its place is still in its room."""
    expects_change: bool = True
    """Lower the belief in all entries at each stage, before any evidence."""
    uses_anchors: bool = True
    """Look first near what the goal's text names."""
    weighs_rooms: bool = True
    """Look first in rooms of the type that the text names, or where the category is frequent."""
    gates_sectors: bool = True
    """Count looks from one side of a place once a stage: they are not independent."""
    keeps_reserve: bool = True
    """Go to the best entry while there are rounds enough to reach it."""
    keeps_choice: bool = True
    """Change the way only for another one that is clearly better."""

    commit_share: float = 0.5
    """Share of the posterior from which an entry is gone to, whatever else is near."""
    near_m: float = 1.0
    """Added to every way: nothing is for free."""
    keep: float = 0.15
    """Share by which another place must be better than the one to which the agent goes."""
    stop_within_m: float = 1.8
    """Distance from the middle of a detected entry at which the agent stops."""
    stand_within_m: float = 1.6
    """Distance from the middle of an entry within which the agent goes to stand."""
    unfit: float = 0.1
    """Factor of an entry whose identity was denied, for the rest of the stage."""
    reserve_rounds: int = 3
    """Rounds that are kept beyond those that the way to the best entry takes."""
    last_rounds: int = 5
    """Rounds before the end from which the agent goes to where the target most likely is within reach."""
    anew_rounds: int = 25
    """Rounds that must be left to search the house again when nothing else is left."""
    min_radius_m: float = 1.0
    """Distance within which the agent goes to look for even the smallest things."""
    search_radius_m: float = 2.5
    """Distance within which a place to stand shows the floor and the furniture around it."""
    detection_range_m: float = 3.5
    """Distance within which cells count as seen; detections farther away are not remembered."""
    detection_rate: float = 0.9
    """Probability that a view finds an object in a cell that it shows."""
    on_support: float = 0.95
    """Probability that the target is on a thing of the type that the text names as its support, as `looks` has it."""
    min_supports: float = 0.5
    """Smallest number of such things that share the target."""
    anchor_ratio: float = 4.0
    """Factor of places by what the text names as a neighbour."""
    anchor_m: float = 0.75
    """Distance from the box of such a thing within which places are by it."""
    room_ratio: float = 4.0
    """Factor of a room of the type that the text names; its inverse is that of rooms of other types."""
    far_beyond: float = 0.25
    """Share of the unknown area that no frontier leads to directly which belongs to the house, and can be reached."""
    same_room_beyond: float = 0.75
    """Probability that what is behind a frontier belongs to the frontier's room."""
    same_room_beyond_door: float = 0.25
    """The same for a frontier at a door."""
    searched: float = 0.3
    """Factor of the weight that a place to search from has promised, once the agent has been there."""
    abandoned: float = 0.5
    """Factor of a place or frontier for each time that the agent turned away from it before it was there."""
    num_entries: int = 8
    """Largest number of entries to go to that are compared."""
    num_places: int = 12
    """Largest number of places to search from that are compared."""
    navigator: NavigatorConfig = field(
        default_factory=lambda: NavigatorConfig(explorer=AS_THREE_D_MEM_PLUS, background=("wall", "floor"))
    )
    """Parameters of the shared navigator: the last observation of a cell wins, and doors are remembered."""
