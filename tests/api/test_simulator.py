"""`evonav.Simulator`: what a person has in hand works, and what is wrong names what is right."""

import math
from pathlib import Path

import numpy as np
import pytest

import evonav
from evonav import Action, Pose
from evonav.errors import HouseError, InvalidArgumentError, SimulationError
from evonav.tasks.language import STRUCTURE_TYPES
from evonav.world.embedded import EmbeddedSimulator


@pytest.fixture(scope="module")
def house() -> evonav.House:
    return evonav.load_houses("bundled")[2]


@pytest.fixture
def simulator(house: evonav.House) -> evonav.Simulator:
    return evonav.Simulator(house)


def test_a_house_comes_as_itself_as_json_or_from_a_file(house: evonav.House, tmp_path: Path) -> None:
    path = tmp_path / "house.json"
    path.write_text(house.to_json())
    poses = {evonav.Simulator(given).pose for given in (house, house.to_json(), path, str(path))}
    assert len(poses) == 1
    with pytest.raises(InvalidArgumentError, match=r"expected an `evonav\.House`, its JSON, or a path"):
        evonav.Simulator(3)  # type: ignore[arg-type]
    with pytest.raises(HouseError, match="no such file or folder of houses"):
        evonav.Simulator(tmp_path / "nowhere.json")


def test_actions_come_by_name(simulator: evonav.Simulator) -> None:
    before = simulator.pose
    assert simulator.step("TURN_LEFT")
    assert simulator.step(Action.TURN_RIGHT)
    assert simulator.pose == before
    assert simulator.step("move_forward")
    assert math.dist(before.position_m, simulator.pose.position_m) == pytest.approx(0.25)
    assert simulator.reset() == before


@pytest.mark.parametrize(
    ("action", "words"),
    [
        ("MoveAhead", "did you mean `MOVE_FORWARD`"),
        ("RotateLeft", "did you mean `TURN_LEFT`"),
        ("TURN_LEF", "did you mean `TURN_LEFT`"),
        ("banana", "there are MOVE_FORWARD, TURN_LEFT, TURN_RIGHT, STOP"),
        (None, "there are MOVE_FORWARD"),
        (0, "there are MOVE_FORWARD"),
    ],
)
def test_an_unknown_action_names_the_right_one(simulator: evonav.Simulator, action: object, words: str) -> None:
    with pytest.raises(InvalidArgumentError, match=words):
        simulator.step(action)  # type: ignore[arg-type]


def test_the_agent_is_put_at_poses_and_points(simulator: evonav.Simulator) -> None:
    x_m, y_m, z_m = simulator.embedded.reachable_positions()[5].tolist()
    for place in ((x_m, z_m), (x_m, y_m, z_m), np.array([x_m, y_m, z_m]), Pose(x_m, y_m, z_m, 0.0)):
        simulator.reset()
        assert simulator.teleport(place)
        assert (simulator.pose.x_m, simulator.pose.z_m) == (x_m, z_m)
    assert simulator.teleport((x_m, z_m), yaw_deg=90.0)
    assert simulator.pose.yaw_deg == 90.0
    before = simulator.pose
    assert not simulator.teleport((-100.0, 0.0))
    assert simulator.pose == before
    for wrong in ((1.0,), "here", None):
        with pytest.raises(InvalidArgumentError, match="expected a `Pose`"):
            simulator.teleport(wrong)  # type: ignore[arg-type]


def test_a_look_is_a_view_that_maps_take(simulator: evonav.Simulator) -> None:
    objects, cells = evonav.ObjectMap(), evonav.OccupancyMap(simulator.map_frame)
    for _ in range(24):
        view = simulator.look()
        objects.update(view)
        cells.update(view)
        simulator.step("TURN_LEFT")
    assert view.rgb is not None
    assert view.rgb.shape == (300, 300, 3)
    assert simulator.look(rgb=False).rgb is None
    known = {found.category for found in simulator.objects} | {*STRUCTURE_TYPES}
    assert {entry.label for entry in objects.entries} <= known
    assert repr(objects).startswith(f"ObjectMap({len(objects)} entries, ")
    assert f"{int((cells.cells == 1).sum())} free" in repr(cells)
    assert "labels=(" in repr(view)
    assert "array" not in repr(view)
    assert repr(objects.entries[0]).startswith(f'ObjectEntry(id={objects.entries[0].id}, label="')


