"""Makes the houses that come with evonav from generated ones: `python scripts/data/build_houses.py FOLDER`.

`FOLDER` holds `houses-train.jsonl.gz` and `houses-test.jsonl.gz` as its credit in `python/evonav/data/README.md` tells.
Of each house, small objects that lie beside their support are left out: their places were drawn from the support's
box, and where that box is not filled (the inner corner of an L-shaped counter) they would fall to the floor. A house is
left out if some room of it cannot be reached from where the agent starts.
"""

import gzip
import json
import sys
from pathlib import Path
from typing import Any

from evonav.errors import EvonavError
from evonav.house import House, HouseObject, stream_houses
from evonav.world.embedded import EmbeddedSimulator

OUT = Path(__file__).resolve().parents[2] / "python" / "evonav" / "data" / "houses.jsonl.gz"
SOURCES = ("houses-train.jsonl.gz", "houses-test.jsonl.gz")
MAX_FALL_M = 0.3
FLOOR_M = 0.05


def fallen_ids(simulator: EmbeddedSimulator, house: House) -> set[str]:
    """Objects of a loaded house that came to rest on the floor, far below where the file has them."""
    bodies = {body.id: body for body in simulator.objects}

    def is_fallen(item: HouseObject) -> bool:
        _, height_m, _ = bodies[item.id].centre_m
        on_floor = height_m - bodies[item.id].size_m[1] / 2 < FLOOR_M
        return on_floor and item.position_m[1] - height_m > MAX_FALL_M

    return {item.id for item in house.objects if is_fallen(item)}


def unreached_rooms(simulator: EmbeddedSimulator, house: House) -> list[str]:
    """Rooms without a reachable position."""
    reached = {house.room_of(x, z) for x, _, z in simulator.reachable_positions()}
    return [room.id for room in house.rooms if room.id not in reached]


def without(document: dict[str, Any], ids: set[str]) -> dict[str, Any]:
    """The house without some children of its objects."""
    for item in document["objects"]:
        if "children" in item:
            item["children"] = [child for child in item["children"] if child["id"] not in ids]
    return document


def main(folder: Path) -> None:
    """Writes the bundled houses."""
    simulator = EmbeddedSimulator()
    lines, num_objects = [], 0
    for house in (house for source in SOURCES for house in stream_houses(folder / source)):
        try:
            simulator.reset(house.to_json())
            ids = fallen_ids(simulator, house)
            rooms = unreached_rooms(simulator, house)
        except EvonavError as error:
            sys.stderr.write(f"left out: {error}\n")
            continue
        if rooms:
            sys.stderr.write(f"left out: {house.name}: not reached: {', '.join(rooms)}\n")
            continue
        num_objects += len(ids)
        lines.append(json.dumps(without(json.loads(house.to_json()), ids), separators=(",", ":")))
    packed = gzip.compress(("\n".join(lines) + "\n").encode(), mtime=0)
    OUT.write_bytes(packed)
    sys.stdout.write(f"{len(lines)} houses, {num_objects} objects left out, {len(packed)} bytes in {OUT}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
