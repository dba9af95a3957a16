"""An agent's memory: occupancy, frontiers, object entries and views."""

from evonav.memory.objects import Comparison, ObjectEntry, ObjectMap, ObjectMapConfig, ObjectUpdate
from evonav.memory.occupancy import Conflicts, Frontier, FrontierConfig, OccupancyMap

__all__ = [
    "Comparison",
    "Conflicts",
    "Frontier",
    "FrontierConfig",
    "ObjectEntry",
    "ObjectMap",
    "ObjectMapConfig",
    "ObjectUpdate",
    "OccupancyMap",
]
