"""The client's dialogue with the engine: start, settings, images, colours, metadata, mistakes."""

import hashlib
import json
from typing import Any

import numpy as np
import pytest

import evonav.thor
from evonav.errors import SimulationError
from evonav.thor.engine import Engine
from evonav.thor.events import Emitter
from evonav.thor.images import assign
from evonav.thor.transport.fifo import FieldType
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose

# AI2-THOR's `MetadataWrapper` and `AgentMetadata` (AgentManager.cs), and what its client reads.
WRAPPER = {
    *("objects", "isSceneAtRest", "agent", "heldObjectPose", "arm", "fov", "cameraPosition", "cameraOrthSize"),
    *("thirdPartyCameras", "collided", "collidedObjects", "inventoryObjects", "sceneName", "lastAction"),
    *("errorMessage", "errorCode", "lastActionSuccess", "screenWidth", "screenHeight", "agentId", "colors"),
    *("colorBounds", "flatSurfacesOnGrid", "distances", "normals", "isOpenableGrid", "segmentedObjectIds"),
    *("objectIdsInBox", "actionIntReturn", "actionFloatReturn", "actionStringsReturn", "actionFloatsReturn"),
    *("actionVector3sReturn", "visibleRange", "currentTime", "sceneBounds", "actionReturn", "depthFormat"),
}
AGENT = {"name", "position", "rotation", "cameraHorizon", "isStanding", "inHighFrictionArea"}


def _embedded(controller: Any, house: dict[str, Any]) -> tuple[EmbeddedSimulator, Any]:
    """Our own picture of what the client's camera sees."""
    simulator = EmbeddedSimulator(allow_unknown_assets=True)
    simulator.reset(json.dumps(house))
    agent = controller.last_event.metadata["agent"]
    at = agent["position"]
    pose = Pose.of_degrees(at["x"], at["y"], at["z"], agent["rotation"]["y"], agent["cameraHorizon"])
    return simulator, simulator.render(pose)


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
    controller = start_controller(scene="Procedural", renderInstanceSegmentation=True)
    event = controller.last_event
    assert event.metadata["objects"] == []
    assert event.metadata["sceneBounds"] is None
    assert not event.frame.any()
    assert len(event.instance_masks) == 0
    with pytest.raises(ValueError, match="not contained in build"):
        controller.reset("FloorPlan1")


def test_metadata_has_all_fields(controller: Any) -> None:
    metadata = controller.last_event.metadata
    assert set(metadata) == WRAPPER
    assert set(metadata["agent"]) == AGENT
    assert metadata["depthFormat"] == "Meters"
    assert metadata["fov"] == 90.0
    assert metadata["cameraPosition"]["y"] == pytest.approx(1.575)
    bounds = metadata["sceneBounds"]
    for record in metadata["objects"]:
        assert set(record["position"]) == set("xyz")
        box = record["axisAlignedBoundingBox"]
        for axis in "xyz":
            assert abs(box["center"][axis] - bounds["center"][axis]) <= 0.5 * bounds["size"][axis] + 1e-6


def test_images_equal_the_embedded_simulators(controller: Any, house: dict[str, Any]) -> None:
    event = controller.last_event
    simulator, frame = _embedded(controller, house)
    assert np.array_equal(event.frame, frame.rgb)
    assert np.array_equal(event.depth_frame, np.minimum(frame.depth_m, 20.0))
    assert len(np.unique(frame.instances)) > 5
    names = {instance: body.id for instance, body in enumerate(simulator.objects, 1) if body.kind != "ceiling"}
    for instance in np.unique(frame.instances):
        name = names.get(int(instance))
        if name and "|" in name:
            assert np.array_equal(event.instance_masks[name], frame.instances == instance)
            low, high = np.argwhere(frame.instances == instance).min(0), np.argwhere(frame.instances == instance).max(0)
            assert event.instance_detections2D[name] == (low[1], low[0], high[1], high[0])


