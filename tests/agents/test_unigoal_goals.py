"""UniGoal's goal of a stage: seen, confirmed, replaced or abandoned."""

from dataclasses import replace

import numpy as np
import pytest
from cup_views import a_view
from toy_house import ToySimulator, house_json

from evonav.agents.unigoal.bev import BevMap
from evonav.agents.unigoal.goals import Glimpse, GoalWatch, largest_detection
from evonav.agents.unigoal.planner import UniGoalPlanner
from evonav.tasks.vocabulary import MAP_CATEGORIES
from evonav.world.pose import Pose

START = Pose(1.0, 0.9, 3.0, 0.0)


def look(labels, boxes, pose=START):
    """A view of the toy house with a detection in each box: rows and columns of pixels."""
    simulator = ToySimulator(width_px=64, height_px=64)
    simulator.reset(house_json(None), pose)
    frame = simulator.render(rgb=False, instances=False)
    masks = np.full(frame.depth_m.shape, -1, np.int32)
    for index, (rows, cols) in enumerate(boxes):
        masks[slice(*rows), slice(*cols)] = index
    return a_view(frame.depth_m, masks, tuple(labels), pose=frame.pose, intrinsics=frame.intrinsics)


LEFT, RIGHT = ((30, 40), (2, 14)), ((30, 50), (40, 62))


def watching(*ways_m):
    """Goals of a stage; the planner tells these lengths of the way to the temporary one, one at a time."""
    bev = BevMap((START.x_m, START.z_m), len(MAP_CATEGORIES))
    planner = UniGoalPlanner(bev, 0)
    planner.begin_stage()
    told = list(ways_m)
    planner.distance_m = lambda pose, cells: told.pop(0)
    return GoalWatch(bev, planner), bev


def holding(*ways_m):
    """The same with a detection 0.9 m from the start as the temporary goal."""
    watch, bev = watching(*ways_m)
    watch.temporary = Glimpse(np.array([bev.cell_of((1.9, 3.0))], np.int32), (1.9, 3.0), "detection")
    return watch


def test_the_largest_box_is_the_one_taken():
    view = look(["Bed", "Bed", "Chair"], [LEFT, RIGHT, ((0, 28), (0, 64))])
    taken = largest_detection(view, "bed")
    assert np.array_equal(taken, view.detections.masks == 1)
    far = replace(view, depth_m=np.where(taken, np.inf, view.depth_m).astype(np.float32))
    assert np.array_equal(
        largest_detection(far, "bed"), view.detections.masks == 0
    )  # one without a depth does not count
    assert largest_detection(view, "tv") is None


@pytest.mark.parametrize(
    ("way_m", "is_in_view", "stays", "confirmed", "given_up"),
    [
        (0.14, True, False, True, 0),
        (0.16, True, True, False, 0),
        (1.7, True, True, False, 0),
        (1.9, True, False, True, 0),  # more than twice the straight distance: behind something
        (None, True, False, True, 0),
        (0.14, False, False, False, 1),
    ],
)
def test_a_temporary_goal_nearby_is_confirmed_kept_or_given_up(way_m, is_in_view, stays, confirmed, given_up):
    watch = holding(way_m)
    watch.is_in_view = is_in_view
    watch.judge(START)
    assert (watch.temporary is not None, watch.confirmed is not None, watch.num_given_up) == (
        stays,
        confirmed,
        given_up,
    )


@pytest.mark.parametrize(("way_m", "is_replaced"), [(None, True), (3.0, False)])
def test_a_goal_without_a_way_stays_until_another_is_seen(way_m, is_replaced):
    watch = holding(way_m)
    watch.is_in_view = True
    watch.judge(replace(START, x_m=4.5))
    assert (watch.temporary.centre_m, watch.confirmed, watch.num_given_up) == ((1.9, 3.0), None, 0)
    watch.look(look(["Chair"], [LEFT]), "chair", frozenset())
    assert (watch.temporary.centre_m != (1.9, 3.0)) == is_replaced


def test_of_two_goals_in_view_the_first_one_stays():
    watch, _ = watching()
    watch.look(look(["Chair", "Mug"], [LEFT, RIGHT]), "chair", frozenset())
    left = watch.temporary
    both = look(["Chair", "Chair"], [LEFT, RIGHT])
    watch.look(both, "chair", frozenset())
    assert watch.temporary is left  # the larger one, on the right, does not take over
    fresh, _ = watching()
    fresh.look(both, "chair", frozenset())
    assert fresh.temporary.centre_m != left.centre_m
