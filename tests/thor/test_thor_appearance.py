"""Domain randomisation through the unmodified client."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

IMAGES = {"renderDepthImage": True, "renderInstanceSegmentation": True}
OF_MATERIALS = {"useTrainMaterials": None, "useValMaterials": None, "useTestMaterials": None, "inRoomTypes": None}
OF_LIGHTING = {
    "brightness": (0.5, 1.5),
    "randomizeColor": True,
    "hue": (0, 1),
    "saturation": (0.5, 1),
    "synchronized": False,
}


@pytest.fixture
def controller(controller_in, house):
    return controller_in(house, width=96, height=72, **IMAGES)


def step(controller, action: str, **arguments: Any):
    return controller.step(action, **arguments, raise_for_failure=True)


def test_the_documented_calls_change_colours_alone_and_are_undone(controller, house) -> None:
    own = step(controller, "Pass")
    materials = step(controller, "RandomizeMaterials", **OF_MATERIALS)
    assert (materials.frame != own.frame).any(axis=-1).mean() > 0.5
    np.testing.assert_array_equal(materials.depth_frame, own.depth_frame)
    np.testing.assert_array_equal(materials.instance_segmentation_frame, own.instance_segmentation_frame)
    assert materials.metadata["objects"] == own.metadata["objects"]
    found = materials.metadata["actionReturn"]
    assert found.pop("seed") >= 0
    assert found.pop("totalMaterialsConsidered") > 100
    assert found == {
        "chosenRoomTypes": ["Bathroom", "Bedroom", "Kitchen", "LivingRoom", "RoboTHOR"],
        "useTrainMaterials": True,
        "useValMaterials": True,
        "useTestMaterials": True,
    }
    lit = step(controller, "RandomizeLighting", **OF_LIGHTING)
    colors = step(controller, "RandomizeColors")
    assert (colors.frame != lit.frame).any(axis=-1).mean() > 0.5
    np.testing.assert_array_equal(step(controller, "ResetColors").frame, lit.frame)
    step(controller, "ResetLighting")
    np.testing.assert_array_equal(controller.last_event.frame, materials.frame)
    np.testing.assert_array_equal(step(controller, "ResetMaterials").frame, own.frame)

    step(controller, "RandomizeMaterials")
    # The look stays while the house changes, and goes with the scene.
    step(controller, "OpenObject", objectId=_openable(controller), forceAction=True)
    assert (controller.last_event.frame != own.frame).any(axis=-1).mean() > 0.5
    controller.reset(scene=house)
    step(controller, "TeleportFull", **house["metadata"]["agent"])
    np.testing.assert_array_equal(controller.last_event.frame, own.frame)


def _openable(controller) -> str:
    return next(one["objectId"] for one in controller.last_event.metadata["objects"] if one["openable"])


def test_draws_differ_and_are_the_same_in_an_equal_session(controller) -> None:
    def session(controller) -> list[np.ndarray]:
        step(controller, "SetRandomSeed", seed=4)
        return [step(controller, name).frame for name in ("RandomizeMaterials", "RandomizeColors") * 2]

    first = session(controller)
    assert all((one != other).any() for one, other in zip(first, first[2:], strict=False))
    np.testing.assert_array_equal(session(controller), first)
    step(controller, "ResetMaterials")
    seeded = step(controller, "RandomizeMaterials", seed=12).frame
    step(controller, "RandomizeMaterials")
    np.testing.assert_array_equal(step(controller, "RandomizeMaterials", seed=12).frame, seeded)


def test_scopes_change_nothing_else(controller) -> None:
    own = step(controller, "Pass")
    types = {one["objectId"]: one["objectType"] for one in own.metadata["objects"]}
    event = step(controller, "RandomizeMaterials", objectTypes=["Floor"], seed=3)
    changed = (event.frame != own.frame).any(axis=-1)
    seen: Counter[str] = Counter()
    for name, mask in event.instance_masks.items():
        if (mask & changed).any():
            seen[types.get(name, name.split("|")[0])] += int((mask & changed).sum())
    # Lines around silhouettes, or smooth edges, mix a pixel with its neighbours.
    assert seen["Floor"] > 0.9 * sum(seen.values()), seen
    assert (
        step(controller, "RandomizeMaterials", inRoomTypes=["robothor"]).metadata["actionReturn"][
            "totalMaterialsConsidered"
        ]
        == 0
    )
    np.testing.assert_array_equal(controller.last_event.frame, event.frame)
    none = {"useTrainMaterials": False, "useValMaterials": False, "useTestMaterials": False}
    np.testing.assert_array_equal(step(controller, "RandomizeMaterials", **none).frame, event.frame)


@pytest.mark.parametrize(
    ("action", "arguments", "message"),
    [
        ("RandomizeMaterials", {"inRoomTypes": []}, "inRoomTypes must have a non-zero length!"),
        ("RandomizeMaterials", {"inRoomTypes": ["Attic"]}, "inRoomTypes contains unknown room type: Attic."),
        ("RandomizeMaterials", {"objectTypes": ["Soffa"]}, 'argument `categories` is "Soffa"'),
        ("RandomizeLighting", {"brightness": (-1, 1)}, "Each brightness must be >= 0, not brightness="),
        ("RandomizeLighting", {"hue": (0, 2)}, "hue range must be in [0:1], not [0.0, 2.0]"),
        ("RandomizeLighting", {"saturation": (-1, 0)}, "saturation range must be in [0:1], not [-1.0, 0.0]"),
        ("RandomizeLighting", {"brightness": (1, 1, 1)}, "must each have 2 values"),
        ("RandomizeLighting", {"randomizeColor": False, "hue": (0, 1)}, "Cannot pass in randomizeColor=False"),
    ],
)
def test_wrong_arguments_fail_with_the_documented_messages(engine, action: str, arguments: Any, message: str) -> None:
    result = engine.execute({"action": action, **arguments})
    assert not result.is_success
    assert message in result.error_message


@pytest.fixture(scope="module")
def engine(house):
    from evonav.thor.engine import Engine

    engine = Engine(width_px=32, height_px=32)
    assert engine.execute({"action": "CreateHouse", "house": house}).is_success
    return engine
