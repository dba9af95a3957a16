"""Complete houses as they are read: sizes of assets that the catalogue lacks, and a start pose."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from evonav.errors import EvonavError, HouseError
from evonav.house import House
from evonav.house.asset_sizes import AssetSizes, read_asset_sizes
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose

StartRule = Literal["file", "auto"]
HORIZON_DEG = 30.0
"""Horizon of a chosen start, as in ProcTHOR's houses."""


@dataclass(frozen=True, slots=True)
class HouseOptions:
    """Options of completing houses. The result is in the house itself, so tasks and runs need nothing else."""

    assets: AssetSizes | None = None
    start: StartRule = "file"
    """`auto` gives a house without `metadata.agent` a start pose (`free_start`)."""

    @classmethod
    def of(cls, assets: Path | None = None, start: StartRule = "file") -> "HouseOptions | None":
        """Return the options of a command; `None` if there are none.

        Raises:
            HouseError: The file of sizes cannot be read, or an entry is wrong.
        """
        if assets is None and start == "file":
            return None
        return cls(None if assets is None else read_asset_sizes(assets), start)

    @property
    def identity(self) -> Mapping[str, str]:
        """Return what decides the houses: the digest of the sizes, and the rule of the start."""
        found: dict[str, str] = {} if self.start == "file" else {"start": self.start}
        if self.assets is not None:
            found["assets"] = hashlib.sha256(self.assets.path.read_bytes()).hexdigest()
        return found

    def complete(self, name: str, text: str) -> str:
        """Return a house with what it lacks; a text that is no house is returned as it is, to be refused later."""
        try:
            document = json.loads(text)
            is_changed = self.assets is not None and self.assets.embed(document)
            metadata = document.get("metadata") or {}
            if self.start == "auto" and metadata.get("agent") is None:
                agent = free_start(House(json.dumps(document), name=name))
                document["metadata"] = {**metadata, "agent": agent, "evonav_start": "auto"}
                is_changed = True
        except (ValueError, AttributeError, TypeError, EvonavError):
            return text
        return json.dumps(document) if is_changed else text


def free_start(house: House) -> dict[str, Any]:
    """Choose a start pose, as `metadata.agent` holds it.

    Of the free places nearest to the middle of each room, it is the one from which the most places of the 0.25 m grid
    can be reached; of equals, the one in the room that the file lists first. It faces +z.

    Raises:
        HouseError: The agent fits nowhere.
    """
    simulator = EmbeddedSimulator(allow_unknown_assets=True)
    best: tuple[int, Pose] | None = None
    for room in house.rooms:
        x_m, z_m = np.mean(np.array(room.polygon_m), axis=0).tolist()
        agent = _agent(x_m, z_m)
        document = json.loads(house.to_json())
        document["metadata"] = {**document["metadata"], "agent": agent}
        pose = simulator.reset(json.dumps(document), name=house.name)
        num_reached = len(simulator.reachable_positions())
        if house.room_of(pose.x_m, pose.z_m) is not None and (best is None or num_reached > best[0]):
            best = num_reached, pose
    if best is None:
        raise HouseError(f"house {house.name}: house: field `metadata.agent`: no free place for a start was found")
    return _agent(best[1].x_m, best[1].z_m)


def _agent(x_m: float, z_m: float) -> dict[str, Any]:
    return {
        "horizon": HORIZON_DEG,
        "position": {"x": x_m, "y": 0.95, "z": z_m},
        "rotation": {"x": 0, "y": 0, "z": 0},
        "standing": True,
    }
