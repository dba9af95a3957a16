"""ProcTHOR houses, read from files or bundled."""

from evonav._core import House, HouseObject, Opening, Room, Wall
from evonav.house.files import bundled_houses, stream_houses

__all__ = [
    "House",
    "HouseObject",
    "Opening",
    "Room",
    "Wall",
    "bundled_houses",
    "stream_houses",
]
