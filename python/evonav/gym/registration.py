"""Register the environment's id without importing the simulator or tasks."""

import gymnasium

ENV_ID = "evonav/LifelongNav-v0"


def register() -> None:
    """Register the id for `gymnasium.make` and `gymnasium.make_vec`; safe to call twice."""
    if ENV_ID not in gymnasium.registry:
        gymnasium.register(
            id=ENV_ID,
            entry_point="evonav.gym.env:LifelongNavEnv",
            vector_entry_point="evonav.gym.vector_env:VectorEnv",
        )
