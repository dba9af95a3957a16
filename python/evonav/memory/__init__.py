"""What an agent remembers: occupancy, frontiers, object entries."""

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
