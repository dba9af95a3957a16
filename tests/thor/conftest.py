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

ALL_IMAGES = {"renderDepthImage": True, "renderInstanceSegmentation": True, "renderSemanticSegmentation": True}
Controller = Any
StartController = Callable[..., Controller]


@pytest.fixture(scope="session")
def house() -> dict[str, Any]:
    """A bundled house, as the client takes it. Do not change it."""
    document: dict[str, Any] = json.loads(min((house.to_json() for house in bundled_houses(20)), key=len))
    return document


def _started(**keywords: Any) -> Controller:
    options = {"x_display": "0", "server_timeout": 20.0, "server_start_timeout": 20.0}
    return ai2thor_controller.Controller(local_executable_path=evonav.thor.executable(), **(options | keywords))


def _stop(controller: Controller) -> None:
    controller.stop()
    controller.server.unity_proc.wait(10)


@pytest.fixture
def start_controller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[StartController]:
    """Starts controllers, with `Controller`'s keywords, and stops them at the end of the test."""
    monkeypatch.setenv("HOME", str(tmp_path))  # where the client keeps its log and locks
    started: list[Controller] = []

    def start(**keywords: Any) -> Controller:
        started.append(_started(**keywords))
        return started[-1]

    yield start
    for controller in started:
        _stop(controller)


@pytest.fixture(scope="module")
def _shared_controller(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Controller]:
    """A controller that the tests of a module use one after the other: starting one takes longer than most tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOME", str(tmp_path_factory.mktemp("home")))
        controller = _started(scene="Procedural")
        yield controller
        _stop(controller)


@pytest.fixture
def controller_in(_shared_controller: Controller) -> Iterator[StartController]:
    """Puts the module's controller into a house with the keywords of `Controller.reset`, where the house puts it."""
    usual = dict(_shared_controller.initialization_parameters)

    def enter(house: dict[str, Any], **keywords: Any) -> Controller:
        _shared_controller.reset(scene=house, **keywords)
        _shared_controller.step("TeleportFull", **house["metadata"]["agent"], raise_for_failure=True)
        return _shared_controller

    yield enter
    _shared_controller.initialization_parameters = usual


@pytest.fixture
def controller(controller_in: StartController, house: dict[str, Any]) -> Controller:
    """A controller in the bundled house, all images on."""
    return controller_in(house, width=300, height=300, **ALL_IMAGES)
