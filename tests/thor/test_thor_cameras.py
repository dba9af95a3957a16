"""Third-party cameras through the unmodified client: what they draw is where geometry says it is."""

import math

import numpy as np
import pytest

WIDTH, HEIGHT = 150, 100
ALL_IMAGES = {"renderDepthImage": True, "renderInstanceSegmentation": True, "renderSemanticSegmentation": True}


@pytest.fixture
def controller(controller_in, house):
    return controller_in(house, width=WIDTH, height=HEIGHT, **ALL_IMAGES)


def vector(x: float, y: float, z: float) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


def rotation_matrix(rotation: dict[str, float]) -> np.ndarray:
    """Unity's: columns are the camera's right, up and forward; z first, then x, then y."""
    x, y, z = (math.radians(rotation[axis]) for axis in "xyz")
    around_x = np.array([[1, 0, 0], [0, math.cos(x), -math.sin(x)], [0, math.sin(x), math.cos(x)]])
    around_y = np.array([[math.cos(y), 0, math.sin(y)], [0, 1, 0], [-math.sin(y), 0, math.cos(y)]])
    around_z = np.array([[math.cos(z), -math.sin(z), 0], [math.sin(z), math.cos(z), 0], [0, 0, 1]])
    return around_y @ around_x @ around_z


def unprojected(depth: np.ndarray, camera: dict) -> np.ndarray:
    """World points `(H, W, 3)` of a depth image."""
    rows, cols = np.indices(depth.shape) + 0.5
    up, right = 1 - 2 * rows / HEIGHT, (2 * cols / WIDTH - 1) * WIDTH / HEIGHT
    half = camera.get("orthographicSize") or math.tan(math.radians(camera.get("fieldOfView", 90)) / 2) * depth
    points = np.stack([right * half, up * half, depth], axis=-1)
    return points @ rotation_matrix(camera["rotation"]).T + [camera["position"][axis] for axis in "xyz"]


def map_view(controller) -> dict:
    return controller.step("GetMapViewCameraProperties", raise_for_failure=True).metadata["actionReturn"]


def from_above(controller) -> dict:
    """The perspective view of ProcTHOR's notebooks."""
    camera = map_view(controller)
    size = controller.last_event.metadata["sceneBounds"]["size"]
    camera["position"]["y"] += 1.1 * max(size["x"], size["z"])
    del camera["orthographicSize"]
    return camera | {"fieldOfView": 50, "orthographic": False, "farClippingPlane": 50}


def rolled(controller) -> dict:
    position = controller.last_event.metadata["agent"]["position"] | {"y": 2.2}
    return {"position": position, "rotation": vector(35, 140, 25), "fieldOfView": 70}


@pytest.mark.parametrize(("camera_of", "least"), [(map_view, 5), (from_above, 5), (rolled, 2)])
def test_every_pixel_lies_on_the_object_that_it_shows(controller, camera_of, least) -> None:
    camera = camera_of(controller)
    event = controller.step("AddThirdPartyCamera", **camera, raise_for_failure=True)
    assert len(event.third_party_camera_frames) == 1
    assert event.third_party_camera_frames[0].shape == (HEIGHT, WIDTH, 3)
    points = unprojected(event.third_party_depth_frames[0], camera)
    records = {entry["objectId"]: entry for entry in event.metadata["objects"]}
    num_seen = 0
    for object_id, mask in event.third_party_instance_masks[0].items():
        if object_id in records and not object_id.startswith("wall|"):
            box = records[object_id]["axisAlignedBoundingBox"]
            offsets = points[mask] - [box["center"][axis] for axis in "xyz"]
            reach = np.array([box["size"][axis] for axis in "xyz"]) / 2 + 0.03
            assert (np.abs(offsets) <= reach).all(), object_id
            num_seen += records[object_id]["objectType"] != "Floor"
            classes = event.third_party_class_masks[0].mask(records[object_id]["objectType"])
            assert classes is None or classes[mask].all()
    assert num_seen >= least


