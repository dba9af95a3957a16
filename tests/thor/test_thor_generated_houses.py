"""AI2-THOR's client walks through houses that evonav makes: what the published generator checks of its own houses."""

import json
from collections.abc import Callable
from itertools import islice
from typing import Any

import pytest

from evonav.house import stream_houses

StartController = Callable[..., Any]


@pytest.mark.parametrize("number", range(4))
def test_every_room_of_a_made_house_is_reached(start_controller: StartController, number: int) -> None:
    """`House.validate` of the package `procthor`: the house loads, the start is free, each room has five places."""
    house = next(islice(stream_houses("endless:21"), number, None))
    document = json.loads(house.to_json())
    controller = start_controller(scene=document)
    assert controller.last_event.metadata["lastActionSuccess"]
    controller.step("TeleportFull", **document["metadata"]["agent"], raise_for_failure=True)
    places = controller.step("GetReachablePositions", raise_for_failure=True).metadata["actionReturn"]
    for room in house.rooms:
        assert sum(house.room_of(place["x"], place["z"]) == room.id for place in places) >= 5, room.id
    loaded = {item["objectId"] for item in controller.last_event.metadata["objects"]}
    assert {item.id for item in house.objects} <= loaded
