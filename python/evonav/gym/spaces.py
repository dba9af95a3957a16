"""Define the spaces of observations and actions, the meaning of their numbers, and the form of infos."""

import math
import string
from functools import lru_cache
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from PIL import Image

from evonav import _core
from evonav.gym.config import ACTIONS, STOP, NavConfig
from evonav.tasks.public import Goal

Observations = dict[str, Any]
Infos = dict[str, Any]

MAX_STAGES = 64
MAX_INSTRUCTION = 2000
"""Largest length of an instruction and largest number of stages that a task file may contain."""
_CHARACTERS = string.ascii_letters + string.digits + string.punctuation + " "
_REACH_M = 1000.0
"""Bound of positions in metres: larger than any house."""
IMAGE_DEPTH_M = 10.0
"""Depth in metres that the fourth channel of `image` shows as 255, as all larger ones."""
STATE_POSITION_M = 10.0
"""Length in metres of a position of 1 in `state`."""
_STATE_BOUNDS = np.array([_REACH_M / STATE_POSITION_M] * 2 + [1.0] * 4, np.float32)
_STRUCTURE = ("Doorframe", "Doorway", "Window")


@lru_cache(maxsize=1)
def vocabulary() -> tuple[str, ...]:
    """Return the closed vocabulary of categories: those of the asset catalogue, and `Other` for all others."""
    names = {category for _, category, _ in _core.assets()}
    return (*sorted(names.difference(_STRUCTURE)), "Other")


@lru_cache(maxsize=1)
def _indices() -> dict[str, int]:
    return {name: index for index, name in enumerate(vocabulary())}


def category_index(category: str) -> int:
    """Return the index of a category in the vocabulary, or that of `Other`."""
    return _indices().get(category, len(vocabulary()) - 1)


def body_labels(bodies: list[tuple[str, str, str, Any, Any]]) -> NDArray[np.uint8]:
    """Return the labels of `semantic`, `(N,)`: 1 + category for objects, 0 for walls and other structure."""
    kinds = ((kind, category) for _, category, kind, _, _ in bodies)
    labels = (1 + category_index(category) if kind == "object" else 0 for kind, category in kinds)
    return np.fromiter(labels, np.uint8, len(bodies))


def observation_space(config: NavConfig) -> spaces.Dict:
    """Return the observation space of one environment."""
    image = (config.height_px, config.width_px)
    side = config.reference_image_px
    all_spaces: dict[str, spaces.Space[Any]] = {
        "depth": spaces.Box(0.0, config.simulator.far_m, image, np.float32),
        "rgb": spaces.Box(0, 255, (*image, 3), np.uint8),
        "semantic": spaces.Box(0, len(vocabulary()), image, np.uint8),
        "pose": spaces.Box(
            np.array([-_REACH_M, -_REACH_M, -1.0, -1.0], np.float32),
            np.array([_REACH_M, _REACH_M, 1.0, 1.0], np.float32),
        ),
        "category": spaces.Discrete(len(vocabulary())),
        "instruction": spaces.Text(MAX_INSTRUCTION, charset=_CHARACTERS),
        "reference_image": spaces.Box(0, 255, (side, side, 3), np.uint8),
        "stage": spaces.Discrete(MAX_STAGES, start=1),
        "steps_left": spaces.Discrete(config.budget + 1),
        "is_action_success": spaces.Discrete(2),
        "has_arrived": spaces.Discrete(2),
        "image": spaces.Box(0, 255, (*image, 4), np.uint8),
        "state": spaces.Box(-_STATE_BOUNDS, _STATE_BOUNDS),
    }
    return spaces.Dict({name: all_spaces[name] for name in config.observations})


def action_space(config: NavConfig) -> spaces.Space[Any]:
    """Return the action space of one environment."""
    has_stop = config.stop == "explicit"
    if config.action_mode == "actions":
        return spaces.Discrete(len(ACTIONS) if has_stop else STOP)
    return spaces.Box(-1.0, 1.0, (3 if has_stop else 2,), np.float32)


def with_masks(infos: Infos, num_envs: int) -> Infos:
    """Return infos that every one of B environments has, with the masks that Gymnasium puts beside them."""
    masked: Infos = {}
    all_of = np.ones(num_envs, np.bool_)
    for name, values in infos.items():
        masked[name], masked[f"_{name}"] = values, all_of.copy()
    return masked


