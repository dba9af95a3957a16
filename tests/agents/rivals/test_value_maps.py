"""VLFM and OneMap in the words of their rules: cones with confidence, kept frontiers, places checked for each goal."""

import math

import numpy as np
import pytest
from cup_views import INTRINSICS, a_cup, a_view
from hypothesis import given
from hypothesis import strategies as st
from scripted_model import scripted
from toy_episode import rounds_of, run
from toy_house import stage_case

from evonav.agents.rivals.exploration import Place, Pursuit
from evonav.agents.rivals.onemap import LabelMap, OneMap, OneMapConfig, clusters_of, pixel_weights
from evonav.agents.rivals.relatedness import ROOM_WORTH, Relatedness
from evonav.agents.rivals.vlfm import ConeMap, Vlfm, VlfmConfig, largest_within
from evonav.decision.text.language import parse_goal
from evonav.decision.text.matcher import Matcher
from evonav.sensors.observation import MapFrame
from evonav.world.pose import Pose

FRAME = MapFrame(rows=60, cols=80, cell_m=0.1, corner_m=(-4.0, -1.0))
DEPTH = np.full((60, 60), 4.0, np.float32)


def related(text, feature=None):
    return Relatedness(Matcher(), parse_goal(text), feature)


def ahead(yaw_rad=0.0, cells=((40, 40), (40, 48), (40, 20))):
    """A view from (0, 0) that shows some cells: straight ahead, a little to the right, far to the left."""
    return a_view(DEPTH, pose=Pose(0.05, 1.575, -0.95, yaw_rad, 0.0), free=np.array(cells))


def test_a_view_gives_its_value_with_more_confidence_on_its_axis_than_at_its_edges():
    cones = ConeMap(FRAME, VlfmConfig())
    cones.see(ahead(), 0.8)
    assert cones.confidences[40, 40] == pytest.approx(1.0)
    assert 0.25 < cones.confidences[40, 48] < 1.0
    assert cones.values[40, 40] == cones.values[40, 48] == pytest.approx(0.8)
    assert cones.confidences[0, 0] == cones.values[0, 0] == 0.0


def test_what_is_outside_of_the_cone_is_not_valued():
    cones = ConeMap(FRAME, VlfmConfig())
    cones.see(ahead(yaw_rad=math.pi), 0.8)
    assert not cones.confidences.any()


def test_values_are_averaged_by_confidence_and_surer_views_count_more():
    cones = ConeMap(FRAME, VlfmConfig())
    cones.see(ahead(), 1.0)
    first = cones.confidences[40, 48]
    cones.see(ahead(yaw_rad=math.radians(11)), 0.0)
    second = cones.confidences[40, 48]
    assert cones.values[40, 48] < 0.5  # the second view has it on its axis
    assert second > first
    new = math.cos(math.radians(abs(math.degrees(math.atan2(0.8, 4.0)) - 11)) / math.radians(45) * math.pi / 2) ** 2
    new = 0.25 + 0.75 * new
    assert second == pytest.approx((first**2 + new**2) / (first + new))


def test_an_unsure_look_does_not_change_what_a_surer_one_said():
    cones = ConeMap(FRAME, VlfmConfig())
    cones.see(ahead(), 1.0)
    cones.see(ahead(yaw_rad=math.radians(44)), 0.0)  # straight ahead is at the edge of it
    assert cones.values[40, 40] == 1.0
    cones = ConeMap(FRAME, VlfmConfig())
    cones.see(ahead(yaw_rad=math.radians(44)), 0.7)  # unless nothing was known
    assert cones.values[40, 40] == pytest.approx(0.7)


@given(seed=st.integers(0, 2**32 - 1), radius_m=st.floats(0.0, 0.6))
def test_the_largest_value_within_a_distance_is_that_of_all_cells(seed, radius_m):
    draws = np.random.default_rng(seed)
    frame = MapFrame(rows=12, cols=9, cell_m=0.1, corner_m=(-0.4, 0.3))
    values = draws.random((12, 9))
    place_m = (float(draws.uniform(-0.8, 0.8)), float(draws.uniform(0.0, 1.8)))
    naive = [
        values[row, col]
        for row in range(12)
        for col in range(9)
        if math.dist((-0.4 + (col + 0.5) * 0.1, 0.3 + (row + 0.5) * 0.1), place_m) <= radius_m
    ]
    assert largest_within(values, frame, place_m, radius_m) == (max(naive) if naive else 0.0)


def places(*values):
    return [Place((float(index), 0.0), (float(index), 0.0), value) for index, value in enumerate(values)]


