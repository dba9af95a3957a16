"""Random looks: what they change, what they leave alone, and that they can be had again."""

import copy
import pickle
from itertools import islice

import numpy as np
import pytest
from numpy.typing import NDArray

import evonav
from evonav.errors import InvalidArgumentError
from evonav.house import bundled_houses
from evonav.world.appearance import Change, Colors, Lighting, Materials, with_change
from evonav.world.camera import CameraView
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, SimulatorConfig, Style

HOUSES = [house.to_json() for house in islice(bundled_houses(), 3)]
ALL: list[list[Change]] = [[Materials(seed=5)], [Colors(seed=5)], [Lighting(seed=5)]]


def _simulator(style: Style = "default", number: int = 0) -> EmbeddedSimulator:
    simulator = EmbeddedSimulator(SimulatorConfig(width_px=96, height_px=72, style=style))
    simulator.reset(HOUSES[number])
    return simulator


def _frames(simulator: EmbeddedSimulator) -> list[Frame]:
    places = simulator.reachable_positions()
    chosen = places[:: len(places) // 4]
    return [simulator.render(Pose(*place, yaw_rad=1.3 * turn)) for turn, place in enumerate(chosen.tolist())]


def _colours(frames: list[Frame]) -> NDArray[np.uint8]:
    return np.stack([frame.rgb for frame in frames])


def _changed(simulator: EmbeddedSimulator, changes: list[Change]) -> dict[int, int]:
    """Count the pixels that a look changes, by instance, in flat colours without lines from above and from below."""
    pose = simulator.pose
    views = [
        CameraView(Pose(pose.x_m, y_m, pose.z_m, 0.0, turn), 400, 400, 1.5, far_m=60.0)
        for y_m, turn in ((20.0, np.pi / 2), (1.5, 0.0), (1.5, -np.pi / 2))
    ]
    before = [simulator.render_camera(view) for view in views]
    simulator.set_appearance(changes)
    after = [simulator.render_camera(view) for view in views]
    found: dict[int, int] = {}
    for one, other in zip(before, after, strict=True):
        ids = one.instances[(one.rgb != other.rgb).any(axis=-1)]
        for instance, count in zip(*np.unique(ids, return_counts=True), strict=True):
            found[int(instance)] = found.get(int(instance), 0) + int(count)
    return found


@pytest.mark.parametrize("changes", ALL)
def test_a_look_changes_colours_and_nothing_else(changes: list[Change]) -> None:
    simulator = _simulator()
    own = _frames(simulator)
    cells, positions = simulator.occupancy().cells, simulator.reachable_positions()
    corners, bodies, _ = simulator.triangles()
    simulator.set_appearance(changes)
    other = _frames(simulator)
    for one, two in zip(own, other, strict=True):
        np.testing.assert_array_equal(one.depth_m, two.depth_m)
        np.testing.assert_array_equal(one.instances, two.instances)
    assert (_colours(own) != _colours(other)).any(axis=-1).mean() > 0.3
    np.testing.assert_array_equal(simulator.occupancy().cells, cells)
    np.testing.assert_array_equal(simulator.reachable_positions(), positions)
    np.testing.assert_array_equal(simulator.triangles()[0], corners)
    np.testing.assert_array_equal(simulator.triangles()[1], bodies)


@pytest.mark.parametrize("changes", ALL)
def test_equal_seeds_give_equal_pixels_and_others_do_not(changes: list[Change]) -> None:
    first, again, other = _simulator(), _simulator(), _simulator()
    first.set_appearance([Materials(seed=9), *changes])  # what was before does not matter
    first.set_appearance(changes)
    again.set_appearance(changes)
    other.set_appearance([type(change)(seed=6) for change in changes])
    np.testing.assert_array_equal(_colours(_frames(first)), _colours(_frames(again)))
    assert (_colours(_frames(first)) != _colours(_frames(other))).any(axis=-1).mean() > 0.3


@pytest.mark.parametrize("style", ["plain", "default"])
def test_materials_and_colours_are_seen_in_every_style_and_light_in_one(style: Style) -> None:
    simulator = _simulator(style, number=1)
    own = _colours(_frames(simulator))
    for changes in ALL:
        simulator.set_appearance(changes)
        is_other = bool((_colours(_frames(simulator)) != own).any())
        assert is_other == (style == "default" or not isinstance(changes[0], Lighting)), changes


def test_no_changes_and_a_reset_restore_the_exact_pixels() -> None:
    simulator = _simulator()
    own = _colours(_frames(simulator))
    for restore in (lambda: simulator.set_appearance(()), lambda: simulator.reset(HOUSES[0])):
        simulator.set_appearance([change for changes in ALL for change in changes])
        assert (_colours(_frames(simulator)) != own).any()
        restore()
        assert simulator.appearance == ()
        np.testing.assert_array_equal(_colours(_frames(simulator)), own)


@pytest.mark.parametrize("kind", [Materials, Colors])
def test_a_scope_changes_nothing_else(kind: type[Materials] | type[Colors]) -> None:
    simulator = _simulator("plain")
    types = {room.id: room.room_type for room in evonav.House(HOUSES[0]).rooms}
    house = evonav.House(HOUSES[0])

    def categories(changes: list[Change]) -> set[str]:
        simulator.set_appearance(())
        return {simulator.objects[instance - 1].category for instance in _changed(simulator, changes)}

    assert categories([kind(seed=1, categories=["Floor"])]) == {"Floor"}
    assert categories([kind(seed=1, categories=["Wall", "Floor"])]) == {"Floor", "Wall"}
    chosen = sorted(set(types.values()))[0]
    simulator.set_appearance(())
    found = _changed(simulator, [kind(seed=2, room_types=[chosen])])
    assert found
    for instance in found:
        body = simulator.objects[instance - 1]
        if body.kind in ("floor", "object"):
            room = body.id if body.kind == "floor" else house.room_of(body.centre_m[0], body.centre_m[2])
            assert types[getattr(room, "id", room)] == chosen, body


def test_objects_of_one_asset_and_the_walls_of_one_room_look_alike() -> None:
    simulator = _simulator("plain")
    simulator.set_appearance([Materials(seed=3), Colors(seed=3, categories=["Wall"])])
    _, bodies, colours = simulator.triangles()
    walls: dict[str, set[tuple[int, ...]]] = {}
    for index, body in enumerate(simulator.objects):
        if body.kind == "wall":
            room = body.id.split("|")[1]
            walls.setdefault(room, set()).update(map(tuple, colours[bodies == index].tolist()))
    inner = {room: found for room, found in walls.items() if room != "exterior" and found}
    assert len(inner) > 1
    assert all(len(found) == 1 for found in inner.values()), inner
    assert len(set.union(*inner.values())) > 1


def test_light_that_is_synchronized_only_scales_what_is_seen() -> None:
    simulator = _simulator()
    own = _colours(_frames(simulator)).astype(float).mean()
    means = []
    for factor in (0.4, 1.0, 1.6):
        lighting = Lighting(brightness=(factor, factor), randomize_color=False, synchronized=True)
        simulator.set_appearance([lighting])
        means.append(_colours(_frames(simulator)).astype(float).mean())
    assert means[0] < means[1] < means[2]
    assert abs(means[1] - own) < 0.5


def test_objects_that_are_moved_keep_their_look() -> None:
    moved, fresh = _simulator("plain"), _simulator("plain")
    moved.set_appearance([Materials(seed=4)])
    target = next(body for body in moved.objects if body.kind == "object")
    x_m, y_m, z_m = target.centre_m
    move = {"id": target.id, "position_m": [x_m + 0.01, y_m, z_m], "rotation_deg": [0, 0, 0], "parent": None}
    moved.apply({"moves": [move]})
    fresh.reset(moved.house_json)
    assert (moved.triangles()[2] != fresh.triangles()[2]).any()
    fresh.set_appearance([Materials(seed=4)])
    np.testing.assert_array_equal(moved.triangles()[2], fresh.triangles()[2])


def test_copies_and_pickles_keep_the_look() -> None:
    simulator = _simulator()
    simulator.set_appearance([Materials(seed=1), Lighting(seed=2)])
    expected = simulator.render().rgb
    twin, restored = copy.copy(simulator), pickle.loads(pickle.dumps(simulator))
    simulator.set_appearance(())
    np.testing.assert_array_equal(twin.render().rgb, expected)
    np.testing.assert_array_equal(restored.render().rgb, expected)
    assert restored.appearance == (Materials(seed=1), Lighting(seed=2))


def test_a_change_replaces_the_one_of_its_kind_and_scope() -> None:
    scoped = Colors(1, categories=["Sofa"])
    changes = with_change((Materials(1), scoped, Lighting(1)), Colors(2, categories=["Sofa"]))
    assert changes == (Materials(1), Lighting(1), Colors(2, categories=["Sofa"]))
    assert with_change((scoped, Lighting(1)), Lighting(2)) == (scoped, Lighting(2))
    assert with_change((Colors(3), scoped), Colors(4)) == (Colors(4),)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Materials(seed=-1), "argument `seed` is -1"),
        (lambda: Materials(categories="Sofa"), "argument `categories` is 'Sofa', expected a list of names"),
        (lambda: Materials(categories=[]), r"argument `categories` is \[\]"),
        (lambda: Colors(categories=["Soffa"]), 'argument `categories` is "Soffa", expected a category'),
        (lambda: Colors(room_types=["Attic"]), 'argument `room_types` is "Attic", expected a type'),
        (lambda: Lighting(brightness=(0.5,)), r"argument `brightness` is \(0.5,\), expected two numbers"),
        (
            lambda: Lighting(brightness=(-0.5, 1)),
            r"argument `brightness` is \[-0.5, 1.0\], expected two numbers from 0",
        ),
        (lambda: Lighting(hue=(0, 1.5)), r"argument `hue` is \[0.0, 1.5\], expected two numbers from 0 to 1"),
        (lambda: Lighting(saturation=(float("nan"), 1)), "argument `saturation` is"),
        (lambda: "materials", "'materials' is no change of a look"),
    ],
)
def test_wrong_arguments_name_field_and_value_and_change_nothing(make, message: str) -> None:
    simulator = _simulator()
    own = simulator.render().rgb
    with pytest.raises(InvalidArgumentError, match=message):
        simulator.set_appearance([make()])
    np.testing.assert_array_equal(simulator.render().rgb, own)


def test_the_front_door_randomises_and_restores() -> None:
    simulator = evonav.Simulator(evonav.House(HOUSES[2]), style="default")
    own = simulator.look().rgb
    simulator.randomize(seed=3)
    first = simulator.look().rgb
    simulator.randomize(materials=False, seed=3)
    assert simulator.embedded.appearance == (Lighting(seed=3),)
    simulator.randomize(seed=3)
    np.testing.assert_array_equal(simulator.look().rgb, first)
    simulator.randomize(materials=False, colors=True, lighting=Lighting(seed=8), categories=["Floor"])
    assert simulator.embedded.appearance == (Colors(categories=["Floor"]), Lighting(seed=8))
    simulator.reset_appearance()
    np.testing.assert_array_equal(simulator.look().rgb, own)
    with pytest.raises(InvalidArgumentError, match="Soffa"):
        simulator.randomize(categories=["Soffa"])