def relative_poses(poses: NDArray[np.float64], origins: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return poses relative to the start of the task.

    Args:
        poses: `(B, 5)`: x, y, z, yaw, horizon.
        origins: `(B, 5)`: the start poses of the tasks.

    Returns:
        `(B, 4)`: metres to the right and ahead of the start, sine and cosine of the turn since then, clockwise.
    """
    dx_m, dz_m = poses[:, 0] - origins[:, 0], poses[:, 2] - origins[:, 2]
    sin, cos = np.sin(origins[:, 3]), np.cos(origins[:, 3])
    turn_rad = poses[:, 3] - origins[:, 3]
    relative = np.empty((len(poses), 4), np.float32)
    relative[:, 0], relative[:, 1] = dx_m * cos - dz_m * sin, dx_m * sin + dz_m * cos
    relative[:, 2], relative[:, 3] = np.sin(turn_rad), np.cos(turn_rad)
    return relative


def rgbd(rgb: NDArray[np.uint8], depth_m: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return colours `(..., H, W, 3)` and depth `(..., H, W)` as one image `(..., H, W, 4)`: `image`."""
    depth = np.minimum(depth_m * np.float32(255.0 / IMAGE_DEPTH_M), np.float32(255.0)).astype(np.uint8)
    return np.concatenate((rgb, depth[..., None]), axis=-1)


def states(
    poses: NDArray[np.float32], steps_left: NDArray[np.float64], is_action_success: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Return `state`, `(B, 6)`: the pose, the share of the stage's steps that is left, success of the last action.

    Args:
        poses: `(B, 4)` of `relative_poses`; positions are divided by `STATE_POSITION_M`.
        steps_left: `(B,)` in 0..1.
        is_action_success: `(B,)` of 0 and 1.
    """
    positions = poses[:, :2] / np.float32(STATE_POSITION_M)
    return np.column_stack((positions, poses[:, 2:], steps_left, is_action_success)).astype(np.float32)


def waypoint_m(
    config: NavConfig, action: NDArray[np.float32], pose: NDArray[np.float64], origin: NDArray[np.float64]
) -> tuple[float, float] | None:
    """Return the requested point of a waypoint action.

    Args:
        config: Frame and range.
        action: `(3,)` in -1..1. The stage ends if the third is above 0. The first two are multiplied by the range.
            `relative`: metres to the right and ahead of the agent. `start`: the same relative to the task's start.
            `polar`: distance, from -1 for zero to 1 for the range, and bearing, from -1 for half a turn to the left to
            1 for half a turn to the right. With `stop="automatic"` the action is `(2,)`.
        pose: `(5,)`: the agent's x, y, z, yaw, horizon.
        origin: `(5,)`: the start pose of the task.

    Returns:
        `(x, z)`, or `None` to stop. Numbers outside the range are clipped, and NaN counts as 0.
    """
    a, b, *stop = np.nan_to_num(np.clip(action.astype(np.float64), -1.0, 1.0)).tolist()
    if stop and stop[0] > 0.0:
        return None
    frame = origin if config.waypoint_frame == "start" else pose
    x_m, z_m, yaw_rad = float(frame[0]), float(frame[2]), float(frame[3])
    if config.waypoint_frame == "polar":
        bearing_rad, range_m = b * math.pi, (a + 1.0) / 2.0 * config.waypoint_range_m
        right_m, ahead_m = range_m * math.sin(bearing_rad), range_m * math.cos(bearing_rad)
    else:
        right_m, ahead_m = a * config.waypoint_range_m, b * config.waypoint_range_m
    sin, cos = math.sin(yaw_rad), math.cos(yaw_rad)
    return x_m + right_m * cos + ahead_m * sin, z_m - right_m * sin + ahead_m * cos


def instruction_text(goal: Goal) -> str:
    """Return the instruction as an element of its space: characters beyond ASCII become `?`."""
    text = goal.unified_instruction[:MAX_INSTRUCTION]
    return "".join(character if character in _CHARACTERS else "?" for character in text)


def reference_image(goal: Goal, side_px: int) -> NDArray[np.uint8]:
    """Return the goal's image, `(S, S, 3)`, as a copy."""
    if goal.reference_image.shape[:2] == (side_px, side_px):
        return goal.reference_image.copy()
    resized = Image.fromarray(goal.reference_image).resize((side_px, side_px), Image.Resampling.BOX)
    return np.array(resized, np.uint8)