def test_the_last_place_is_kept_until_its_value_falls():
    pursuit, here = Pursuit(), (0.0, 5.0)
    first = pursuit.choice(places(0.2, 0.5, 0.4), here)
    assert first.value == 0.5
    pursuit.go(first, places(0.2, 0.5, 0.4), here)
    assert pursuit.choice(places(0.9, 0.5, 0.4), here).position_m == (1.0, 0.0)
    assert pursuit.choice(places(0.9, 0.495, 0.4), here).position_m == (1.0, 0.0)
    assert pursuit.choice(places(0.9, 0.48, 0.4), here).position_m == (0.0, 0.0)


def test_a_place_within_half_a_metre_stands_for_one_that_is_gone():
    pursuit, here = Pursuit(), (0.0, 5.0)
    pursuit.go(places(0.5)[0], places(0.5), here)
    moved = Place((0.4, 0.0), (0.4, 0.0), 0.5)
    assert pursuit.choice([moved, *places(0.0, 0.9)[1:]], here) == moved
    far = Place((0.6, 0.0), (0.6, 0.0), 0.5)
    assert pursuit.choice([far, *places(0.0, 0.9)[1:]], here).value == 0.9


def test_no_choice_is_made_twice_from_one_place():
    pursuit, here = Pursuit(), (0.0, 5.0)
    options = places(0.9, 0.5, 0.5)
    order = []
    for _ in range(4):
        place = pursuit.choice(options, here)
        order.append(place.position_m[0])
        pursuit.go(place, options, here)
        pursuit._last = None
    assert order == [0.0, 1.0, 2.0, 0.0]  # of equals the nearest; when all were chosen, the nearest
    assert pursuit.choice([], here) is None


def test_things_have_to_do_with_a_goal_as_the_text_or_common_rooms_say():
    mug = related("Find the mug on the dining table in the kitchen.")
    assert mug.of("Mug") == 1.0
    assert mug.of("DiningTable") == 0.5
    assert mug.of("Fridge") == ROOM_WORTH  # a sign of the room that is named
    assert mug.of("Toilet") == mug.of("Pencil") == 0.0
    egg = related("Find the egg.")
    assert egg.of("Fridge") == ROOM_WORTH > egg.of("Bed") > 0.0
    unit = np.eye(4, dtype=np.float32)
    seen = related("Find the egg.", unit[0])
    assert seen.of("Bed", (unit[0] + unit[1]) / np.float32(math.sqrt(2))) == pytest.approx(math.sqrt(0.5))
    assert seen.of("Bed", -unit[0]) == 0.0
    assert seen.of("Egg") == 1.0  # without an image feature its label counts
    assert egg.of_view(a_cup("Fridge").detections) == ROOM_WORTH
    assert egg.of_view(a_view(DEPTH).detections) == 0.0


def test_vlfm_begins_each_goal_without_values_and_keeps_floor_and_objects():
    agent = Vlfm()
    run(agent, stage_case(1, "GarbageCan|1"))
    assert agent._cones.values.any()
    known = agent._navigator.explorer.map.cells.copy()
    agent.begin_stage(stage_case(2, "Fridge|1").public)
    assert not agent._cones.values.any()
    assert not agent._cones.confidences.any()
    assert (agent._navigator.explorer.map.cells == known).all()
    assert len(agent._navigator.objects) > 0


@pytest.mark.parametrize("agent_class", [Vlfm, OneMap])
def test_it_goes_to_the_place_of_its_own_rule_whichever_frontier_a_model_likes(agent_class):
    model = scripted(choose=lambda question: "Frontier 0" if question.frontiers else "Object 0")
    _, rounds = rounds_of(agent_class(decision=model), stage_case(1, "Bed|1"))
    assert all(len(question.frontiers) <= 1 for question in model.questions)
    assert any(diagnostics.choice.startswith("frontier") for _, _, diagnostics, _ in rounds)


def test_a_detection_ends_the_search():
    for agent in (Vlfm(), OneMap()):
        _, rounds = rounds_of(agent, stage_case(1, "GarbageCan|1"))
        choices = [diagnostics.choice.split()[0] for _, _, diagnostics, _ in rounds]
        first = choices.index("object")
        assert set(choices[:first]) <= {"frontier", "search"}
        assert set(choices[first:]) == {"object"}


def test_near_surfaces_that_face_the_camera_are_the_surest():
    config = OneMapConfig()
    flat = {depth: pixel_weights(np.full((4, 4), depth, np.float32), INTRINSICS, config)[1, 1] for depth in (1, 3, 5)}
    assert flat[1] == 1.0 > flat[3] > flat[5] > 0.0
    assert flat[3] == pytest.approx(math.exp(-((2.0 / 1.5) ** 2) / 3))
    steep = np.tile(np.array([1.0, 1.0, 3.0, 3.0], np.float32), (4, 1))
    weights = pixel_weights(steep, INTRINSICS, config)
    assert weights[1, 1] < weights[1, 0] == 1.0
    nothing = np.full((4, 4), np.inf, np.float32)
    assert not pixel_weights(nothing, INTRINSICS, config).any()


