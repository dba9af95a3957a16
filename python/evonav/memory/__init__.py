"""What an agent remembers: occupancy, frontiers, object entries."""

from evonav.memory.occupancy import Conflicts, Frontier, FrontierConfig, OccupancyMap

__all__ = ["Conflicts", "Frontier", "FrontierConfig", "OccupancyMap"]
