"""Poses, in AI2-THOR's frame."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Pose:
    """Where an agent stands and looks: left-handed frame, y up, metres and radians."""

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    """0 along +z, growing towards +x (clockwise seen from above)."""
    horizon_rad: float = math.radians(30.0)
    """Camera pitch, positive looking down (30 degrees is ProcTHOR's default)."""

    @property
    def position_m(self) -> tuple[float, float, float]:
        """`(x, y, z)`."""
        return (self.x_m, self.y_m, self.z_m)
