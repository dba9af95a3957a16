"""Pictures of tasks, from a generated task with a change before each stage."""

import dataclasses
import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from command_line import command
from html_page import HtmlPage
from typer.testing import CliRunner

from evonav.cli import app
from evonav.drawing.floor_plan import PlanFrame, item_labels, label_point
from evonav.drawing.plan import ObjectFootprint
from evonav.drawing.svg import cm
from evonav.generation import GenerationParameters, generate_task
from evonav.house import House, bundled_houses
from evonav.report.tasks.floor_plans import TaskDrawing, _groups, change_frame, task_drawing
from evonav.report.tasks.pages import change_sentence, move_rows, stage_svg, write_task_page
from evonav.tasks import Task, write_task
from evonav.tasks.oracle import StateChange

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def task() -> Task:
    house = next(iter(bundled_houses(1)))
    parameters = GenerationParameters(
        num_stages=(3,),
        evolve_probability=1.0,
        salient_object_probability=0.0,
        retain_group_probability=0.0,
        full_shuffle_probability=1.0,
    )
    return generate_task(house, seed=3, config=parameters)


@pytest.fixture(scope="module")
def drawing(task: Task) -> TaskDrawing:
    return task_drawing(task)


def with_class(root: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    return [element for element in root.iter() if name in element.get("class", "").split()]


def evolved_stage(task: Task) -> int:
    return next(stage.stage for stage in task.oracle_stages if stage.evolution.outcome == "evolved")


def test_before_and_after_stress_what_the_oracle_says_moved(task: Task, drawing: TaskDrawing) -> None:
    stage = evolved_stage(task)
    moved = {change.id for change in task.oracle(stage).evolution.changes}
    root = ElementTree.fromstring(stage_svg(drawing, stage))
    panels = root.findall(f"{SVG}svg")
    assert len(panels) == 3
    for panel in panels:
        assert sum(len(with_class(group, "item")) for group in with_class(panel, "moved")) == len(moved)
        assert len(with_class(panel, "tint")) == 1
    before, after, whole = panels
    assert with_class(before, "arrow") == with_class(before, "star") == []
    assert sum(len(with_class(group, "item")) for group in with_class(after, "ghost")) == len(moved)
    assert (
        len(with_class(whole, "trajectory")) == len(with_class(whole, "cone")) == len(with_class(whole, "between")) == 1
    )
    assert with_class(whole, "ghost") == []
    assert [star for star in with_class(after, "star") if "old" not in star.get("class", "")] != []
    # A stage whose house did not change is one plan.
    assert len(ElementTree.fromstring(stage_svg(drawing, 1)).findall(f"{SVG}svg")) == 1


def test_the_close_up_holds_the_room_that_changed_and_all_that_moved(task: Task, drawing: TaskDrawing) -> None:
    stage = evolved_stage(task)
    frame = change_frame(drawing, stage)
    evolution = task.oracle(stage).evolution
    room = next(room for room in drawing.maps[stage].rooms if room.room_id == evolution.room_id)
    places = [(p[0], p[2]) for change in evolution.changes for p in (change.from_position_m, change.to_position_m)]
    for x, y in map(cm, (*room.polygon_m, *places)):
        assert frame.left <= x <= frame.left + frame.width
        assert frame.top <= y <= frame.top + frame.height
    assert frame.width * frame.height < drawing.frame.width * drawing.frame.height


def test_no_two_names_of_furniture_overlap(drawing: TaskDrawing) -> None:
    floor_plan = drawing.maps[1]
    stacked = [
        *floor_plan.objects,
        *(item.model_copy(update={"object_id": f"{item.object_id}'"}) for item in floor_plan.objects),
    ]
    once, twice = (item_labels(items, drawing.frame).count("<text") for items in (floor_plan.objects, stacked))
    assert 0 < once == twice


def test_a_room_is_named_where_no_furniture_stands() -> None:
    square = [(0.0, 0.0), (0.0, 4.0), (4.0, 4.0), (4.0, 0.0)]
    x, z = label_point(square, taken_m=[(0.0, 0.0, 4.0, 2.9)], size_m=(1.5, 0.3))
    assert 0.7 < x < 3.3
    assert z - 0.15 + 0.1 > 2.9
    assert label_point(square) == pytest.approx((2.0, 2.0), abs=0.2)


def test_groups_are_drawn_while_they_stand_together() -> None:
    def chair(number: int, x_m: float) -> ObjectFootprint:
        corners = ((x_m, 0.0), (x_m + 0.5, 0.0), (x_m + 0.5, 0.5), (x_m, 0.5))
        return ObjectFootprint(
            object_id=f"2|0|{number}",
            category="Chair",
            centre_m=(x_m + 0.25, 0.4, 0.25),
            size_m=(0.5, 0.8, 0.5),
            polygon_m=corners,
        )

    frame = PlanFrame.around([(0.0, 0.0), (9.0, 9.0)])
    together = _groups([chair(0, 0.0), chair(1, 1.0)], frame)
    assert 'd="M0 0h150v-50h-150z"' in together
    assert "group: chair, chair" in together
    assert _groups([chair(0, 0.0), chair(1, 8.0)], frame) == ""
    assert _groups([chair(0, 0.0)], frame) == ""


def test_an_opened_door_is_marked(task: Task) -> None:
    stage = evolved_stage(task)
    first = task.oracle(stage)
    house = House(task.house_json(stage), name="h")
    state = StateChange(id=house.doors[0].id, category="Doorway", field="openness", before=0.0, after=1.0, cause="X")
    evolution = first.evolution.model_copy(update={"states": (state,)})
    oracle = list(task.oracle_stages)
    oracle[stage - 1] = first.model_copy(update={"evolution": evolution})
    drawing = task_drawing(dataclasses.replace(task, oracle_stages=tuple(oracle)))
    root = ElementTree.fromstring(stage_svg(drawing, stage))
    assert [len(list(group)) for group in with_class(root, "opened-doors")] == [1, 1, 1]
    assert "1 opened, closed or switched" in change_sentence(drawing.maps[stage], evolution)


def test_objects_stand_where_the_stage_house_has_them(task: Task, drawing: TaskDrawing) -> None:
    stage = evolved_stage(task)
    for number in (stage - 1, stage):
        house = House(task.house_json(number), name="h")
        places = {entry.id: entry.position_m for entry in house.objects}
        drawn = {item.object_id: item for item in drawing.maps[number].objects}
        for change in task.oracle(stage).evolution.changes:
            centre = drawn[change.id].centre_m
            assert (centre[0], centre[2]) == pytest.approx((places[change.id][0], places[change.id][2]), abs=0.25)


def test_words_count_the_moved_and_name_the_farthest(task: Task, drawing: TaskDrawing) -> None:
    stage = evolved_stage(task)
    evolution = task.oracle(stage).evolution
    words = change_sentence(drawing.maps[stage], evolution)
    far_m = max(change.displacement_m for change in evolution.changes)
    assert re.fullmatch(rf"Full shuffle in the .+: {len(evolution.changes)} objects? moved, .+ {far_m:.1f} m\.", words)
    rows = move_rows(drawing.maps[stage], evolution)
    assert rows[0][2] == f"{far_m:.2f} m"
    assert {row[1] for row in rows} == {change.id for change in evolution.changes}
    assert change_sentence(drawing.maps[1], task.oracle(1).evolution).startswith("The first stage")


def test_a_page_needs_no_other_file_and_escapes_all_text(task: Task, tmp_path: Path) -> None:
    hostile = '<script>alert("x")</script>'
    public = tuple(stage.model_copy(update={"basic_instruction": hostile}) for stage in task.public_stages)
    houses = list(task.houses_json)
    for k, text in enumerate(houses):
        house = json.loads(text)
        house["rooms"][0]["roomType"] = hostile
        houses[k] = json.dumps(house)
    source = task.header.house.model_copy(update={"name": hostile})
    header = task.header.model_copy(update={"house": source})
    wild = Task(header, public, task.reference_images, task.oracle_stages, tuple(houses))
    page = HtmlPage(write_task_page(wild, tmp_path / "page.html"))
    assert "script" not in {tag for tag, _ in page.elements}
    for ref in page.values("href", "src"):
        assert ref.startswith("data:image/webp") or ref[1:] in page.ids


def test_the_command_draws_a_task_a_stage_and_a_gallery(task: Task, tmp_path: Path) -> None:
    root = write_task(task, tmp_path / "set")
    page = tmp_path / "one.html"
    command("tasks", "show", root, "--out", page)
    assert page.read_text(encoding="utf-8").count('class="task stage-plan"') == 3
    picture = tmp_path / "stage.svg"
    arguments = ["tasks", "show", str(root.parent), "--task", task.task_id, "--stage", "2", "--out", str(picture)]
    command(*arguments)
    ElementTree.parse(picture)
    gallery = tmp_path / "gallery"
    command("tasks", "show", root.parent, "--out", gallery)
    index = (gallery / "index.html").read_text(encoding="utf-8")
    assert f'href="{task.task_id}.html"' in index
    assert 'data-modes="FULL_SHUFFLE"' in index
    assert (gallery / f"{task.task_id}.html").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{set}", "--task", "nope"], "holds no task 'nope'"),
        (["{set}", "--task", "../x"], "holds no task"),
        (["{root}", "--stage", "4"], "no stage 4; it has stages 1 to 3"),
        (["{set}/nothing"], "holds no task"),
        (["{broken}"], 'task.json: missing "task_id"'),
    ],
)
def test_wrong_input_is_a_line_that_names_it(task: Task, tmp_path: Path, arguments: list[str], message: str) -> None:
    root = write_task(task, tmp_path / "set")
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "task.json").write_text('{"schema_version": 1}', encoding="utf-8")
    places = {"set": str(root.parent), "root": str(root), "broken": str(broken)}
    result = CliRunner().invoke(app, ["tasks", "show", *(argument.format(**places) for argument in arguments)])
    assert result.exit_code == 1
    assert message in str(result.exception)
