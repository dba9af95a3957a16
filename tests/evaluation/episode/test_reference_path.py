"""The reference path ends in the target's room."""

import math

import numpy as np

from evonav.evaluation.episode.motion import Planner
from evonav.evaluation.run.components import embedded_simulator, load_spec
from evonav.tasks.listing import BUNDLED_TASKS, task_files
from evonav.world.pose import Pose
from evonav.world.simulator import OccupancyGrid


class TwoRooms:
    """A simulator of a corridor that a wall at x = 3 divides, with a sofa at x = 2 to 3; the agent is at the right.

    The free place nearest to the sofa's middle is behind the wall. Ways lead through a door elsewhere: two legs.
    """

    SOFA = (2.6, 0.9, 0.5)

    def __init__(self, has_door=True):
        self.pose = Pose(4.5, 0.9, 0.5, 0.0)
        self.has_door = has_door

    def shortest_path(self, start, target):
        x_m = 3.25 if target == self.SOFA else target[0]
        if x_m > 3.0:
            return np.array([start, (x_m, 0.9, 0.5)])
        return np.array([start, (3.0, 0.9, 6.0), (x_m, 0.9, 0.5)]) if self.has_door else np.empty((0, 3))

    def occupancy(self):
        cells = np.zeros((1, 10), dtype=np.uint8)
        cells[0, 4:6] = 1
        return OccupancyGrid(cells=cells, cell_m=0.5, corner_m=(0.0, 0.25))


class Rooms:
    """A house whose rooms the wall divides."""

    @staticmethod
    def room_of(x_m, _z_m):
        return "left" if x_m < 3.0 else "right"


def test_the_path_leads_into_the_room_of_a_target_behind_a_wall():
    target_m = (2.6, 0.5)
    planner = Planner(TwoRooms())
    assert planner.path_m(target_m) == [(4.5, 0.5), (3.25, 0.5)]
    assert planner.into_room_m(planner.path_m(target_m), target_m, Rooms, "left") == [
        (4.5, 0.5),
        (3.0, 6.0),
        (1.75, 0.5),
    ]
    assert planner.into_room_m(planner.path_m(target_m), target_m, Rooms, "right") == planner.path_m(target_m)
    closed = Planner(TwoRooms(has_door=False))
    assert closed.into_room_m(closed.path_m(target_m), target_m, Rooms, "left") == planner.path_m(target_m)


def test_paths_to_the_targets_of_bundled_tasks_end_in_their_rooms():
    simulator = embedded_simulator()
    elsewhere, longer_m = 0, []
    for task in task_files(BUNDLED_TASKS):
        spec = load_spec(task.path)
        for number, stage in enumerate(spec.stages, 1):
            house = spec.parsed_house(number)
            simulator.reset(stage.house_json, spec.start)
            planner, (x_m, _, z_m) = Planner(simulator), stage.target.position_m
            room_id = stage.target.room_id
            nearest = planner.path_m((x_m, z_m))
            path = planner.into_room_m(nearest, (x_m, z_m), house, room_id)
            assert house.room_of(*path[-1]) == room_id, (task.task_id, number)
            if house.room_of(*nearest[-1]) != room_id:
                elsewhere += 1
                longer_m.append(math.dist(path[-1], (x_m, z_m)) - math.dist(nearest[-1], (x_m, z_m)))
    assert elsewhere > 3
    assert min(longer_m) > -0.18  # the nearest place may be one of a grid of 0.25 m