def test_classes_have_masks_whatever_ids_look_like(controller: Any, house: dict[str, Any]) -> None:
    """`2|0` and `Fridge|2|0` alike: the client derives a class from an id only where the id begins with it."""
    all_seen = set()
    for _ in range(4):
        event = controller.step("RotateRight")
        simulator, frame = _embedded(controller, house)
        categories = np.array(["", *(body.category for body in simulator.objects)])[frame.instances]
        seen = set(np.unique(categories)) - {""}
        for category in seen:
            assert np.array_equal(event.class_masks[category], categories == category), category
            color = event.object_id_to_color[category]
            assert np.array_equal((event.semantic_segmentation_frame == color).all(-1), categories == category)
        assert set(event.class_masks) >= seen
        all_seen |= seen
    assert len(all_seen) > 5


def test_colours_are_a_function_of_the_name(controller: Any) -> None:
    """AI2-THOR's own: the first bytes of the MD5, so the same in every scene."""
    colors = {entry["name"]: tuple(entry["color"]) for entry in controller.last_event.metadata["colors"]}
    assert len(set(colors.values())) == len(colors)
    for name, color in colors.items():
        assert color == tuple(hashlib.md5(name.encode(), usedforsecurity=False).digest()[:3])
    for record in controller.last_event.metadata["objects"]:
        assert record["objectId"] in colors or record["objectType"] == "Floor"


def test_equal_hashes_get_different_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evonav.thor.images._hashed", lambda name: (len(name), 0, 0))
    colors = assign(["b", "a", "cc"])
    assert len(set(colors.values()) | {(0, 0, 0)}) == 4
    assert colors["a"] == (1, 0, 0), "the first in the alphabet keeps its own"


def test_images_on_request_only(controller_in: Any, house: dict[str, Any]) -> None:
    controller = controller_in(house)
    assert controller.last_event.depth_frame is None
    assert controller.last_event.instance_segmentation_frame is None
    assert controller.last_event.metadata["colors"] is None
    assert controller.step("Pass", renderImage=False).frame is None
    assert controller.step("Pass", renderInstanceSegmentation=True).instance_segmentation_frame is not None
    assert controller.step("Pass").instance_segmentation_frame is None
    controller.reset(renderDepthImage=True, renderSemanticSegmentation=True)
    assert controller.last_event.depth_frame is not None
    assert controller.last_event.semantic_segmentation_frame is not None


def test_headless(start_controller: Any, house: dict[str, Any]) -> None:
    controller = start_controller(scene=house, headless=True)
    assert controller.last_event.frame is None
    assert controller.last_event.metadata["lastActionSuccess"]
    assert controller.step("GetReachablePositions").metadata["actionReturn"]


def test_settings_change_on_reset(controller_in: Any, house: dict[str, Any]) -> None:
    controller = controller_in(house, fieldOfView=60, width=100, height=80)
    assert controller.last_event.metadata["fov"] == 60.0
    assert controller.last_event.frame.shape == (80, 100, 3)
    narrow = controller.step("TeleportFull", **house["metadata"]["agent"]).frame.copy()
    controller.reset(fieldOfView=90, width=120, height=80)
    wide = controller.step("TeleportFull", **house["metadata"]["agent"])
    assert wide.metadata["fov"] == 90.0
    assert wide.frame.shape == (80, 120, 3)
    assert not np.array_equal(wide.frame[:, 10:110], narrow)


def test_impossible_settings_are_refused_at_the_start(start_controller: Any) -> None:
    """`failed_actions.md` lists them all."""
    with pytest.raises(RuntimeError, match="agentCount 2: this engine has one agent"):
        start_controller(scene="Procedural", agentCount=2)
    with pytest.raises(ValueError, match="Initialize has an invalid argument: gridSize"):
        start_controller(scene="Procedural", gridSize="wide")


def test_settings_that_cannot_be_rendered_leave_the_scene(controller: Any) -> None:
    before = controller.last_event
    for degrees in (1e-6, 179.999):
        event = controller.step("Initialize", fieldOfView=degrees)
        if not event.metadata["lastActionSuccess"]:
            assert event.metadata["fov"] == before.metadata["fov"]
    assert len(controller.step("Pass").metadata["objects"]) == len(before.metadata["objects"])


