"""A policy without learning: walk where there is room, turn to what is asked for, stop in front of it.

python examples/gym_policy.py [greedy|random] [number of tasks]
"""

import sys

import gymnasium
import numpy as np

import evonav.gym  # registers the environment

WANTED = ("depth", "semantic", "category", "is_action_success", "steps_left")
AHEAD, LEFT, RIGHT, STOP = range(4)


def greedy(seen: dict[str, np.ndarray], random: np.random.Generator) -> int:
    """One action from one observation."""
    height, width = seen["depth"].shape
    is_goal = seen["semantic"] == seen["category"] + 1
    room_m = seen["depth"][height // 3 : height // 2, width // 3 : -width // 3].min()
    if is_goal.sum() > 10:
        if seen["depth"][is_goal].min() < 1.5:
            return STOP
        side = np.nonzero(is_goal)[1].mean() / width - 0.5
        if abs(side) > 0.15:
            return RIGHT if side > 0 else LEFT
    if room_m > 0.6 and seen["is_action_success"] and random.random() < 0.95:
        return AHEAD
    return RIGHT if seen["steps_left"] % 100 < 80 else LEFT


def main(policy: str = "greedy", num_tasks: str = "5") -> None:
    """Prints what the policy scores on bundled tasks."""
    env = gymnasium.make(evonav.gym.ENV_ID, turn_deg=30, observations=WANTED)
    random = np.random.default_rng(0)
    for task in range(int(num_tasks)):
        seen, info = env.reset(seed=task)
        while "task_result" not in info:
            action = greedy(seen, random) if policy == "greedy" else int(random.choice(4, p=[0.6, 0.195, 0.195, 0.01]))
            seen, _, _, _, info = env.step(action)
        result = info["task_result"]
        print(f"{info['task_id']}: success {result['success']:.2f}, SPL {result['spl']:.2f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
