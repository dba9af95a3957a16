"""Files name the style of reference images; those that name none hold `outlined` images."""

import json

from evonav.tasks import Task
from evonav.tasks.manifest import TaskHeader
from evonav.tasks.records import record_bytes


def with_style(task: Task, style: str | None) -> bytes:
    content = json.loads(record_bytes(task.header))
    content["parameters"].pop("reference_style", None)
    if style is not None:
        content["parameters"]["reference_style"] = style
    return (json.dumps(content, indent=2) + "\n").encode()


def test_a_header_without_a_style_is_of_outlined_images_and_keeps_its_bytes(task: Task) -> None:
    older = with_style(task, None)
    header = TaskHeader.model_validate_json(older)
    assert header.parameters.reference_style == "outlined"
    assert json.loads(record_bytes(header)) == json.loads(older)


def test_a_header_keeps_the_style_that_it_names(task: Task) -> None:
    header = TaskHeader.model_validate_json(with_style(task, "default"))
    assert header.parameters.reference_style == "default"
    assert json.loads(record_bytes(header))["parameters"]["reference_style"] == "default"
