from .config import ACTIONS, OBSERVATIONS, NavConfig
from .env import LifelongNavEnv
from .spaces import vocabulary
from .vector_env import VectorEnv

ENV_ID: str

__all__ = ["ACTIONS", "ENV_ID", "OBSERVATIONS", "LifelongNavEnv", "NavConfig", "VectorEnv", "vocabulary"]