def test_the_map_view_holds_the_house_and_nothing_hides_its_large_objects(controller) -> None:
    camera = map_view(controller)
    event = controller.step("AddThirdPartyCamera", **camera, raise_for_failure=True)
    bounds = event.metadata["sceneBounds"]
    assert camera["rotation"] == vector(90, 0, 0)
    assert camera["position"]["x"] == pytest.approx(bounds["center"]["x"], abs=0.2)
    assert camera["position"]["z"] == pytest.approx(bounds["center"]["z"], abs=0.2)
    top = bounds["center"]["y"] + bounds["size"]["y"] / 2
    assert top - 0.2 < camera["position"]["y"] <= top
    assert camera["orthographicSize"] == pytest.approx(max(bounds["size"]["x"], bounds["size"]["z"]) / 2, abs=0.2)
    num_whole = 0
    masks = event.third_party_instance_masks[0]
    for entry in event.metadata["objects"]:
        box = entry["axisAlignedBoundingBox"]
        if entry["objectType"] in ("Floor", "Wall", "Doorway", "Window") or entry["objectId"] not in masks:
            continue
        # The picture's right is +x and its top is +z: half its height is the orthographic size.
        scale = HEIGHT / 2 / camera["orthographicSize"]
        col = WIDTH / 2 + (box["center"]["x"] - camera["position"]["x"]) * scale
        row = HEIGHT / 2 - (box["center"]["z"] - camera["position"]["z"]) * scale
        half_width, half_height = box["size"]["x"] / 2 * scale, box["size"]["z"] / 2 * scale
        rows, cols = np.nonzero(masks[entry["objectId"]])
        assert cols.min() >= col - half_width - 1
        assert cols.max() <= col + half_width + 1
        assert rows.min() >= row - half_height - 1
        assert rows.max() <= row + half_height + 1
        num_whole += (
            abs(cols.max() + 1 - cols.min() - 2 * half_width) < 2
            and abs(rows.max() + 1 - rows.min() - 2 * half_height) < 2
        )
    assert num_whole >= 5


def test_the_skybox_fills_the_background(controller) -> None:
    camera = from_above(controller)
    event = controller.step("AddThirdPartyCamera", **camera, skyboxColor="#0f08", raise_for_failure=True)
    nothing = (event.third_party_instance_segmentation_frames[0] == 0).all(axis=-1)
    assert nothing.any()
    assert not nothing.all()
    frame = event.third_party_camera_frames[0]
    assert (frame[nothing] == [0, 255, 0]).all()
    assert not (frame[~nothing] == [0, 255, 0]).all(axis=-1).any()
    assert (event.third_party_depth_frames[0][nothing] == 50).all()
    for colour, expected in (("orange", [255, 165, 0]), ("#102030", [16, 32, 48])):
        event = controller.step("UpdateThirdPartyCamera", skyboxColor=colour, farClippingPlane=50)
        assert (event.third_party_camera_frames[0][nothing] == expected).all()
    kept = controller.step("UpdateThirdPartyCamera", farClippingPlane=50)
    assert (kept.third_party_camera_frames[0][nothing] == [16, 32, 48]).all()
    plain = controller.step("UpdateThirdPartyCamera", skyboxColor="default", farClippingPlane=50)
    assert not (plain.third_party_camera_frames[0][nothing] == [16, 32, 48]).all()


def test_clip_planes(controller) -> None:
    camera = map_view(controller)
    height = camera["position"]["y"]
    far = controller.step("AddThirdPartyCamera", **camera, nearClippingPlane=0.2, farClippingPlane=height - 0.3)
    depth = far.third_party_depth_frames[0]
    assert depth.min() >= 0.2
    assert depth.max() == pytest.approx(height - 0.3)
    assert "Floor" not in far.third_party_class_masks[0]
    near = controller.step("UpdateThirdPartyCamera", nearClippingPlane=height - 0.2, farClippingPlane=height + 1)
    assert "Floor" in near.third_party_class_masks[0]
    assert near.third_party_depth_frames[0].min() >= height - 0.2


def test_several_cameras_with_metadata_are_updated_by_id_and_dropped_by_reset(controller, house) -> None:
    controller.step("AddThirdPartyCamera", position=vector(1, 2, 3), rotation=vector(0, 0, 0), raise_for_failure=True)
    added = vector(-10, 400, 0)
    event = controller.step("AddThirdPartyCamera", position=vector(2, 1, 2), rotation=added, fieldOfView=60)
    assert event.metadata["thirdPartyCameras"] == [
        {"thirdPartyCameraId": 0, "position": vector(1, 2, 3), "rotation": vector(0, 0, 0), "fieldOfView": 90},
        {"thirdPartyCameraId": 1, "position": vector(2, 1, 2), "rotation": vector(350, 40, 0), "fieldOfView": 60},
    ]
    first = event.third_party_camera_frames[0]
    event = controller.step("UpdateThirdPartyCamera", thirdPartyCameraId=1, position={"y": 1.5}, rotation={"y": 90})
    second = event.metadata["thirdPartyCameras"][1]
    assert second["position"] == vector(2, 1.5, 2)
    assert second["rotation"] == vector(350, 90, 0)
    assert second["fieldOfView"] == 60
    np.testing.assert_array_equal(event.third_party_camera_frames[0], first)
    moved = controller.step("RotateRight")
    np.testing.assert_array_equal(moved.third_party_camera_frames[0], first)
    assert controller.step("Pass", renderImage=False).third_party_camera_frames == []
    again = controller.reset(scene=house)
    assert again.third_party_camera_frames == []
    assert again.metadata["thirdPartyCameras"] == []


