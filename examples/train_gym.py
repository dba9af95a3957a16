"""A policy that learns on a laptop in minutes: REINFORCE on a linear policy, with NumPy alone.

    python examples/train_gym.py [updates]

Every task is in a new house with ProcTHOR's train assets, made from a seed when it is needed; what was learned is tried
on bundled tasks, whose houses have test assets. 32 environments walk at once; every 32 steps the policy is moved
towards the actions after which more came of it than on average (Williams, "Simple statistical gradient-following
algorithms", 1992). The environment's own reward is for getting nearer to the goal and finding it; new ground, as far as
the agent's own pose tells, counts too. Where to walk is learned; the rule to stop where the goal is seen from close by
is given.
"""

import sys
import time

import gymnasium
import numpy as np
from numpy.typing import NDArray

import evonav.gym

NUM_ENVS, NUM_STEPS, NUM_SECTORS = 32, 32, 5
STEP_SIZE, DISCOUNT = 0.05, 0.95
STOP = 3
NEW_GROUND, CELL_M = 0.2, 0.5
SETTINGS = {
    "width_px": 96,
    "height_px": 96,
    "turn_deg": 30.0,
    "max_steps": 200,
    "observations": ("depth", "semantic", "category", "pose", "is_action_success"),
}


def features(seen: dict[str, NDArray[np.generic]]) -> NDArray[np.float64]:
    """`(B, 17)`: by sector of the view how near things are and how much of the goal is there; bumps, nearness, 1."""
    depth_m, height = seen["depth"].astype(np.float64), seen["depth"].shape[1]
    is_goal = seen["semantic"] == (seen["category"] + 1)[:, None, None]
    ahead = np.array_split(depth_m[:, height // 4 : height // 2], NUM_SECTORS, axis=2)
    nearness = [1.0 / np.maximum(sector.min(axis=(1, 2)), 0.25) for sector in ahead]
    goal = [np.sqrt(sector.mean(axis=(1, 2))) for sector in np.array_split(is_goal, NUM_SECTORS, axis=2)]
    is_blocked = [(near > 2.0).astype(float) for near in nearness]
    goal_m = np.where(is_goal, depth_m, 20.0).min(axis=(1, 2))
    bumped = 1.0 - seen["is_action_success"]
    is_goal_near, is_goal_seen, one = goal_m < 1.5, goal_m < 20.0, np.ones_like(goal_m)
    return np.stack([*nearness, *goal, *is_blocked[1:-1], bumped, is_goal_near, is_goal_seen, one], axis=1)


NUM_FEATURES = 2 * NUM_SECTORS + (NUM_SECTORS - 2) + 4
IS_GOAL_NEAR = NUM_FEATURES - 3


Array = NDArray[np.float64]


def act(weights: Array, seen: Array, random: np.random.Generator) -> tuple[NDArray[np.int64], Array]:
    """Moves drawn for `(B, F)` features, and the chances `(B, 3)` that they were drawn by."""
    scores = seen @ weights.T
    chances = np.exp(scores - scores.max(axis=1, keepdims=True))
    chances /= chances.sum(axis=1, keepdims=True)
    return (chances.cumsum(axis=1) < random.random((len(seen), 1))).sum(axis=1).clip(max=2), chances


def with_stop(moves: NDArray[np.int64], seen: Array) -> NDArray[np.int64]:
    """The moves, or the end of the stage where the goal is seen from close by."""
    return np.where(seen[:, IS_GOAL_NEAR] > 0, STOP, moves)


def untrained() -> Array:
    """`(3, F)`: all moves alike."""
    return np.zeros((3, NUM_FEATURES))


class Ground:
    """Where the agents of a batch have been in their stages."""

    def __init__(self) -> None:
        self.cells: list[set[tuple[int, ...]]] = [set() for _ in range(NUM_ENVS)]

    def visit(self, poses: NDArray[np.float32], is_first: NDArray[np.bool_]) -> Array:
        """1 for each agent that stands where it has not been; `is_first`: a stage begins."""
        is_new = np.zeros(len(poses))
        for index, cell in enumerate(np.floor(poses[:, :2] / CELL_M).astype(int).tolist()):
            if is_first[index]:
                self.cells[index].clear()
            is_new[index] = tuple(cell) not in self.cells[index]
            self.cells[index].add(tuple(cell))
        return is_new


def train(houses: str, num_updates: int, seed: int = 0) -> tuple[Array, list[float]]:
    """The weights `(3, F)`, and the mean reward of a step in every update."""
    random, weights, curve = np.random.default_rng(seed), untrained(), []
    mean, square = np.zeros_like(weights), np.zeros_like(weights)
    envs = gymnasium.make_vec(evonav.gym.ENV_ID, num_envs=NUM_ENVS, houses=houses, **SETTINGS)
    observations, _ = envs.reset(seed=seed)
    seen, ground, is_first = features(observations), Ground(), np.ones(NUM_ENVS, bool)
    ground.visit(observations["pose"], is_first)
    is_first[:] = False
    for update in range(1, num_updates + 1):
        steps = []
        for _ in range(NUM_STEPS):
            moves, chances = act(weights, seen, random)
            observations, rewards, is_over, _, infos = envs.step(with_stop(moves, seen))
            ends = infos.get("_stage_result", np.zeros(NUM_ENVS, bool))
            rewards = rewards + NEW_GROUND * ground.visit(observations["pose"], ends | is_first)
            is_first = is_over
            steps.append((seen, moves, chances, rewards, ends))
            seen = features(observations)
        to_come, gains = np.zeros(NUM_ENVS), []
        for _, _, _, rewards, ends in reversed(steps):
            to_come = rewards + DISCOUNT * np.where(ends, 0.0, to_come)
            gains.append(to_come)
        gain = np.stack(gains[::-1])
        gain = (gain - gain.mean()) / (gain.std() + 1e-6)
        ascent = np.zeros_like(weights)
        for (seen_then, moves, chances, _, _), weight in zip(steps, gain, strict=True):
            weight = np.where(seen_then[:, IS_GOAL_NEAR] > 0, 0.0, weight)  # the rule's step
            ascent += ((np.eye(3)[moves] - chances) * weight[:, None]).T @ seen_then
        ascent /= NUM_ENVS * NUM_STEPS
        mean, square = 0.9 * mean + 0.1 * ascent, 0.99 * square + 0.01 * ascent**2  # Adam
        weights += STEP_SIZE * (mean / (1 - 0.9**update)) / (np.sqrt(square / (1 - 0.99**update)) + 1e-8)
        curve.append(float(np.mean([rewards.mean() for _, _, _, rewards, _ in steps])))
        if update % 20 == 0:
            print(f"update {update}: mean reward of a step {np.mean(curve[-20:]):+.4f}", flush=True)
    envs.close()
    return weights, curve


def evaluate(weights: Array, num_steps: int = 400, seed: int = 1) -> tuple[float, float, int]:
    """On bundled tasks: mean reward of a step, success, and the number of stages that ended."""
    random = np.random.default_rng(seed)
    envs = gymnasium.make_vec(evonav.gym.ENV_ID, num_envs=NUM_ENVS, **SETTINGS)
    observations, _ = envs.reset(seed=seed)
    ground, total, success = Ground(), 0.0, []
    is_first = np.ones(NUM_ENVS, bool)
    for _ in range(num_steps):
        seen = features(observations)
        observations, rewards, is_over, _, infos = envs.step(with_stop(act(weights, seen, random)[0], seen))
        ends = infos.get("_stage_result", np.zeros(NUM_ENVS, bool))
        rewards = rewards + NEW_GROUND * ground.visit(observations["pose"], ends | is_first)
        is_first, total = is_over, total + float(rewards.mean())
        success += infos["stage_result"]["success"][ends].tolist() if ends.any() else []
    envs.close()
    return total / num_steps, float(np.mean(success)), len(success)


def main(num_updates: int) -> None:
    """Trains, and prints what it was good for."""
    start_s = time.perf_counter()
    weights, curve = train("endless:train", num_updates)
    tenth = max(1, len(curve) // 10)
    print(f"mean reward of a step while training: {np.mean(curve[:tenth]):+.4f}, later {np.mean(curve[-tenth:]):+.4f}")
    for name, these in (("untrained", untrained()), ("trained", weights)):
        reward, success, num_stages = evaluate(these)
        print(f"{name}, bundled test tasks: {reward:+.4f} a step, success {success:.2f} in {num_stages} stages")
    print(f"{time.perf_counter() - start_s:.0f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 120)
