"""Gymnasium environments over the embedded simulator; importing this package registers `evonav/LifelongNav-v0`.

`gymnasium.make("evonav.gym:evonav/LifelongNav-v0")` imports it. The environments themselves are imported on first use,
so the id alone costs nothing.
"""

import gymnasium
import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

ENV_ID = "evonav/LifelongNav-v0"

gymnasium.register(
    id=ENV_ID, entry_point="evonav.gym.env:LifelongNavEnv", vector_entry_point="evonav.gym.vector_env:VectorEnv"
)
