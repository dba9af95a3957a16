"""Record floor plans: rooms, walls, openings and exact footprints of a house, from which maps are drawn."""

from base64 import b64encode
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, WebPImagePlugin  # noqa: F401 - or Pillow imports all its plug-ins for the first WebP

from evonav.drawing.plan import plan_of
from evonav.evaluation.records.schema import FloorPlan
from evonav.house import House


def floor_plan_of(
    house: House, *, task_id: str, stage: int, reference_image: str | None, at_end: House | None = None
) -> FloorPlan:
    """Return the floor plan of a house.

    Args:
        house: A house as it is in the stage.
        reference_image: The image that the agent was shown, as a `data:` URI.
        at_end: The house after the change during the stage, if there is one.

    Raises:
        HouseError: An object has neither a known asset nor a known category.
    """
    plan = plan_of(house)
    values = {
        "task_id": task_id,
        "house": house.name,
        "stage": stage,
        "rooms": plan.rooms,
        "walls": plan.walls,
        "openings": plan.openings,
        "objects": plan.objects,
        "reference_image": reference_image,
        "objects_at_end": () if at_end is None else plan_of(at_end).objects,
    }
    return FloorPlan.model_validate(values, from_attributes=True)


def image_uri(image: NDArray[np.uint8], side_px: int) -> str:
    """Return an RGB image, resized to a square of `side_px`, as a `data:` URI."""
    buffer = BytesIO()
    Image.fromarray(image).resize((side_px, side_px)).save(buffer, "WEBP", quality=70, method=0)
    return f"data:image/webp;base64,{b64encode(buffer.getvalue()).decode()}"
