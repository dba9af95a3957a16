"""Objects through the unmodified AI2-THOR client."""

from typing import Any

import numpy as np
import pytest

Json = dict[str, Any]


def movable(controller: Any) -> list[Json]:
    return [r for r in controller.last_event.metadata["objects"] if r["pickupable"] or r["moveable"]]


def test_the_client_moves_removes_and_restores_objects(controller: Any) -> None:
    before = {r["objectId"]: r for r in controller.last_event.metadata["objects"]}
    poses = [
        {"objectName": r["name"], "position": r["position"], "rotation": r["rotation"]} for r in movable(controller)
    ]
    assert controller.step(action="SetObjectPoses", objectPoses=poses)
    after = {r["objectId"]: r for r in controller.last_event.metadata["objects"]}
    assert set(after) == set(before)
    gone = movable(controller)[0]["objectId"]
    assert controller.step("DisableObject", objectId=gone)
    assert controller.last_event.get_object(gone) is None
    assert controller.step("EnableObject", objectId=gone)
    back = controller.last_event.get_object(gone)["axisAlignedBoundingBox"]["center"]
    assert back == pytest.approx(after[gone]["axisAlignedBoundingBox"]["center"])
    assert not controller.step("DisableObject", objectId="Ghost")
    assert controller.last_event.metadata["errorMessage"] == ""


def test_an_object_put_before_the_agent_is_seen_there(controller: Any) -> None:
    """In the picture, in the metadata, and by `GetObjectInFrame`."""
    lamp = next((r for r in movable(controller) if r["axisAlignedBoundingBox"]["size"]["y"] > 0.2), None)
    assert lamp is not None
    seen = False
    for pose in controller.step("GetReachablePositions").metadata["actionReturn"]:
        for yaw_deg, (dx_m, dz_m) in ((0, (0.0, 0.9)), (90, (0.9, 0.0))):
            controller.step("Teleport", position=pose, rotation=yaw_deg, horizon=30, standing=True)
            spot = {"x": pose["x"] + dx_m, "y": 1.2, "z": pose["z"] + dz_m}
            if controller.step("PlaceObjectAtPoint", objectId=lamp["objectId"], position=spot):
                event = controller.step("Pass")
                seen = lamp["objectId"] in event.instance_masks
                break
        if seen:
            break
    assert seen
    rows, cols = np.nonzero(event.instance_masks[lamp["objectId"]])
    row, col = int(rows[len(rows) // 2]), int(cols[len(cols) // 2])
    height, width = event.frame.shape[:2]
    found = controller.step("GetObjectInFrame", x=(col + 0.5) / width, y=(row + 0.5) / height)
    assert found.metadata["actionReturn"] == lamp["objectId"]
    assert found.get_object(lamp["objectId"])["visible"]
    assert lamp["objectId"] in controller.step("GetVisibleObjects").metadata["actionReturn"]
