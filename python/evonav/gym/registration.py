"""The environment's id. Naming it imports neither the simulator nor tasks."""

import gymnasium

ENV_ID = "evonav/LifelongNav-v0"


def register() -> None:
    """Makes `gymnasium.make` and `gymnasium.make_vec` know the id; safe to call twice."""
    if ENV_ID not in gymnasium.registry:
        gymnasium.register(
            id=ENV_ID,
            entry_point="evonav.gym.env:LifelongNavEnv",
            vector_entry_point="evonav.gym.vector_env:VectorEnv",
        )