def test_paths_lead_to_all_that_a_look_may_report(simulator: evonav.Simulator) -> None:
    for body in simulator.embedded.objects:
        if body.kind in ("door", "window"):
            end = simulator.path_to(body.id)[-1]
            nearest_m = [max(0.0, abs(end[i] - body.centre_m[i]) - body.size_m[i] / 2) for i in (0, 2)]
            assert math.hypot(*nearest_m) < 1.5
    assert len(simulator.path_to("Doorway")) > 0


def test_paths_lead_to_the_nearest_object(simulator: evonav.Simulator) -> None:
    path = simulator.path_to("DiningTable")
    assert path.shape[1] == 3
    tables = [found for found in simulator.objects if found.category == "DiningTable"]
    lengths_m = [_length_m(simulator.path_to(table.id)) for table in tables]
    assert len(tables) > 1
    assert _length_m(path) == min(lengths_m)
    assert tuple(simulator.path_to(simulator.pose.position_m)[-1]) == pytest.approx(simulator.pose.position_m)
    with pytest.raises(InvalidArgumentError, match="no object `fridg`; did you mean `Fridge`"):
        simulator.path_to("fridg")
    with pytest.raises(InvalidArgumentError, match="the house has no object `xyz`; there are AlarmClock, "):
        simulator.path_to("xyz")


def _length_m(path: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def test_pictures_show_and_save(simulator: evonav.Simulator, house: evonav.House, tmp_path: Path) -> None:
    picture = simulator.plot(simulator.path_to("Fridge"))
    assert 'class="trajectory"' in picture.svg
    assert 'class="eye"' in picture.svg
    assert 'class="trajectory"' not in house.plot().svg
    for word in ("kitchen", "bed", "sofa"):
        assert f">{word}</text>" in house.plot().svg
    assert house._repr_html_() == house.plot().svg == house.plot()._repr_svg_()
    assert house.plot().save(tmp_path / "house.svg").read_text().startswith("<svg")
    assert repr(house.plot()).startswith("Picture('bundled:3', 900 x ")
    with pytest.raises(InvalidArgumentError, match=r"expected a file \.svg, \.png, \.pdf"):
        house.plot().save(tmp_path / "house.gif")


def test_maps_are_drawn(simulator: evonav.Simulator, house: evonav.House) -> None:
    objects, cells = evonav.ObjectMap(), evonav.OccupancyMap(simulator.map_frame)
    simulator.teleport(simulator.path_to("Fridge")[0])
    for _ in range(24):
        view = simulator.look(rgb=False)
        objects.update(view)
        cells.update(view)
        simulator.step("TURN_LEFT")
    cells.update_frontiers((simulator.pose.x_m, simulator.pose.z_m))
    assert objects.plot().svg.count("<rect") == len(objects) + 1
    assert len(objects.plot(house).svg) > len(objects.plot().svg)
    assert cells.plot().svg.count('class="frontier"') == len(cells.frontiers) > 0
    assert evonav.ObjectMap().plot().svg.count("<rect") == 1


def test_parts_of_a_house_tell_what_they_are(house: evonav.House) -> None:
    assert repr(house) == 'House("bundled:3", 4 rooms, 88 objects)'
    room = house.rooms[0]
    assert repr(room).startswith(f'Room(id="{room.id}", type="{room.room_type}", area_m2=')
    first = house.objects[0]
    assert repr(first).startswith(f'HouseObject(id="{first.id}", category="{first.category}", position_m=(')
    assert repr(house.walls[0]).startswith(f'Wall(id="{house.walls[0].id}"')
    assert repr(house.doors[0]).startswith(f'Opening(id="{house.doors[0].id}"')
    assert evonav.House(house.to_json()).name == "house"


def test_the_area_of_a_room_is_that_of_its_floor() -> None:
    for house in evonav.load_houses(limit=3):
        for room in house.rooms:
            x, z = np.array(room.polygon_m).T
            area_m2 = abs(np.dot(x, np.roll(z, -1)) - np.dot(z, np.roll(x, -1))) / 2
            assert repr(room).endswith(f"area_m2={area_m2:.1f})")


def test_the_simulator_below_refuses_what_is_no_action_and_no_house(house: evonav.House) -> None:
    embedded = EmbeddedSimulator()
    with pytest.raises(SimulationError, match="no house: call reset first"):
        embedded.step(Action.STOP)
    with pytest.raises(InvalidArgumentError, match=r"expected one of Action\.MOVE_FORWARD"):
        embedded.step("MOVE_FORWARD")  # type: ignore[arg-type]
    assert embedded.reset(house) == EmbeddedSimulator().reset(house.to_json())
    with pytest.raises(InvalidArgumentError, match="give a house to `reset`"):
        EmbeddedSimulator(house)  # type: ignore[arg-type]
