"""Convert poses between evonav's world and the right-handed worlds of other programs.

evonav's world is left-handed: x right, y up, z forward. Files have a right-handed one with z up: X = x, Y = z, Z = y.
Two axes change places, so a matrix that does this is its own inverse, and images are not mirrored. The camera is
OpenCV's: x right, y down, z forward; depth is along z.
"""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evonav.world.camera import camera_axes
from evonav.world.pose import Pose

F64 = NDArray[np.float64]
UpAxis = Literal["z", "y", "-y"]
"""Axis of a right-handed world that points up."""
EVONAV_FROM_WORLD: dict[UpAxis, F64] = {
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]),
    "-y": np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]),
}
"""Matrices from a right-handed world to evonav's; each is its own inverse."""


def world_from_camera(pose: Pose) -> F64:
    """Return the `(4, 4)` matrix from OpenCV's camera to the right-handed world with z up.

    Args:
        pose: Pose of the camera itself, as `Frame.pose`.
    """
    right, up, forward = camera_axes(pose)
    matrix = np.eye(4)
    matrix[:3, :3] = EVONAV_FROM_WORLD["z"] @ np.column_stack([right, -up, forward])
    matrix[:3, 3] = EVONAV_FROM_WORLD["z"] @ np.array(pose.position_m)
    return matrix


def pose_of(matrix: F64, up: UpAxis = "z") -> tuple[Pose, float]:
    """Return the pose of a camera, and its roll, which a `Pose` does not have.

    Args:
        matrix: `(4, 4)`, from OpenCV's camera to a right-handed world.
        up: The world's axis that points up.

    Returns:
        Pose in evonav's world, and the angle in radians by which the image's right side is turned up.
    """
    to_evonav = EVONAV_FROM_WORLD[up]
    right, _, forward = (to_evonav @ matrix[:3, :3]).T
    x_m, y_m, z_m = (to_evonav @ matrix[:3, 3]).tolist()
    horizon_rad = math.asin(min(1.0, max(-1.0, -float(forward[1]))))
    pose = Pose(x_m, y_m, z_m, math.atan2(forward[0], forward[2]) % (2.0 * math.pi), horizon_rad)
    level_right, level_up, _ = camera_axes(pose)
    return pose, math.atan2(float(right @ level_up), float(right @ level_right))


def quaternion_of(rotation: F64) -> tuple[float, float, float, float]:
    """Return a rotation matrix `(3, 3)` as a unit quaternion `(x, y, z, w)`."""
    # The largest of the four components is found first, so that none is divided by a small one.
    diagonal = np.diag(rotation)
    squares = np.array([1.0 + 2.0 * value - diagonal.sum() for value in diagonal] + [1.0 + diagonal.sum()])
    largest = int(squares.argmax())
    minus = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    values = np.empty(4)
    if largest == 3:
        values[:3], values[3] = minus, squares[3]
    else:
        values[:3], values[3] = rotation[:, largest] + rotation[largest, :], minus[largest]
        values[largest] = squares[largest]
    values /= np.linalg.norm(values)
    x, y, z, w = values.tolist()
    return x, y, z, w


def rotation_of(quaternion: tuple[float, float, float, float]) -> F64:
    """Return the rotation matrix `(3, 3)` of a quaternion `(x, y, z, w)` of any length above 0."""
    x, y, z, w = (np.array(quaternion) / np.linalg.norm(quaternion)).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
