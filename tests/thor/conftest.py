"""The unmodified AI2-THOR client on our engine."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import evonav.thor
from evonav.house import bundled_houses

ai2thor_controller = pytest.importorskip(
    "ai2thor.controller", reason="the thor dependency group (ai2thor) is not installed"
)

Controller = Any
StartController = Callable[..., Controller]


@pytest.fixture(scope="session")
def house() -> dict[str, Any]:
    """A bundled house, as the client takes it. Do not change it."""
    document: dict[str, Any] = json.loads(min((house.to_json() for house in bundled_houses(20)), key=len))
    return document


@pytest.fixture
def start_controller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[StartController]:
    """Starts controllers, with `Controller`'s keywords, and stops them at the end of the test."""
    # Where the client keeps its log and locks.
    monkeypatch.setenv("HOME", str(tmp_path))
    started: list[Controller] = []

    def start(**keywords: Any) -> Controller:
        options = {"x_display": "0", "server_timeout": 20.0, "server_start_timeout": 20.0}
        controller = ai2thor_controller.Controller(
            local_executable_path=evonav.thor.executable(), **(options | keywords)
        )
        started.append(controller)
        return controller

    yield start
    for controller in started:
        controller.stop()
        controller.server.unity_proc.wait(10)


@pytest.fixture
def controller(start_controller: StartController, house: dict[str, Any]) -> Controller:
    """A controller in the bundled house, all images on, the agent where the house puts it."""
    controller = start_controller(
        scene=house, renderDepthImage=True, renderInstanceSegmentation=True, renderSemanticSegmentation=True
    )
    controller.step("TeleportFull", **house["metadata"]["agent"], raise_for_failure=True)
    return controller
