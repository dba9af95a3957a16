"""The agent's state, in AI2-THOR's units: metres and degrees."""

import math
from dataclasses import dataclass

from evonav.world.pose import Pose


@dataclass(slots=True)
class Agent:
    """Where the agent stands and looks. `y_m` is AI2-THOR's: the middle of the body."""

    x_m: float = 0.0
    y_m: float = 0.9009992
    z_m: float = 0.0
    yaw_deg: float = 0.0
    horizon_deg: float = 0.0
    is_standing: bool = True

    @property
    def pose(self) -> Pose:
        """The agent's pose as evonav's simulators take it."""
        return Pose(self.x_m, self.y_m, self.z_m, math.radians(self.yaw_deg), math.radians(self.horizon_deg))
