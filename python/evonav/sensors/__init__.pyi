from .observation import Detections, MapFrame, Observation, View, VisibleOccupancy
from .visibility import visible_occupancy

__all__ = ["Detections", "MapFrame", "Observation", "View", "VisibleOccupancy", "visible_occupancy"]
