"""ObjectNav in AI2-THOR, written from AI2-THOR's public documentation: nothing in here knows of evonav.

    python objectnav_ai2thor.py house.json                                        # on Unity
    python objectnav_ai2thor.py house.json --executable "$(which evonav-thor)"    # on evonav's engine

`house.json` is a ProcTHOR house, or `.jsonl[.gz]` with one a line. An episode starts at a random reachable position and
asks for an object of a random type. The agent is AI2-THOR's own expert, walks the shortest path, or walks at random; it
succeeds if it stops with such an object visible within 1.5 m. Prints a line of JSON per episode, then the rates.
"""

import argparse
import gzip
import json
import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from ai2thor.controller import Controller
from ai2thor.server import Event
from ai2thor.util.metrics import compute_single_spl, get_shortest_path_to_object, path_distance

TARGETS = ("Bed", "Television", "Toilet", "Sofa", "Fridge", "Laptop", "Apple", "AlarmClock", "HousePlant", "Chair")
MAX_STEPS = 300


def houses(path: Path) -> Iterator[dict[str, Any]]:
    """ProcTHOR houses of a file."""
    with gzip.open(path, "rt") if path.suffix == ".gz" else path.open() as file:
        if ".jsonl" in path.suffixes:
            yield from (json.loads(line) for line in file)
        else:
            yield json.load(file)


def visible_targets(event: Event, object_type: str) -> list[dict[str, Any]]:
    """Objects of the type that the agent sees, nearest first."""
    seen = [entry for entry in event.metadata["objects"] if entry["visible"] and entry["objectType"] == object_type]
    return sorted(seen, key=lambda entry: entry["distance"])


def next_action(
    controller: Controller,
    agent: str,
    target: dict[str, Any],
    corners: list[dict[str, float]],
    rng: np.random.Generator,
) -> dict[str, Any] | None:
    """What the agent does next; None to stop."""
    if visible_targets(controller.last_event, target["objectType"]):
        return None
    if agent == "random":
        return {"action": str(rng.choice(["MoveAhead", "MoveAhead", "MoveAhead", "RotateRight", "RotateLeft"]))}
    if agent == "path":
        return along_path(controller.last_event, target, corners)
    event = controller.step("ObjectNavExpertAction", objectId=target["objectId"])
    return {"action": event.metadata["actionReturn"]} if event.metadata["lastActionSuccess"] else None


def along_path(event: Event, target: dict[str, Any], corners: list[dict[str, float]]) -> dict[str, Any] | None:
    """Turns to the next corner of the shortest path and walks there; at the last one, turns to the target."""
    agent = event.metadata["agent"]
    here = agent["position"]
    while corners and math.hypot(corners[0]["x"] - here["x"], corners[0]["z"] - here["z"]) < 1e-3:
        corners.pop(0)
    aim = corners[0] if corners else target["axisAlignedBoundingBox"]["center"]
    right, up, ahead = aim["x"] - here["x"], aim["y"] - event.metadata["cameraPosition"]["y"], aim["z"] - here["z"]
    turn = (math.degrees(math.atan2(right, ahead)) - agent["rotation"]["y"] + 180) % 360 - 180
    if abs(turn) > 0.01:
        return {"action": "RotateRight" if turn > 0 else "RotateLeft", "degrees": abs(turn)}
    if corners:
        return {"action": "MoveAhead", "moveMagnitude": min(0.25, math.hypot(right, ahead))}
    look = -math.degrees(math.atan2(up, math.hypot(right, ahead))) - agent["cameraHorizon"]
    if abs(look) < 15:
        return None
    return {"action": "LookDown" if look > 0 else "LookUp"}


def nearest_of_type(
    controller: Controller, object_type: str, start: dict[str, float]
) -> tuple[dict[str, Any], list[dict[str, float]]] | None:
    """The object of a type with the shortest path to it; None where no path leads to any."""
    found = []
    for entry in controller.last_event.objects_by_type(object_type):
        try:
            found.append((entry, get_shortest_path_to_object(controller, entry["objectId"], start)))
        except ValueError:
            continue  # AI2-THOR knows no place to see it from
    return min(found, key=lambda pair: path_distance(pair[1]), default=None)


