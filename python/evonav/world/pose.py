"""Poses in AI2-THOR's frame."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

from evonav.points import Point3, Real

_HORIZON_RAD = math.radians(30.0)
_DECIMALS_DEG = 4
"""Decimals of an angle in degrees: angles are whole multiples of 1e-4 degrees, see `Pose.canonical`."""


@dataclass(frozen=True, slots=True)
class Pose:
    """An agent's position and view: left-handed frame, y up, metres and radians.

    Examples:
        >>> import evonav
        >>> pose = evonav.Pose.of_degrees(1.0, 0.9, 2.0, yaw_deg=90.0, horizon_deg=30.0)
        >>> pose.position_m, pose.yaw_deg
        ((1.0, 0.9, 2.0), 90.0)
    """

    __pydantic_config__: ClassVar = {"strict": True, "extra": "forbid", "revalidate_instances": "always"}

    x_m: Real
    y_m: Real
    z_m: Real
    yaw_rad: Real
    """Yaw, 0 along +z, growing towards +x (clockwise seen from above)."""
    horizon_rad: Real = _HORIZON_RAD
    """Camera pitch, positive looking down (30 degrees is ProcTHOR's default)."""

    @staticmethod
    def of_degrees(x_m: float, y_m: float, z_m: float, yaw_deg: float, horizon_deg: float) -> "Pose":
        """Return the canonical pose of AI2-THOR's angles."""
        yaw_rad, horizon_rad = math.radians(yaw_deg), math.radians(horizon_deg)
        return Pose(x_m, y_m, z_m, canonical_yaw_rad(yaw_rad), canonical_horizon_rad(horizon_rad))

    @property
    def position_m(self) -> Point3:
        """Position `(x, y, z)` in metres."""
        return (self.x_m, self.y_m, self.z_m)

    @property
    def is_finite(self) -> bool:
        """Whether no number is infinite or NaN."""
        return all(map(math.isfinite, (*self.position_m, self.yaw_rad, self.horizon_rad)))

    @property
    def yaw_deg(self) -> float:
        """Yaw in `[0, 360)`, rounded to 1e-4 degrees: the value for AI2-THOR."""
        return canonical_yaw_deg(math.degrees(self.yaw_rad))

    @property
    def horizon_deg(self) -> float:
        """Horizon rounded to 1e-4 degrees: the value for AI2-THOR."""
        return canonical_deg(math.degrees(self.horizon_rad))

    def canonical(self) -> "Pose":
        """Return this pose with angles rounded to 1e-4 degrees and its yaw in `[0, 2 pi)`.

        AI2-THOR uses degrees and evonav radians. Whole multiples of 1e-4 degrees survive the conversion there and back
        bit by bit, so images and steps are the same whichever side computes them.
        """
        return canonical_at(self.y_m, self)


def canonical_at(y_m: float, pose: Pose) -> Pose:
    """Return `pose.canonical()` at another height."""
    return Pose(pose.x_m, y_m, pose.z_m, canonical_yaw_rad(pose.yaw_rad), canonical_horizon_rad(pose.horizon_rad))


def moved(pose: Pose, x_m: float, z_m: float, yaw_rad: float) -> Pose:
    """Return a pose at another point of the floor, with another yaw; `replace` takes thrice as long."""
    return Pose(x_m, pose.y_m, z_m, yaw_rad, pose.horizon_rad)


def turned(pose: Pose, yaw_rad: float) -> Pose:
    """Return a pose with another yaw."""
    return moved(pose, pose.x_m, pose.z_m, yaw_rad)


def canonical_yaw_rad(yaw_rad: float) -> float:
    """Return a yaw in `[0, 2 pi)`, rounded to 1e-4 degrees; see `Pose.canonical`."""
    return math.radians(canonical_yaw_deg(math.degrees(yaw_rad)))


@lru_cache(maxsize=64)  # an agent turns and walks, but hardly ever looks up or down
def canonical_horizon_rad(horizon_rad: float) -> float:
    """Round a horizon to 1e-4 degrees; see `Pose.canonical`."""
    return math.radians(canonical_deg(math.degrees(horizon_rad)))


def canonical_yaw_deg(yaw_deg: float) -> float:
    """Return a yaw in `[0, 360)`, rounded to 1e-4 degrees."""
    return canonical_deg(yaw_deg % 360.0) % 360.0


def canonical_deg(angle_deg: float) -> float:
    """Round an angle to 1e-4 degrees."""
    return round(angle_deg, _DECIMALS_DEG) + 0.0  # no negative zero
