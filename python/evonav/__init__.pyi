from ._core import House, __version__
from .agents.agent import Agent, Move, NavigateTo, PlaceBelief, SensorConfig, Stop
from .agents.explanation import Explanation
from .api.evaluate import evaluate
from .api.loading import generate_tasks, load_houses, load_tasks
from .api.run import Run, load_run
from .api.simulator import Simulator
from .errors import EvonavError
from .evaluation.contract.check import check_agent
from .memory.objects import ObjectMap
from .memory.occupancy import OccupancyMap
from .memory_benchmark.check import check_memory
from .sensors.observation import Observation
from .tasks.public import Goal, TaskInfo
from .world.pose import Pose
from .world.simulator import Action

__all__ = [
    "Action",
    "Agent",
    "EvonavError",
    "Explanation",
    "Goal",
    "House",
    "Move",
    "NavigateTo",
    "ObjectMap",
    "Observation",
    "OccupancyMap",
    "PlaceBelief",
    "Pose",
    "Run",
    "SensorConfig",
    "Simulator",
    "Stop",
    "TaskInfo",
    "__version__",
    "check_agent",
    "check_memory",
    "evaluate",
    "generate_tasks",
    "load_houses",
    "load_run",
    "load_tasks",
]