def test_angles_come_back_as_unity_gives_them(controller) -> None:
    """Tipped over backwards is turned around and upside down: other numbers, the same picture."""
    position = controller.last_event.metadata["cameraPosition"]
    controller.step("AddThirdPartyCamera", position=position, rotation=vector(135, 10, 0), raise_for_failure=True)
    event = controller.step("AddThirdPartyCamera", position=position, rotation=vector(45, 190, 180))
    assert [camera["rotation"] for camera in event.metadata["thirdPartyCameras"]] == [vector(45, 190, 180)] * 2
    one, other = event.third_party_instance_segmentation_frames
    assert (one == other).all(axis=-1).mean() > 0.99


def test_a_camera_at_the_agents_camera_gives_the_same_images(controller) -> None:
    event = controller.step("RotateRight")
    agent = event.metadata["agent"]
    event = controller.step(
        "AddThirdPartyCamera",
        position=event.metadata["cameraPosition"],
        rotation=vector(agent["cameraHorizon"], agent["rotation"]["y"], 0),
        fieldOfView=event.metadata["fov"],
        raise_for_failure=True,
    )
    np.testing.assert_array_equal(event.third_party_camera_frames[0], event.frame)
    np.testing.assert_array_equal(event.third_party_depth_frames[0], event.depth_frame)
    np.testing.assert_array_equal(event.third_party_instance_segmentation_frames[0], event.instance_segmentation_frame)


def test_the_map_view_replaces_the_agents_camera(controller, house) -> None:
    camera = map_view(controller)
    before = controller.step("AddThirdPartyCamera", **camera, raise_for_failure=True)
    assert before.metadata["cameraOrthSize"] == -1
    event = controller.step("ToggleMapView", raise_for_failure=True)
    np.testing.assert_array_equal(event.frame, before.third_party_camera_frames[0])
    np.testing.assert_array_equal(event.depth_frame, before.third_party_depth_frames[0])
    assert event.metadata["cameraPosition"] == camera["position"]
    assert event.metadata["cameraOrthSize"] == camera["orthographicSize"]
    assert event.metadata["agent"] == before.metadata["agent"]
    event = controller.step("ToggleMapView")
    np.testing.assert_array_equal(event.frame, before.frame)
    assert event.metadata["cameraPosition"] == before.metadata["cameraPosition"]
    controller.step("ToggleMapView")
    assert controller.reset(scene=house).metadata["cameraOrthSize"] == -1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fieldOfView": 0}, "fieldOfView: 0 must be in"),
        ({"fieldOfView": 180}, "fieldOfView: 180 must be in"),
        ({"fieldOfView": 179.9}, "this engine draws"),
        ({"orthographicSize": 2.0}, "can only be set when orthographic=True"),
        ({"orthographic": True, "orthographicSize": -1.0}, "orthographicSize: -1 must be"),
        ({"skyboxColor": "no colour"}, "Invalid skyboxColor: no colour!"),
        ({"skyboxColor": "#12345"}, "Invalid skyboxColor: #12345!"),
        ({"nearClippingPlane": 5.0, "farClippingPlane": 2.0}, "nearClippingPlane 5 and farClippingPlane 2"),
        ({"nearClippingPlane": -1.0}, "nearClippingPlane -1"),
        ({"position": vector(1e300, 0, 0)}, "position and rotation must be within"),
    ],
)
def test_a_view_that_cannot_be_rendered_fails_the_action(controller, options, message) -> None:
    given = {"position": vector(1, 2, 3), "rotation": vector(0, 0, 0)} | options
    event = controller.step("AddThirdPartyCamera", **given)
    assert not event.metadata["lastActionSuccess"]
    assert message in event.metadata["errorMessage"]
    assert event.metadata["thirdPartyCameras"] == []
    controller.step("AddThirdPartyCamera", position=vector(1, 2, 3), rotation=vector(0, 0, 0), raise_for_failure=True)
    event = controller.step("UpdateThirdPartyCamera", **options)
    assert message in event.metadata["errorMessage"]
    assert event.metadata["thirdPartyCameras"][0]["position"] == vector(1, 2, 3)
    assert (
        "thirdPartyCameraId: 3"
        in controller.step("UpdateThirdPartyCamera", thirdPartyCameraId=3).metadata["errorMessage"]
    )
