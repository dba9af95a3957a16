from .simulator import Ai2ThorSimulator
from .startup import Ai2ThorOptions

__all__ = ["Ai2ThorOptions", "Ai2ThorSimulator"]
