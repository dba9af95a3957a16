"""What a camera sees that is put to places of a house, one after the other."""

import math
from dataclasses import replace

from evonav import Simulator
from evonav.sensors.observation import View


def walked(simulator: Simulator, num_places: int) -> list[View]:
    """Views in eight directions at about so many places of a house, evenly taken from the reachable ones."""
    places = simulator.embedded.reachable_positions()
    views = []
    for x_m, _, z_m in places[:: max(1, len(places) // num_places)].tolist():
        for eighth in range(8):
            simulator.teleport(replace(simulator.pose, x_m=x_m, z_m=z_m, yaw_rad=eighth * math.pi / 4))
            views.append(simulator.look(rgb=False))
    return views
