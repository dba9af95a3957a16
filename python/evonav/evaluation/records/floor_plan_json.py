"""Read floor plans of a task's stages: an object that stays as it is is read once."""

from pydantic import ValidationError

from evonav.evaluation.records.schema import FloorPlan, ObjectFootprint

_OBJECTS, _AFTER, _OBJECT = '"objects":[', '],"reference_image":', '{"object_id":'
"""Texts before, behind and within the objects, as evonav writes them.

JSON has no quotation mark within a string that is not escaped, so none of these texts is a part of a string."""


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
