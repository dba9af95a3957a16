"""An agent's belief of its own pose that walks off at random, and is pulled back."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from evonav.perception.noise.config import NoiseConfig
from evonav.world.pose import Pose


@dataclass(slots=True)
class PoseDrift:
    """The error of a pose estimate over an episode: odometry, corrected little by little."""

    config: NoiseConfig
    error_m: tuple[float, float] = (0.0, 0.0)
    """Error of x and z."""
    error_rad: float = 0.0
    """Error of yaw."""
    _last: Pose | None = field(default=None, init=False)

    @property
    def is_off(self) -> bool:
        """Whether there is never any error."""
        config = self.config
        return not (config.drift_m_per_sqrt_m or config.drift_rad_per_sqrt_m or config.drift_rad_per_sqrt_rad)

    def move(self, pose: Pose, normals: NDArray[np.float64]) -> None:
        """Add the drift of the way to the agent's new pose.

        Args:
            normals: `(3,)` standard normals.
        """
        last, self._last = self._last, pose
        if last is None or self.is_off:
            return
        config = self.config
        way_m = math.dist((last.x_m, last.z_m), (pose.x_m, pose.z_m))
        turn_rad = abs(math.remainder(pose.yaw_rad - last.yaw_rad, math.tau))
        decay = math.exp(-way_m / config.drift_pull_m) if config.drift_pull_m > 0.0 else 1.0
        step_m = config.drift_m_per_sqrt_m * math.sqrt(way_m)
        step_rad = math.sqrt(config.drift_rad_per_sqrt_m**2 * way_m + config.drift_rad_per_sqrt_rad**2 * turn_rad)
        x, z, yaw = normals.tolist()
        self.error_m = (decay * self.error_m[0] + step_m * x, decay * self.error_m[1] + step_m * z)
        self.error_rad = decay * self.error_rad + step_rad * yaw

    def believed(self, pose: Pose) -> Pose:
        """Return a true pose as it is believed."""
        if self.is_off:
            return pose
        x_m, z_m = self.error_m
        return replace(pose, x_m=pose.x_m + x_m, z_m=pose.z_m + z_m, yaw_rad=pose.yaw_rad + self.error_rad)
