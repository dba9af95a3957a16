"""The shift of places: each kind of thing with places is shifted, and shifted back exactly."""

import dataclasses
import json
import math
import typing
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evonav.agents.agent import (
    AgentAction,
    Belief,
    EntryBelief,
    FrontierBelief,
    Move,
    NavigateTo,
    PlaceBelief,
    RoundDiagnostics,
    SensorConfig,
    Stop,
    ViewSchedule,
)
from evonav.agents.hosting.wire import MAX_M
from evonav.decision.query import QueryLogEntry
from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode.spec import LEAST_SHIFT_M, NUM_SHIFTS, drawn_shift_m, opaque_task_id
from evonav.evaluation.hosting.agent import HostedAgent
from evonav.evaluation.hosting.shifted import PLACES, Shift, ShiftedAgent
from evonav.sensors.observation import Detections, MapFrame, Observation, View, VisibleOccupancy
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.pose import Pose
from evonav.world.simulator import Action, Intrinsics

PLACE_FIELDS = {
    TaskInfo: {"map_frame"},
    MapFrame: {"corner_m"},
    Goal: set(),
    Observation: {"views", "pose"},
    View: {"pose"},
    Pose: {"x_m", "z_m"},
    Intrinsics: set(),
    Detections: set(),
    VisibleOccupancy: set(),
    Move: set(),
    NavigateTo: {"position_m", "face_m"},
    Stop: set(),
    SensorConfig: set(),
    ViewSchedule: set(),
    EntryBelief: {"centre_m"},
    PlaceBelief: {"centres_m"},
    RoundDiagnostics: {"chosen_entry", "details", "places"},
    Belief: {"entries", "frontiers", "map_frame", "places"},
    FrontierBelief: {"position_m"},
}
"""Fields that hold places, or things that hold places."""
OTHER_FIELDS = {
    TaskInfo: {"task_id", "num_stages", "max_rounds", "seed"},
    MapFrame: {"rows", "cols", "cell_m"},
    Goal: {
        "stage",
        "category",
        "basic_instruction",
        "appearance_instruction",
        "unified_instruction",
        "reference_image",
    },
    Observation: {"is_action_success", "num_rounds_left", "has_arrived", "is_guided", "goal_feature"},
    View: {"intrinsics", "depth_m", "detections", "occupancy", "rgb"},
    Pose: {"y_m", "yaw_rad", "horizon_rad"},
    Intrinsics: {"width_px", "height_px", "vertical_fov_rad"},
    Detections: {"masks", "labels", "confidences", "features"},
    VisibleOccupancy: {"free", "blocked"},
    Move: {"action"},
    NavigateTo: set(),
    Stop: {"reason"},
    SensorConfig: {"first_round", "later_rounds", "needs_rgb", "motion", "max_travel_m", "occupancy_range_m"},
    ViewSchedule: {"count", "spacing_deg"},
    EntryBelief: {"entry_id", "label", "size_m", "num_detections", "p_present"},
    PlaceBelief: {"cell_m", "probabilities"},
    RoundDiagnostics: {"choice", "num_entries", "num_frontiers", "counters"},
    Belief: {"candidate_ids", "cells", "queries", "explored"},
    FrontierBelief: {"frontier_id", "direction_rad"},
}
"""Fields without places: numbers, images, sizes, angles, and cells counted from the corner of the map."""
TOLD = (TaskInfo, Goal, Observation)
ANSWERS = (*typing.get_args(AgentAction), SensorConfig, EntryBelief, RoundDiagnostics, Belief)


def classes_in(kind):
    """Yield the dataclasses that a type has in it, with those of their fields."""
    if dataclasses.is_dataclass(kind):
        yield kind
        for hint in typing.get_type_hints(kind).values():
            yield from classes_in(hint)
    for part in typing.get_args(kind):
        yield from classes_in(part)


def test_every_field_that_an_agent_is_told_or_answers_is_known_to_hold_a_place_or_not():
    """A new field belongs into one of the tables above; one with places also into `Shift`."""
    found = {kind for root in (*TOLD, *ANSWERS) for kind in classes_in(root)} - {QueryLogEntry}
    assert found == set(PLACE_FIELDS)
    for kind in found:
        names = {field.name for field in dataclasses.fields(kind)}
        assert names == PLACE_FIELDS[kind] | OTHER_FIELDS[kind], kind.__name__
        assert not PLACE_FIELDS[kind] & OTHER_FIELDS[kind], kind.__name__


