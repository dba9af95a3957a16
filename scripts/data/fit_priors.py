"""Count what the agent `pro` expects by default: how rooms change, and which objects are in which rooms.

    evonav tasks generate --houses houses-train.jsonl.gz --limit 60 --out out/tasks/train
    python scripts/data/fit_priors.py out/tasks/train --houses houses-train.jsonl.gz

prints the constants of `evonav.agents.proactive.config` and the rooms of `OF_TYPE` in `home_statistics`.
Give it training houses only.
"""

import argparse
import gzip
import json
import sys
from collections import Counter
from pathlib import Path

import evonav
from evonav.decision.text.language import ROOMS, canonical

MIN_OBJECTS = 5


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", type=Path)
    parser.add_argument("--houses", type=Path, required=True)
    asked = parser.parse_args()
    sys.stdout.write(changes(asked.tasks))
    sys.stdout.write(rooms(asked.houses))


def changes(folder: Path) -> str:
    """Return how often a transition changes a room, by which mode, and the share of the room's objects that move."""
    num_transitions, modes, moved, present = 0, Counter[str](), Counter[str](), Counter[str]()
    stayed, went = 0, 0
    for oracle in sorted(folder.glob("*/oracle/stage_*.json")):
        evolution = json.loads(oracle.read_text())["evolution"]
        number = int(oracle.stem.removeprefix("stage_"))
        num_transitions += number > 1
        if evolution["outcome"] != "evolved":
            continue
        before, after = (rooms_of(oracle.parents[1] / "houses" / f"stage_{k}.json.gz") for k in (number - 1, number))
        changed = {change["id"] for change in evolution["changes"] if change["is_relocated"]}
        modes[evolution["mode"]] += 1
        present[evolution["mode"]] += sum(room == evolution["room_id"] for room in before.values())
        moved[evolution["mode"]] += len(changed)
        stayed += sum(after[one] == before[one] for one in changed)
        went += sum(after[one] != before[one] for one in changed)
    num_changes = sum(modes.values())
    lines = [f"transitions {num_transitions}, changed {num_changes}: {num_changes / num_transitions:.2f}"]
    for mode, number in modes.most_common():
        lines.append(f"{mode}: {number / num_changes:.2f}, moved {moved[mode] / present[mode]:.2f} of {present[mode]}")
    lines.append(f"moved within the room: {stayed / (stayed + went):.3f} of {stayed + went}")
    return "\n".join(lines) + "\n"


def rooms_of(path: Path) -> dict[str, str | None]:
    """Return the room of each object of a house."""
    house = evonav.House(gzip.decompress(path.read_bytes()).decode())
    return {one.id: one.room_id for one in house.objects}


def rooms(path: Path) -> str:
    """Return, for each noun, how much more frequent it is in a type of room than in the mean of the floor."""
    counts: dict[str, Counter[str]] = {}
    area_m2: Counter[str] = Counter()
    for house in evonav.load_houses(path):
        types = {room.id: canonical(room.room_type) for room in house.rooms}
        for room in house.rooms:
            area_m2[types[room.id]] += polygon_m2(room.polygon_m)
        for one in house.objects:
            if one.room_id in types:
                counts.setdefault(canonical(one.category), Counter())[types[one.room_id]] += 1
    total_m2 = sum(area_m2.values())
    lines = [f"areas: {', '.join(f'{room} {area_m2[room] / total_m2:.3f}' for room in ROOMS)}"]
    for noun, found in sorted(counts.items()):
        number = sum(found.values())
        if number >= MIN_OBJECTS:
            ratios = ((found[room] + 4 * area_m2[room] / total_m2) / (number + 4) for room in ROOMS)
            factors = (ratio * total_m2 / area_m2[room] for ratio, room in zip(ratios, ROOMS, strict=True))
            lines.append(f'    "{noun}": ({", ".join(f"{factor:.2f}" for factor in factors)}),')
    return "\n".join(lines) + "\n"


def polygon_m2(corners_m: object) -> float:
    """Return the area of a polygon, `(N, 2)`."""
    points = [tuple(corner) for corner in corners_m]  # type: ignore[attr-defined]
    pairs = zip(points, [*points[1:], points[0]], strict=True)
    return abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)) / 2


if __name__ == "__main__":
    main()
