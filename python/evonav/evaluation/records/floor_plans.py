"""Record floor plans: rooms, walls, openings and exact footprints of a stage's house, from which maps are drawn."""

from base64 import b64encode
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from evonav.drawing.plan import HousePlan, ObjectFootprint, plan_of
from evonav.evaluation.records.schema import Whole
from evonav.house import House
from evonav.records import Version

_OBJECTS, _AFTER, _OBJECT = '"objects":[', '],"schema_version":', '{"object_id":'
"""Texts before, behind and within the objects, as evonav writes them.

JSON has no quotation mark within a string that is not escaped, so none of these texts is a part of a string."""


class FloorPlan(HousePlan):
    """A stage's house from above, the background of maps. It is the same for all agents."""

    schema_version: Version = 1
    task_id: str
    house: str
    stage: Whole
    reference_image: str | None = None
    """The image that the agent was shown, made small, as a `data:` URI."""
    objects_at_end: tuple[ObjectFootprint, ...] = ()
    """The objects after the change during the stage; empty without one."""

    @property
    def at_end(self) -> "FloorPlan":
        """The floor plan after the change during the stage; itself without one."""
        return self.model_copy(update={"objects": self.objects_at_end}) if self.objects_at_end else self


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
    return FloorPlan(
        **dict(plan_of(house)),
        task_id=task_id,
        house=house.name,
        stage=stage,
        reference_image=reference_image,
        objects_at_end=() if at_end is None else plan_of(at_end).objects,
    )


def image_uri(image: NDArray[np.uint8], side_px: int) -> str:
    """Return an RGB image, resized to a square of `side_px`, as a `data:` URI."""
    from PIL import Image, WebPImagePlugin  # noqa: F401 - or Pillow imports all its plug-ins for the first WebP

    buffer = BytesIO()
    Image.fromarray(image).resize((side_px, side_px)).save(buffer, "WEBP", quality=70, method=0)
    return f"data:image/webp;base64,{b64encode(buffer.getvalue()).decode()}"


class FloorPlanReader:
    """Reads floor plans; equal texts of objects give the same `ObjectFootprint`.

    Nine of ten objects of a stage stand as in the stage before, and objects are nine tenths of a floor plan's text.
    """

    def __init__(self) -> None:
        """Know no object yet."""
        self._known: dict[str, ObjectFootprint] = {}

    def read(self, text: str) -> FloorPlan:
        """Return the floor plan that a JSON text holds.

        Raises:
            ValidationError: The text is not valid.
        """
        head, before, rest = text.partition(_OBJECTS)
        body, after, tail = rest.partition(_AFTER)
        objects = body.split(f",{_OBJECT}")
        if before and after and objects[0].startswith(_OBJECT):
            objects[0] = objects[0].removeprefix(_OBJECT)
            try:
                plan = FloorPlan.model_validate_json(f"{head}{before}{after}{tail}")
                if not plan.objects:
                    return plan.model_copy(update={"objects": tuple(map(self._object, objects))})
            except ValidationError:  # below, the whole text is told wrong, with its places
                pass
        return FloorPlan.model_validate_json(text)

    def _object(self, text: str) -> ObjectFootprint:
        known = self._known.get(text)
        if known is None:
            known = self._known[text] = ObjectFootprint.model_validate_json(f"{_OBJECT}{text}")
        return known