def test_the_agent_behind_a_shift_passes_everything_on():
    """A method that `HostedAgent` gets must be thought of here: it may take or give places."""
    public = {name for name in vars(HostedAgent) if not name.startswith("_")}
    assert public == {
        "sensors",
        "cpu_s",
        "begin_task",
        "begin_stage",
        "look",
        "act",
        "diagnostics",
        "entries",
        "costs",
    }
    assert public <= vars(ShiftedAgent).keys()


EXACT = st.integers(-(2**26), 2**26).map(lambda steps: steps / 2**16)
"""Coordinates within 1 km that a shift does not round."""
ANY = st.floats(-1000.0, 1000.0)
SHIFTS = st.builds(Shift, *[st.integers(LEAST_SHIFT_M, LEAST_SHIFT_M + NUM_SHIFTS - 1).map(float)] * 2)


def things(coordinates):
    """Strategies of everything that has places."""
    points = st.tuples(coordinates, coordinates)
    frames = st.builds(MapFrame, st.just(9), st.just(7), st.just(0.1), points)
    poses = st.builds(Pose, coordinates, st.just(0.9), coordinates, st.floats(0.0, 6.0))
    image, cells = np.zeros((2, 2), np.float32), np.array([[3, 4]], np.int32)
    detections = Detections(np.full((2, 2), -1, np.int32), (), np.zeros(0, np.float32))
    view = st.builds(
        View,
        poses,
        st.just(Intrinsics(2, 2, 1.5)),
        st.just(image),
        st.just(detections),
        st.just(VisibleOccupancy(cells, cells)),
    )
    entries = st.builds(
        EntryBelief,
        st.integers(0, 9),
        st.just("Mug"),
        st.tuples(coordinates, coordinates, coordinates),
        st.just((0.1, 0.2, 0.3)),
        st.just(4),
    )
    details = st.fixed_dictionaries(
        {
            "goal_m": st.tuples(coordinates, coordinates).map(list),
            "mid_term_m": st.none() | points.map(list),
            "seen": st.fixed_dictionaries({"centre_m": st.tuples(coordinates, coordinates, coordinates).map(list)}),
            "path_m": st.lists(points.map(list), max_size=3),
        }
    )
    frontiers = st.builds(FrontierBelief, st.just(1), points, st.just(0.5))
    return {
        "task": st.builds(TaskInfo, st.just("name"), st.just(3), st.just(50), frames, st.just(7)),
        "observation": st.builds(
            Observation,
            st.lists(view, min_size=1, max_size=3).map(tuple),
            poses,
            st.just(True),
            st.just(9),
        ),
        "action": st.builds(NavigateTo, points, st.none() | points),
        "entry": entries,
        "diagnostics": st.builds(RoundDiagnostics, chosen_entry=st.none() | entries, details=details),
        "belief": st.builds(
            Belief,
            st.lists(entries, max_size=2),
            st.just((1,)),
            st.lists(frontiers, max_size=2),
            st.just(np.zeros((9, 7), np.uint8)),
            frames,
            st.just(()),
        ),
    }


def plain(value):
    """Return a thing as JSON has it."""
    return json.loads(json.dumps(dataclasses.asdict(value), default=lambda array: array.tolist()))


