"""Define the numbers and points of poses, answers and records; pydantic checks them, and is not imported for it."""

from typing import Annotated, Any

MAX_M = 1e6
"""Largest coordinate in metres: sums and squares of such numbers are finite."""


class _WithinReach:
    """Tells pydantic the limits of a number."""

    @staticmethod
    def __get_pydantic_core_schema__(source: Any, handler: Any) -> dict[str, Any]:  # noqa: ANN401 - pydantic's
        return {**handler(source), "ge": -MAX_M, "le": MAX_M, "allow_inf_nan": False}


Real = Annotated[float, _WithinReach]
"""Metres, radians or degrees, far beyond any house."""
Point2 = tuple[Real, Real]
"""`(x, z)` in metres."""
Point3 = tuple[Real, Real, Real]
"""`(x, y, z)` in metres, or Unity Euler angles in degrees."""
