"""The client's dialogue with the engine: start, images, metadata, mistakes."""

from typing import Any

import numpy as np
import pytest


def test_starts_in_a_house(start_controller: Any, house: dict[str, Any]) -> None:
    controller = start_controller(scene=house, width=320, height=240, renderDepthImage=True)
    event = controller.last_event
    assert event.metadata["lastActionSuccess"]
    assert event.metadata["sceneName"] == "Procedural"
    assert event.frame.shape == (240, 320, 3)
    assert event.depth_frame.shape == (240, 320)
    assert event.depth_frame.dtype == np.float32
    assert {o["id"] for o in house["objects"]} <= {o["objectId"] for o in event.metadata["objects"]}


def test_starts_without_a_house(start_controller: Any) -> None:
    controller = start_controller(scene="Procedural")
    assert controller.last_event.metadata["objects"] == []
    assert not controller.last_event.frame.any()
    assert not controller.step("CreateHouse", house={"rooms": 3}).metadata["lastActionSuccess"]


def test_unknown_actions_are_named(start_controller: Any) -> None:
    controller = start_controller(scene="Procedural")
    with pytest.raises(ValueError, match="Invalid action: FlyAway"):
        controller.step("FlyAway")
    assert controller.step("GetScenesInBuild").metadata["actionReturn"] == ["Procedural"]
