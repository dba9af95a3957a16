"""Runs everything once on a few bundled houses and returns digests of what it wrote.

    python tests/golden/small_run.py    # prints what differs from digests.json
    python tests/golden/small_run.py --write    # accepts it; the commit says which numbers changed, and why

Digests are of canonical JSON and of pixels, so they do not depend on the layout of a file, only on its values. Those of
`decisions` are of actions, poses and scores alone: a change of a file's format leaves them as they are.
"""

import gzip
import hashlib
import io
import json
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from PIL import Image

DIGESTS = Path(__file__).with_name("digests.json")
SIX_AGENTS = "unigoal,3d-mem,msgnav,fu,stage-reset,ftu"
EXTENSIONS = """
num_stages = [3, 4]
evolve_probability = 0.8
[extensions]
insertion = {probability = 0.5, max_count = 3}
removal = {probability = 0.5, max_count = 3}
doors = {probability = 0.5, max_count = 2}
openables = {probability = 0.5, max_count = 3}
switches = {probability = 0.5, max_count = 2}
schedule = {num_persons = 3, minutes_between_stages = 180, tidiness = 0.8}
"""
SWEEP = """
name = "golden"
agents = ["fu", "ftu"]
tasks = ["bundled:1"]
seeds = [0, 1]
[decisions]
right = "text"
wrong-20 = "text:wrong=0.2"
"""
# Where the software itself, this machine or the moment is described; moving a module changes it, no number does.
UNSTABLE = {"backend", "config", "evonav", "generator", "git", "identity", "models", "options", "simulator"}

Digests = dict[str, str]


def digests_of(part: str, folder: Path) -> Digests:
    """Writes one of `PARTS` below `folder`, and returns its digests."""
    return {f"{part}/{key}": digest for key, digest in PARTS[part](folder / part)}


def differences(part: str, found: Digests) -> list[str]:
    """Names of a part's digests that are new, gone or other than the committed ones."""
    known = json.loads(DIGESTS.read_text(encoding="utf-8"))
    names = {key for key in known if key.startswith(f"{part}/")} | found.keys()
    return sorted(key for key in names if known.get(key) != found.get(key))


def _six_agents(out: Path) -> Iterator[tuple[str, str]]:
    _evonav("evaluate", "--agent", SIX_AGENTS, "--limit", 2, "--workers", 2, "--out", out)
    yield from _run(out)
    packed = out.with_suffix(".evonav.jsonl.gz")
    _evonav("pack", out, "--out", packed)
    header, records = gzip.decompress(packed.read_bytes()).split(b"\n", 1)
    yield "pack/header", _of_json(json.loads(header))
    yield "pack/records", _of_bytes(records)


def _imperfect(out: Path) -> Iterator[tuple[str, str]]:
    options = ("--perception", "noisy:poor", "--set", "decision.noise.wrong=0.1", "--seed", 3, "--isolation", "none")
    agents = "random-walk,nearest-frontier,stay-still,oracle-memory,shortest-path,oracle-flags,fu,msgnav"
    _evonav("evaluate", "--agent", agents, "--limit", 1, "--workers", 1, *options, "--out", out)
    yield from _run(out)


def _generation(out: Path) -> Iterator[tuple[str, str]]:
    houses = Path(__file__).parents[2] / "python/evonav/data/houses.jsonl.gz"
    _evonav("tasks", "generate", "--houses", houses, "--limit", 3, "--seed", 1, "--workers", 2, "--out", out / "paper")
    config = out / "extensions.toml"
    config.write_text(EXTENSIONS, encoding="utf-8")
    _evonav(
        "tasks", "generate", "--houses", houses, "--limit", 3, "--config", config, "--workers", 1, "--out", out / "more"
    )
    for path in sorted(out.rglob("*")):
        if path.suffix in _READERS:
            yield str(path.relative_to(out)), _READERS[path.suffix](path.read_bytes())