def sight(event: Event, object_type: str) -> dict[str, Any] | None:
    """The nearest visible target in the images: AI2-THOR's masks, boxes and depth."""
    for target in visible_targets(event, object_type):
        mask = event.instance_masks.mask(target["objectId"])
        if mask is not None:
            left, top, right, bottom = event.instance_detections2D[target["objectId"]]
            return {
                "objectId": target["objectId"],
                "distance": round(target["distance"], 3),
                "box": [left, top, right, bottom],
                "pixels": int(mask.sum()),
                "pixels_of_type": int(event.class_masks[object_type].sum()),
                "depth": round(float(np.median(event.depth_frame[mask])), 3),
                "colour_bgr": [round(float(value), 1) for value in event.cv2img[mask].mean(axis=0)],
            }
    return None


def run_episode(
    controller: Controller, house: dict[str, Any], agent: str, rng: np.random.Generator
) -> dict[str, Any] | None:
    """One episode in the house at hand; None if it holds no target that can be reached."""
    controller.step("TeleportFull", **house["metadata"]["agent"], raise_for_failure=True)
    positions = controller.step("GetReachablePositions").metadata["actionReturn"]
    start = positions[int(rng.integers(len(positions)))]
    event = controller.step(
        action="TeleportFull",
        position=start,
        rotation={"x": 0, "y": 90 * int(rng.integers(4)), "z": 0},
        horizon=0,
        standing=True,
    )
    present = sorted({entry["objectType"] for entry in event.metadata["objects"]} & set(TARGETS))
    candidates = (nearest_of_type(controller, str(name), start) for name in rng.permutation(present))
    chosen = next((found for found in candidates if found is not None), None)
    if chosen is None:
        return None
    target, shortest_path = chosen
    object_type = target["objectType"]

    path = [controller.last_event.metadata["agent"]["position"]]
    corners = list(shortest_path)
    num_steps, num_failed = 0, 0
    while num_steps < MAX_STEPS:
        action = next_action(controller, agent, target, corners, rng)
        if action is None:
            break
        event = controller.step(**action)
        num_steps += 1
        num_failed += not event.metadata["lastActionSuccess"]
        path.append(event.metadata["agent"]["position"])
    event = controller.step("Done")
    is_success = bool(visible_targets(event, object_type))
    return {
        "target": object_type,
        "success": is_success,
        "steps": num_steps,
        "failed_actions": num_failed,
        "path_length": round(path_distance(path), 3),
        "shortest_path_length": round(path_distance(shortest_path), 3),
        "spl": compute_single_spl(path, shortest_path, is_success),
        "sight": sight(event, object_type),
    }


def main() -> None:
    """Runs episodes in each house."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("houses", type=Path)
    parser.add_argument("--executable", help="instead of the Unity build that the client downloads")
    parser.add_argument("--agent", choices=("expert", "path", "random"), default="expert")
    parser.add_argument("--episodes", type=int, default=10)
    parser.add_argument("--max-houses", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    rng = np.random.default_rng(options.seed)
    scenes = [house for house, _ in zip(houses(options.houses), range(options.max_houses), strict=False)]
    controller = Controller(
        scene=scenes[0],
        agentMode="default",
        gridSize=0.25,
        snapToGrid=False,
        rotateStepDegrees=90,
        visibilityDistance=1.5,
        width=300,
        height=300,
        fieldOfView=90,
        renderDepthImage=True,
        renderInstanceSegmentation=True,
        x_display=os.environ.get("DISPLAY", "0"),
        **({"local_executable_path": options.executable} if options.executable else {}),
    )
    results = []
    try:
        for number in range(options.episodes):
            house = scenes[number % len(scenes)]
            if number:
                controller.reset(scene=house)
            result = run_episode(controller, house, options.agent, rng)
            if result is not None:
                results.append(result)
                print(json.dumps({"episode": number, **result}), flush=True)
    finally:
        controller.stop()
    num = max(len(results), 1)
    success_rate = sum(result["success"] for result in results) / num
    spl = sum(result["spl"] for result in results) / num
    print(json.dumps({"episodes": len(results), "success_rate": success_rate, "spl": spl}))


if __name__ == "__main__":
    main()