def test_wrong_arguments_get_the_documented_errors(controller: Any) -> None:
    with pytest.raises(ValueError, match=r"Invalid action: SliceObject \(AI2-THOR has it, evonav's engine does not\)"):
        controller.step("SliceObject", objectId="Apple|1")
    with pytest.raises(ValueError, match=r"Invalid action: FlyAway$"):
        controller.step("FlyAway")
    with pytest.raises(ValueError, match="\"GetSceneBounds\" called with invalid argument: 'speeed'"):
        controller.step("GetSceneBounds", speeed=1)
    with pytest.raises(ValueError, match="GetShortestPathToPoint is missing the following arguments: target"):
        controller.step("GetShortestPathToPoint")
    with pytest.raises(ValueError, match=r"has an invalid argument: degrees .*Cannot convert to: float"):
        controller.step("RotateRight", degrees="far")
    with pytest.raises(ValueError, match="invalid argument: position"):
        controller.step("Teleport", position={"x": float("nan"), "y": 0.9, "z": 1})
    assert controller.step("Pass").metadata["errorMessage"] == ""


def test_a_malformed_house_is_refused_by_its_field(controller: Any, house: dict[str, Any]) -> None:
    before = controller.last_event
    rooms = [house["rooms"][0] | {"floorPolygon": [{"x": 0.0, "y": 0.0, "z": "far"}]}]
    event = controller.step("CreateHouse", house=house | {"rooms": rooms})
    assert not event.metadata["lastActionSuccess"]
    assert "floorPolygon[0].z" in event.metadata["errorMessage"]
    assert event.metadata["agent"] == before.metadata["agent"]
    assert event.metadata["objects"] == before.metadata["objects"]
    assert np.array_equal(event.frame, before.frame)


def test_object_filter(controller: Any, house: dict[str, Any]) -> None:
    total = len(controller.last_event.metadata["objects"])
    wanted = [entry["id"] for entry in house["objects"][:2]]
    event = controller.step("SetObjectFilter", objectIds=[*wanted, "nothing"])
    assert [record["objectId"] for record in event.metadata["objects"]] == wanted
    assert controller.step("RotateRight").metadata["objects"][0]["distance"] > 0.0
    assert controller.step("SetObjectFilter", objectIds=[]).metadata["objects"] == []
    assert len(controller.step("ResetObjectFilter").metadata["objects"]) == total


def test_scene_bounds(controller: Any) -> None:
    low, high = controller.step("GetSceneBounds").metadata["actionReturn"]
    bounds = controller.last_event.metadata["sceneBounds"]
    for axis in "xyz":
        assert high[axis] - low[axis] == pytest.approx(bounds["size"][axis])


def test_fast_emit_patches_what_has_not_changed(controller_in: Any, house: dict[str, Any]) -> None:
    """The client then shows the last event with the new action's result."""
    controller = controller_in(house, fastActionEmit=True)
    frame = controller.last_event.frame
    event = controller.step("GetReachablePositions")
    assert len(event.metadata["actionReturn"]) > 10
    assert event.metadata["lastAction"] == "GetReachablePositions"
    assert np.array_equal(event.frame, frame)
    with pytest.raises(ValueError, match="Invalid action: Nope"):
        controller.step("Nope")
    turned = controller.step("RotateRight")
    assert turned.metadata["actionReturn"] is None
    assert turned.metadata["agent"]["rotation"]["y"] != event.metadata["agent"]["rotation"]["y"]
    assert not np.array_equal(turned.frame, frame)


def test_patches_only_on_request() -> None:
    kinds = []
    for settings in ({}, {"fastActionEmit": True}):
        engine = Engine()
        emitter = Emitter(engine)
        for name, more in (("Initialize", settings), ("GetScenesInBuild", {}), ("GetScenesInBuild", {})):
            engine.execute({"action": name, **more})
            kinds.append(emitter.event({})[0][0])
    assert kinds == [FieldType.METADATA] * 4 + [FieldType.METADATA_PATCH] * 2


def test_an_unsendable_return_value_fails_the_action() -> None:
    engine = Engine()
    for odd in (object(), 2**70, {"x": {1, 2}}):
        engine.last.is_success, engine.last.action_return = True, odd
        Emitter(engine).event({})
        assert not engine.last.is_success
        assert "cannot be sent" in engine.last.error_message


def test_a_missing_executable_is_explained(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    assert evonav.thor.executable().endswith("evonav-thor")
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))
    monkeypatch.setattr("sysconfig.get_path", lambda name: str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SimulationError, match=r"evonav-thor is neither in .* nor on the PATH"):
        evonav.thor.executable()
