"""Floor plans that are read object by object, against reading their whole texts."""

import json
from collections.abc import Callable
from typing import Any

import pytest
from pydantic import ValidationError

from evonav.drawing.plan import ObjectFootprint
from evonav.evaluation.records.floor_plans import FloorPlan, FloorPlanReader

SQUARE = ((0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0))


def footprint(object_id: str, x_m: float = 0.1) -> ObjectFootprint:
    return ObjectFootprint(
        object_id=object_id,
        category="Box",
        centre_m=(x_m, 0.2, 0.3),
        size_m=(1.0, 1.0, 1.0),
        polygon_m=SQUARE,
        outlines_m=(SQUARE, SQUARE[:3]),
    )


def plan(*objects: ObjectFootprint, at_end: tuple[ObjectFootprint, ...] = ()) -> FloorPlan:
    return FloorPlan(
        task_id='"objects":[',
        house="h",
        stage=1,
        rooms=(),
        walls=(),
        openings=(),
        objects=objects,
        reference_image=None,
        objects_at_end=at_end,
    )


@pytest.mark.parametrize(
    "made",
    [
        plan(),
        plan(footprint("a")),
        plan(footprint("a"), footprint('],"schema_version":'), footprint(',{"object_id":')),
        plan(footprint("a"), footprint("b"), at_end=(footprint("b"), footprint("a"))),
    ],
)
def test_a_plan_is_that_of_its_whole_text(made: FloorPlan) -> None:
    text = made.model_dump_json()
    assert FloorPlanReader().read(text) == FloorPlan.model_validate_json(text) == made
    spaced = json.dumps(json.loads(text), indent=1)
    assert FloorPlanReader().read(spaced) == made


def test_an_object_that_stays_is_read_once() -> None:
    reader = FloorPlanReader()
    first = reader.read(plan(footprint("a"), footprint("b")).model_dump_json())
    second = reader.read(plan(footprint("b", 5.0), footprint("a")).model_dump_json())
    assert second.objects[1] is first.objects[0]
    assert second.objects[0].centre_m[0] == 5.0


def changed(change: Callable[[dict[str, Any]], Any]) -> str:
    values = json.loads(plan(footprint("a"), footprint("b")).model_dump_json())
    change(values)
    return json.dumps(values, separators=(",", ":"))


@pytest.mark.parametrize(
    "text",
    [
        changed(lambda values: values["objects"][1].update(size_m=[1, 2])),
        changed(lambda values: values["objects"][1].update(colour=1)),
        changed(lambda values: values["objects"][0].update(centre_m=None)),
        changed(lambda values: values["objects"].append(3)),
        changed(lambda values: values.update(stage="x")),
        changed(lambda values: values.update(other=[])),
        changed(lambda values: values.pop("objects")),
        changed(lambda values: None).replace("},{", "}{"),
        changed(lambda values: None)[:-30],
        "",
    ],
)
def test_what_is_wrong_is_told_as_of_the_whole_text(text: str) -> None:
    with pytest.raises(ValidationError) as whole:
        FloorPlan.model_validate_json(text)
    with pytest.raises(ValidationError) as found:
        FloorPlanReader().read(text)
    assert found.value.errors(include_url=False) == whole.value.errors(include_url=False)
