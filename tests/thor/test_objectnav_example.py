"""`examples/objectnav_ai2thor.py`, written for AI2-THOR, runs on the engine without knowing."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import evonav.thor
from evonav.house import bundled_houses

SCRIPT = Path(__file__).parents[2] / "examples" / "objectnav_ai2thor.py"


def run(houses: Path, home: Path, *options: str) -> list[dict]:
    command = [sys.executable, str(SCRIPT), str(houses), "--executable", evonav.thor.executable(), *options]
    # As it is: the client's start-up does not let pass what the environment of the tests would turn into errors.
    done = subprocess.run(command, env={"HOME": str(home), "PATH": ""}, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture
def houses(tmp_path) -> Path:
    documents = sorted((house.to_json() for house in bundled_houses(20)), key=len)[2:4]
    path = tmp_path / "houses.jsonl"
    path.write_text("\n".join(documents))
    return path


def test_the_guard_imports_nothing_of_evonav() -> None:
    tree = ast.parse(SCRIPT.read_text())
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.partition(".")[0] for name in imported} - set(sys.stdlib_module_names) == {"ai2thor", "numpy"}


def test_the_expert_finds_its_object(houses, tmp_path) -> None:
    *episodes, summary = run(houses, tmp_path, "--episodes", "3")
    assert len(episodes) == summary["episodes"] == 3
    for episode in episodes:
        assert episode["success"], episode
        assert episode["failed_actions"] == 0
        assert 0 < episode["spl"] <= 1
        # The shortest path may cut corners that steps of 25 cm along the grid do not.
        assert episode["path_length"] >= episode["shortest_path_length"] - 0.5
        seen = episode["sight"]
        left, top, right, bottom = seen["box"]
        assert 0 < seen["pixels"] <= (right - left + 1) * (bottom - top + 1)
        assert seen["pixels"] <= seen["pixels_of_type"]
        assert 0.1 <= seen["depth"] <= seen["distance"] + 1.0
    assert summary["success_rate"] == 1.0
    assert summary["spl"] == pytest.approx(sum(episode["spl"] for episode in episodes) / 3)


def test_the_shortest_path_can_be_followed_as_returned(houses, tmp_path) -> None:
    *episodes, summary = run(houses, tmp_path, "--agent", "path", "--episodes", "3", "--seed", "1")
    assert len(episodes) == 3
    for episode in episodes:
        assert episode["success"], episode
        assert episode["failed_actions"] == 0
        assert episode["spl"] == pytest.approx(1.0, abs=1e-3)
        assert episode["path_length"] <= episode["shortest_path_length"] + 1e-3
    assert summary["spl"] == pytest.approx(1.0, abs=1e-3)


def test_runs_repeat(houses, tmp_path) -> None:
    options = ("--agent", "random", "--episodes", "1", "--seed", "3")
    assert run(houses, tmp_path, *options) == run(houses, tmp_path, *options)
