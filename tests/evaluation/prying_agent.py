"""An agent that gathers all that its process holds. It must not know what is looked for: see test_oracle_isolation."""

import gc
import json
import os
import sys
from pathlib import Path

import numpy as np

from evonav.agents.agent import NavigateTo, SensorConfig


class Prying:
    """Leaves strings, points and all that the system tells of its process in the file named by TOY_LOOT."""

    sensors = SensorConfig(needs_rgb=True)

    def begin_task(self, task):
        self.task = task

    def begin_stage(self, goal):
        self.is_last = goal.stage == 3

    def act(self, observation):
        if self.is_last:
            Path(os.environ["TOY_LOOT"]).write_text(json.dumps(loot()))
        return NavigateTo((observation.pose.x_m + 1.0, observation.pose.z_m))


def loot():
    strings, points, shapes, seen = set(), [], [], set()
    pending = [*gc.get_objects(), sys.modules, *sys._current_frames().values()]
    while pending:
        thing = pending.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, str | bytes):
            strings.add(thing if isinstance(thing, str) else thing.decode("latin-1"))
        elif isinstance(thing, tuple | list) and len(thing) in (2, 3) and all(isinstance(v, float) for v in thing):
            points.append(list(thing))
        elif isinstance(thing, np.ndarray):
            shapes.append(list(thing.shape))
            if thing.dtype.kind == "f" and thing.size in (2, 3):
                points.append(thing.reshape(-1).tolist())
        pending.extend(gc.get_referents(thing))
        for slot in getattr(type(thing), "__slots__", ()):
            pending.append(getattr(thing, slot, None))
    system = [f"{key}={value}" for key, value in os.environ.items()] + [str(Path.cwd())]
    for descriptor in os.listdir("/proc/self/fd"):  # noqa: PTH208
        try:
            system.append(os.readlink(f"/proc/self/fd/{descriptor}"))  # noqa: PTH115
        except OSError:
            continue
    system.append(Path("/proc/self/cmdline").read_text())
    system.append(Path("/proc/self/maps").read_text())
    return {
        "strings": sorted(text.encode("utf-8", "replace").decode() for text in strings),
        "points": points,
        "shapes": shapes,
        "system": system,
        "modules": sorted(sys.modules),
    }
