"""Judge whether a remembered object is still at its place, from what a depth image shows there."""

from dataclasses import dataclass
from enum import Enum


@dataclass(frozen=True, slots=True)
class EvidenceConfig:
    """Parameters of `ObjectMap.depth_evidence`."""

    max_points: int = 256
    """Largest number of an entry's points that are compared, taken evenly from them."""
    band_m: float = 0.1
    """Smallest difference in depth that counts as a difference."""
    band_share: float = 0.02
    """The same as a share of the point's depth; the larger of the two counts."""


@dataclass(frozen=True, slots=True)
class DepthEvidence:
    """Number of an entry's points by what a depth image shows at their pixels."""

    num_see_through: int = 0
    """The image shows something farther away, so nothing is at the point."""
    num_supported: int = 0
    """The image shows a surface at the point."""
    num_occluded: int = 0
    """The image shows something nearer, which hides the point."""
    num_out_of_view: int = 0
    """The point is outside the image, or its pixel has no depth."""

    @property
    def num_in_view(self) -> int:
        """Number of points whose pixel has a depth."""
        return self.num_see_through + self.num_supported + self.num_occluded

    @property
    def num_not_hidden(self) -> int:
        """Number of points at which the image shows whether something is there."""
        return self.num_see_through + self.num_supported

    @property
    def see_through_share(self) -> float:
        """Share of the points in view that are seen through; 0 without any."""
        return self.num_see_through / max(1, self.num_in_view)

    @property
    def supported_share(self) -> float:
        """Share of the points in view that lie on a visible surface; 0 without any."""
        return self.num_supported / max(1, self.num_in_view)


class Presence(Enum):
    """The verdict whether an object is at its remembered place."""

    YES = "yes"
    NO = "no"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class PresenceConfig:
    """Thresholds of `judge_presence`."""

    min_supported: float = 0.2
    """An object is there if more than this share of its points in view lies on a visible surface."""
    min_points: int = 16
    """An object is not judged absent with fewer points in view."""
    min_see_through: float = 0.6
    """An object is absent if more than this share of its points in view is seen through."""


def judge_presence(
    evidence: DepthEvidence, *, is_detected: bool, config: PresenceConfig = PresenceConfig()
) -> Presence:
    """Judge whether an object is at its remembered place; where nothing speaks for or against it, this is unknown.

    Args:
        evidence: The object's points compared with a depth image.
        is_detected: Whether something with the object's label was detected at its place.

    Examples:
        >>> judge_presence(DepthEvidence(num_see_through=200, num_occluded=20), is_detected=False)
        <Presence.NO: 'no'>
        >>> judge_presence(DepthEvidence(num_see_through=20, num_occluded=200), is_detected=False)
        <Presence.UNKNOWN: 'unknown'>
    """
    if is_detected or evidence.supported_share > config.min_supported:
        return Presence.YES
    if evidence.num_in_view >= config.min_points and evidence.see_through_share > config.min_see_through:
        return Presence.NO
    return Presence.UNKNOWN
