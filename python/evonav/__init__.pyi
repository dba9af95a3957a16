from ._core import __version__
from .agents.agent import Agent, Move, NavigateTo, SensorConfig, Stop
from .errors import EvonavError
from .evaluation.contract.check import check_agent
from .memory.objects import ObjectMap
from .memory.occupancy import OccupancyMap
from .report.notebook import load
from .sensors.observation import Observation
from .tasks.public import Goal, TaskInfo
from .world.pose import Pose
from .world.simulator import Action

__all__ = [
    "Action",
    "Agent",
    "EvonavError",
    "Goal",
    "Move",
    "NavigateTo",
    "ObjectMap",
    "Observation",
    "OccupancyMap",
    "Pose",
    "SensorConfig",
    "Stop",
    "TaskInfo",
    "__version__",
    "check_agent",
    "load",
]
