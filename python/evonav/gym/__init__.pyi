from .config import ACTIONS, OBSERVATIONS, NavConfig
from .env import LifelongNavEnv
from .registration import ENV_ID, register
from .spaces import vocabulary
from .vector_env import VectorEnv

__all__ = ["ACTIONS", "ENV_ID", "OBSERVATIONS", "LifelongNavEnv", "NavConfig", "VectorEnv", "register", "vocabulary"]
