"""Three thousand actions through the real client raise only what AI2-THOR documents, and leave nothing behind."""

import random
from pathlib import Path
from typing import Any

import pytest

from evonav.thor.actions import registry

NUM_ACTIONS = 3_000
# The house would soon be empty, or everything out of sight.
LEFT_OUT = {"CreateHouse", "Reset", "Initialize", "ChangeResolution", "SetObjectFilter"}
MOVES = ["MoveAhead", "MoveBack", "MoveLeft", "MoveRight", "RotateLeft", "RotateRight", "LookUp", "LookDown"]


def _argument(rng: random.Random, house: dict[str, Any], ids: list[str]) -> Any:
    """A value that some action may want."""
    number = rng.uniform(-1.0, 8.0)
    position = {"x": number, "y": 0.9, "z": rng.uniform(-1.0, 8.0)}
    odd = rng.choice(["", "Bed", "default", house["metadata"], float("nan"), "x" * 300])
    whole = rng.choice([0, 1, 30, 90.0, -5])
    return rng.choice([number, whole, position, {"y": 90.0}, rng.choice(ids), ids[:3], True, False, None, odd])


def _action(rng: random.Random, house: dict[str, Any], ids: list[str]) -> dict[str, Any]:
    kind = rng.random()
    if kind < 0.6:
        return {"action": rng.choice(MOVES)}
    if kind < 0.7:
        agent = {**house["metadata"]["agent"], "forceAction": rng.random() < 0.5}
        agent["position"] = {"x": rng.uniform(-1, 9), "y": 0.9, "z": rng.uniform(-1, 9)}
        return {"action": "TeleportFull", **agent}
    if kind < 0.72:
        return {"action": rng.choice(["Nope", "", "moveahead", "__init__", "é\ud800"])}
    name = rng.choice(sorted(set(registry.action_names()) - LEFT_OUT))
    keys = [key for key in registry.parameter_types(name) if rng.random() < 0.7]
    if rng.random() < 0.05:
        keys.append("nonsense")
    return {"action": name} | {key: _argument(rng, house, ids) for key in keys}


def _resources(pid: int) -> tuple[int, int, float]:
    """Open files, threads and resident MiB of a process."""
    folder = Path(f"/proc/{pid}")
    status = dict(line.split(":", 1) for line in (folder / "status").read_text().splitlines())
    return len(list((folder / "fd").iterdir())), int(status["Threads"]), int(status["VmRSS"].split()[0]) / 1024


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="counts files in /proc")
def test_three_thousand_actions(start_controller: Any, house: dict[str, Any]) -> None:
    rng = random.Random(0)
    controller = start_controller(
        scene=house, width=64, height=48, renderDepthImage=True, renderInstanceSegmentation=True
    )
    pid = controller.server.unity_proc.pid
    start = house["metadata"]["agent"]
    ids = [record["objectId"] for record in controller.last_event.metadata["objects"]]
    done = {"success": 0, "failure": 0, "ValueError": 0}
    before: tuple[int, int, float] | None = None
    for step in range(NUM_ACTIONS):
        if step % 250 == 0:
            controller.reset(scene=house)
            controller.step("TeleportFull", **start)
            if step % 500 == 0:
                controller.step("ChangeResolution", x=rng.choice([32, 64]), y=48)
        # The state of a warm engine; in the first thousand actions it imports and fills its caches.
        if step == 1_000:
            before = _resources(pid)
        request = _action(rng, house, ids)
        try:
            event = controller.step(**request)
            done["success" if event.metadata["lastActionSuccess"] else "failure"] += 1
            assert "inside the engine" not in event.metadata["errorMessage"], (request, event.metadata["errorMessage"])
        except ValueError:
            assert controller.last_event.metadata["errorMessage"], request
            done["ValueError"] += 1
        assert controller.last_event.frame.shape[0] == 48
    assert before is not None
    num_files, num_threads, resident_mib = _resources(pid)
    assert (num_files, num_threads) == before[:2]
    assert resident_mib < before[2] + 50.0
    assert min(done.values()) > 150, done
    log = (Path.home() / ".ai2thor/log/unity.log").read_text()
    assert "Traceback" not in log
    controller.stop()
    assert controller.server.unity_proc.wait(10) is not None
    assert not Path(f"/proc/{pid}").exists()