def leaves(value, path=()):
    """Yield the values of a thing by their place in it."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else None
    if items is None:
        yield path, value
    else:
        for key, inner in items:
            yield from leaves(inner, (*path, key))


def applied(shift, kind, thing):
    """Return a thing beyond the border: as the agent is told it, or as the house has it."""
    way = "shifted" if kind in ("task", "observation") else "unshifted"
    return getattr(shift, f"{way}_{kind}")(thing)


KINDS = list(things(EXACT))


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=40)
@given(data=st.data())
def test_a_shift_and_the_opposite_one_are_twins(kind, data):
    """Bit by bit for coordinates that a shift does not round; within a picometre for all others."""
    shift = data.draw(SHIFTS)
    back = Shift(-shift.x_m, -shift.z_m)
    exact = data.draw(things(EXACT)[kind])
    assert plain(applied(back, kind, applied(shift, kind, exact))) == plain(exact)
    thing = data.draw(things(ANY)[kind])
    twin = dict(leaves(plain(applied(back, kind, applied(shift, kind, thing)))))
    for path, value in leaves(plain(thing)):
        assert twin[path] == (pytest.approx(value, rel=0.0, abs=1e-12) if isinstance(value, float) else value), path


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=40)
@given(data=st.data())
def test_all_places_are_shifted_and_nothing_else(kind, data):
    shift, thing = data.draw(SHIFTS), data.draw(things(EXACT)[kind])
    after = dict(leaves(plain(applied(shift, kind, thing))))
    sign = 1.0 if kind in ("task", "observation") else -1.0
    before = plain(thing)
    for path, value in leaves(before):
        along_m = sign * _along_m(shift, before, path)
        assert after[path] == (value if along_m == 0.0 else value + along_m), path


def _along_m(shift, thing, path):
    """Return the shift of one number of a thing: 0 where it is no coordinate on the ground plane."""
    *before, last = path
    if last in ("x_m", "z_m"):
        return getattr(shift, last)
    name = next(part for part in reversed(path) if isinstance(part, str))
    if isinstance(last, str) or not name.endswith((*PLACES, "face_m", "corner_m")):
        return 0.0
    for key in before:
        thing = thing[key]
    return [shift.x_m, *[0.0] * (len(thing) - 2), shift.z_m][last]


def test_only_numbers_under_names_of_places_are_places():
    shift = Shift(40.0, 50.0)
    details = {
        "goal_m": [1, 2.0],
        "size_m": [1.0, 2.0],
        "distances_m": [1.0, 2.0],
        "ids": [1, 2],
        "position_m": [math.nan, 1.0],
        "centre_m": [True, False],
        "path_m": [[1.0, 2.0], [3.0, 0.5, 4.0], [1e300, 0.0], "x", None],
        "inner": [{"a_position_m": [1.0, 2.0, 3.0, 4.0]}],
        "mid_term_m": None,
    }
    found = shift.unshifted_diagnostics(RoundDiagnostics(details=details)).details
    moved = {"goal_m": [-39.0, -48.0], "path_m": [[-39.0, -48.0], [-37.0, 0.5, -46.0], [1e300, 0.0], "x", None]}
    assert str(found) == str({**details, **moved})


@pytest.mark.parametrize("answer", [Stop("here"), Move(Action.TURN_LEFT)])
def test_answers_without_places_stay(answer):
    assert Shift(40.0, 50.0).unshifted_action(answer) is answer


def test_a_place_that_leads_out_of_range_is_named():
    shift = Shift(-40.0, 50.0)
    assert shift.unshifted_action(NavigateTo((MAX_M - 40.0, 0.0))).position_m == (MAX_M, -50.0)
    with pytest.raises(InvalidArgumentError, match=r"action\.position_m = \(999961\.0, 0\.0\): coordinates must be"):
        shift.unshifted_action(NavigateTo((MAX_M - 39.0, 0.0)))
    with pytest.raises(InvalidArgumentError, match=r"action\.face_m"):
        shift.unshifted_action(NavigateTo((0.0, 0.0), (0.0, -MAX_M)))
    with pytest.raises(InvalidArgumentError, match=r"entry 3: centre_m"):
        shift.unshifted_entry(EntryBelief(3, "Mug", (MAX_M, 0.0, 0.0), (1.0, 1.0, 1.0), 1))


def drawn(secrets: Sequence[str]) -> set[tuple[float, float]]:
    return {drawn_shift_m(secret, "fu", "task") for secret in secrets}


def test_shifts_are_whole_metres_wider_than_houses_and_use_the_whole_range():
    shifts = drawn([str(number) for number in range(20_000)])
    axis = {sign * float(length) for length in range(32, 64) for sign in (-1, 1)}
    assert {x_m for x_m, _ in shifts} == {z_m for _, z_m in shifts} == axis
    assert len(shifts) > 0.9 * len(axis) ** 2


def test_shift_and_name_are_drawn_apart_and_depend_on_key_agent_and_task():
    shifts = {
        drawn_shift_m(secret, agent, task)
        for secret in ("a", "b", "c")
        for agent in ("fu", "ftu", "")
        for task in ("one", "two")
    }
    assert len(shifts) == 18
    assert drawn_shift_m("a", "fu", "one") == drawn_shift_m("a", "fu", "one")
    name = bytes.fromhex(opaque_task_id("a", "one"))
    lengths = [(LEAST_SHIFT_M + byte % NUM_SHIFTS) * (1.0 if byte & 128 else -1.0) for byte in name[:2]]
    assert tuple(lengths) != drawn_shift_m("a", "", "one")
