"""Makes ProcTHOR houses with the published generator (`procthor` on PyPI, unmodified), without Unity.

    python examples/generate_houses.py --executable "$(which evonav-thor)" --seeds 0:10 --out houses.jsonl.gz

docs/procthor.md says what to install. The same seed gives the same house, whichever seeds are made before it; houses
that fail the generator's own validation are left out. `evonav tasks generate --houses houses.jsonl.gz` makes tasks.
"""

import argparse
import gzip
import json
import logging
import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from pathlib import Path
from typing import Any

from ai2thor.controller import Controller
from procthor.generation import PROCTHOR10K_ROOM_SPEC_SAMPLER, HouseGenerator
from procthor.utils.types import LeafRoom, MetaRoom


def seeds_of(text: str) -> range:
    """`3` or `3:10`, as Python counts."""
    first, _, end = text.partition(":")
    return range(int(first), int(end) if end else int(first) + 1)


def generate(seed: int, options: argparse.Namespace) -> dict[str, Any]:
    """One house, with the generator's own warnings in `metadata.warnings`."""
    # It draws from sets of rooms, which are ordered by hash: by address, unless told otherwise.
    for room in (LeafRoom, MetaRoom):
        room.__hash__ = lambda self: self.room_id
    start: dict[str, Any] = {"branch": "nanna"}
    if options.executable:
        start = {"local_executable_path": options.executable, "x_display": os.environ.get("DISPLAY", "0")}
    controller = Controller(scene="Procedural", quality="Low", **start)
    logging.getLogger().setLevel(logging.ERROR)
    sampler = PROCTHOR10K_ROOM_SPEC_SAMPLER
    try:
        generator = HouseGenerator(
            split=options.split, seed=seed, room_spec=options.rooms, room_spec_sampler=sampler, controller=controller
        )
        house, _ = generator.sample()
        house.validate(controller)
    finally:
        controller.stop()
    # Its numbers are partly numpy's.
    document: dict[str, Any] = json.loads(json.dumps(house.data, default=lambda value: value.item()))
    return document


def line_of(seed: int, house: dict[str, Any], warnings: dict[str, str]) -> str:
    """What is said of a house."""
    objects = house["objects"]
    num_objects = len(objects) + sum(len(parent.get("children", ())) for parent in objects)
    verdict = f"left out: {'; '.join(warnings.values())}" if warnings else "ok"
    return f"seed {seed}: {len(house['rooms'])} rooms, {num_objects} objects, {verdict}"


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    specs = sorted(spec.room_spec_id for spec in PROCTHOR10K_ROOM_SPEC_SAMPLER.room_specs)
    parser.add_argument("--executable", help="evonav-thor; without it AI2-THOR's own Unity build")
    parser.add_argument("--seeds", type=seeds_of, default=range(10), help="one, or first:end (default 0:10)")
    parser.add_argument("--rooms", choices=specs, metavar="SPEC", help=f"by default drawn; one of {', '.join(specs)}")
    parser.add_argument("--split", choices=("train", "val", "test"), default="train", help="of the assets")
    parser.add_argument("--workers", type=int, default=1, help="houses made at a time")
    parser.add_argument("--out", type=Path, default=Path("houses.jsonl.gz"))
    options = parser.parse_args()

    num_valid = 0
    # The order of sets of strings decides what the generator draws; it is fixed when a Python starts.
    os.environ["PYTHONHASHSEED"] = "0"
    # What one house leaves behind in the generator's caches changes the next: each gets a process of its own.
    context = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(options.workers, mp_context=context, max_tasks_per_child=1) as pool,
        gzip.open(options.out, "wt") as file,
    ):
        for seed, house in zip(options.seeds, pool.map(generate, options.seeds, repeat(options)), strict=True):
            warnings = house["metadata"].pop("warnings")
            print(line_of(seed, house, warnings), flush=True)
            if not warnings:
                num_valid += 1
                file.write(json.dumps(house) + "\n")
    print(f"{num_valid} of {len(options.seeds)} houses are valid, in {options.out}")
    return 0 if num_valid else 1


if __name__ == "__main__":
    sys.exit(main())