def test_cells_know_what_they_show_for_every_later_goal_and_are_checked_anew():
    labels = LabelMap(FRAME, OneMapConfig())
    for _ in range(12):
        labels.see(a_cup("Fridge"))
    assert (labels.explored == labels.checked).all()
    found = np.where(labels.explored, labels.similarity(related("Find the fridge.")), 0.0)
    cell = np.unravel_index(found.argmax(), found.shape)
    z_m = FRAME.corner_m[1] + (cell[0] + 0.5) * 0.1
    assert 1.9 < z_m < 2.4  # where it stands
    labels.begin_goal()
    assert not labels.checked.any()
    assert labels.explored[cell]
    assert labels.similarity(related("Find the fridge."))[cell] > 0.9
    assert labels.similarity(related("Find the egg."))[cell] == pytest.approx(ROOM_WORTH, rel=0.1)
    assert labels.similarity(related("Find the plunger.")).max() < 0.1


def test_a_cell_is_the_mean_of_what_it_showed():
    labels = LabelMap(FRAME, OneMapConfig())
    labels.see(a_cup("Fridge"))
    seen = labels.similarity(related("Find the fridge."))
    cell = np.unravel_index(seen.argmax(), seen.shape)
    for _ in range(3):
        labels.see(a_cup("Vase"))
    assert labels.similarity(related("Find the fridge."))[cell] == pytest.approx(seen[cell] / 4, rel=1e-5)
    for number in range(20):  # more labels than there was room for
        labels.see(a_cup(f"Thing{number}"))
    assert labels.similarity(related("Find the fridge."))[cell] == pytest.approx(seen[cell] / 24, rel=1e-4)


def test_one_view_may_show_more_labels_than_there_was_room_for():
    one, many = LabelMap(FRAME, OneMapConfig()), LabelMap(FRAME, OneMapConfig())
    view = a_cup("Fridge")
    names = (*(f"Thing{number}" for number in range(40)), "Fridge")
    one.see(view)
    many.see(a_view(view.depth_m, np.where(view.detections.masks == 0, 40, -1).astype(np.int32), names))
    fridge = related("Find the fridge.")
    np.testing.assert_array_equal(many.similarity(fridge), one.similarity(fridge))


def test_a_cell_is_explored_after_some_sure_looks_and_not_after_one():
    labels = LabelMap(FRAME, OneMapConfig())
    labels.see(a_cup())
    assert not labels.explored.any()
    for _ in range(11):
        labels.see(a_cup())
    assert labels.explored.any()


def test_with_features_a_cell_is_as_similar_as_its_objects_look():
    unit = np.eye(2, dtype=np.float32)
    view = a_cup("Box")
    labels = LabelMap(FRAME, OneMapConfig())
    labels.see(a_view(view.depth_m, view.detections.masks, ("Box",), features=unit[:1]))
    alike, other = (labels.similarity(related("Find the egg.", one)) for one in unit)
    assert alike.max() > 0.9
    assert other.max() == 0.0


def test_clusters_are_the_most_similar_groups_of_cells():
    similarity = np.zeros((8, 12))
    similarity[1:3, 1:3] = 0.5
    similarity[1, 2] = 0.6
    similarity[5, 5:8] = 0.55
    similarity[7, 11] = 0.6  # a single cell
    similarity[4, 0:3] = 0.3
    is_open = np.ones_like(similarity, bool)
    found = clusters_of(similarity, is_open, share=0.8, min_cells=2)
    assert found == [(1, 2, 0.6), (5, 5, 0.55)]
    is_open[1, 2] = False  # checked
    assert clusters_of(similarity, is_open, share=0.8, min_cells=2)[0][2] == 0.5
    assert clusters_of(similarity, np.zeros_like(is_open), share=0.8, min_cells=2) == []
    assert clusters_of(np.zeros_like(similarity), is_open, share=0.8, min_cells=2) == []


def test_onemap_looks_again_where_something_like_the_goal_was_seen():
    """The fridge is not offered as an object: what is left is what the map says of its place."""
    model = scripted(choose=lambda question: "Frontier 0" if question.frontiers else "Object 0")
    agent = OneMap(decision=model)
    _, rounds = rounds_of(agent, stage_case(1, "GarbageCan|1"), stage_case(2, "Fridge|1"))
    searches = [(stage, action) for stage, _, diagnostics, action in rounds if diagnostics.choice == "search"]
    near = [action for stage, action in searches if stage == 2 and math.dist(action.face_m, (0.5, 4.4)) < 1.0]
    assert near
    assert len({action.face_m for action in near}) <= 3  # a place that was looked at is not gone to again
