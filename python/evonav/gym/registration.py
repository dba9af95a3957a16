"""Register the environment's id without importing the simulator or tasks."""

ENV_ID = "evonav/LifelongNav-v0"


def register() -> None:
    """Register the id for `gymnasium.make` and `gymnasium.make_vec`; safe to call twice."""
    import gymnasium  # importing it may call this function, which must be there by then

    if ENV_ID not in gymnasium.registry:
        gymnasium.register(
            id=ENV_ID,
            entry_point="evonav.gym.env:LifelongNavEnv",
            vector_entry_point="evonav.gym.vector_env:VectorEnv",
        )