def _sweep(out: Path) -> Iterator[tuple[str, str]]:
    out.mkdir()
    (out / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    _evonav("sweep", out / "sweep.toml", "--workers", 2, "--out", out / "sweep")
    yield "summary.json", _of_json(json.loads((out / "sweep/summary.json").read_bytes()))
    for run in sorted((out / "sweep/runs").iterdir()):
        for key, digest in _run(run):
            yield f"{run.name}/{key}", digest


def _perception(out: Path) -> Iterator[tuple[str, str]]:
    _evonav("perception", "--perception", "gt", "--perception", "noisy:poor", "--limit", 2, "--out", out)
    yield "summary.json", _of_json(json.loads((out / "summary.json").read_bytes()))
    for path in sorted(out.glob("records/*/*.json.gz")):
        yield f"{path.parent.name.split('-')[0]}/{path.name}", _READERS[".gz"](path.read_bytes())


def _gym(_: Path) -> Iterator[tuple[str, str]]:
    env = gymnasium.make("evonav.gym:evonav/LifelongNav-v0", width_px=64, height_px=64)
    observation, _info = env.reset(seed=0)
    actions, hashes = np.random.default_rng(0), {key: hashlib.sha256() for key in (*observation, "reward", "result")}
    for step in range(400):
        action = 3 if step % 90 == 89 else int(actions.choice(3, p=[0.6, 0.2, 0.2]))
        observation, reward, is_over, _, info = env.step(action)
        outcome = {**observation, "reward": reward, "result": json.dumps(info.get("stage_result"), sort_keys=True)}
        for key, value in outcome.items():
            hashes[key].update(value.encode() if isinstance(value, str) else np.asarray(value).tobytes())
        if is_over:
            env.reset()
    env.close()
    for key, found in hashes.items():
        yield key, found.hexdigest()[:16]


def _run(out: Path) -> Iterator[tuple[str, str]]:
    with sqlite3.connect(out / "records.sqlite") as db:
        for agent, task, stage, record in db.execute("SELECT agent, task_id, stage, record FROM stages"):
            yield f"record/{agent}/{task}/{stage}", _of_bytes(record.encode())
            yield f"decisions/{agent}/{task}/{stage}", _of_json(_decisions(json.loads(record)))
        for task, stage, text in db.execute("SELECT task_id, stage, floor_plan FROM floor_plans"):
            yield f"map/{task}/{stage}", _of_json(json.loads(text))
        for agent, task, stage, text in db.execute("SELECT agent, task_id, stage, metrics FROM metrics"):
            yield f"metrics/{agent}/{task}/{stage}", _of_json(json.loads(text))
    yield "summary.json", _of_json(json.loads((out / "summary.json").read_bytes()))


def _decisions(record: dict[str, Any]) -> list[Any]:
    """Actions, poses and scores of a stage: no change of a file's format may change them."""
    rounds = [
        [
            *(answer["pose"][name] for name in ("x_m", "y_m", "z_m", "yaw_rad", "horizon_rad")),
            *(answer["action"].get(name) for name in ("kind", "action", "position_m", "face_m", "reason")),
            answer["path_m"],
        ]
        for answer in record["trace"]
    ]
    return [record["state"], record["spl"], record["soft_spl"], record["terminal_distance_m"], rounds]


def _evonav(*arguments: object) -> None:
    command = [sys.executable, "-m", "evonav", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")


def _of_bytes(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _of_json(value: Any) -> str:
    return _of_bytes(json.dumps(_stable(value), sort_keys=True, separators=(",", ":")).encode())


def _stable(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _stable(item) for key, item in value.items() if key not in UNSTABLE}
    return [_stable(item) for item in value] if isinstance(value, list) else value


def _of_image(content: bytes) -> str:
    return _of_bytes(np.asarray(Image.open(io.BytesIO(content))).tobytes())


_READERS: dict[str, Callable[[bytes], str]] = {
    ".json": lambda content: _of_json(json.loads(content)),
    ".gz": lambda content: _of_json(json.loads(gzip.decompress(content))),
    ".png": _of_image,
}
PARTS: dict[str, Callable[[Path], Iterator[tuple[str, str]]]] = {
    "six-agents": _six_agents,
    "imperfect": _imperfect,
    "generation": _generation,
    "sweep": _sweep,
    "perception": _perception,
    "gym": _gym,
}


def main() -> None:
    """Prints the differences, or accepts them."""
    with tempfile.TemporaryDirectory() as folder:
        found = {part: digests_of(part, Path(folder)) for part in PARTS}
    if "--write" in sys.argv[1:]:
        merged = {key: digest for digests in found.values() for key, digest in digests.items()}
        DIGESTS.write_text(json.dumps(merged, indent=0, sort_keys=True) + "\n", encoding="utf-8")
    else:
        print(*(key for part, digests in found.items() for key in differences(part, digests)), sep="\n")


if __name__ == "__main__":
    main()
