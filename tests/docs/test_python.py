"""Python in the documentation runs, and agents of the tutorial do what it says."""

import ast
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from build_docs import ROOT, pages
from doc_blocks import python_texts

import evonav
from evonav.agents.agent import NavigateTo, Stop
from evonav.sensors.observation import Detections, MapFrame, Observation, View, VisibleOccupancy
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics


@pytest.mark.parametrize("page", [page for page in pages() if python_texts(page)], ids=str)
def test_python_of_a_page_runs(page: Path, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    texts = python_texts(page)
    if any("ai2thor" in text for text in texts):
        pytest.importorskip("ai2thor")
    namespace: dict[str, Any] = {"__name__": "__main__"}
    try:
        for text in texts:
            exec(compile(text, str(page), "exec", dont_inherit=True), namespace)
    finally:
        for value in namespace.values():
            if type(value).__name__ == "Controller":
                value.stop()
    states = [state for run in namespace.values() if isinstance(run, evonav.Run) for state in run.stages["state"]]
    assert set(states) <= {"success", "failure"}


def test_cells_of_the_notebook_run_and_show_something(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((ROOT / "docs/notebooks/first_steps.ipynb").read_text(encoding="utf-8"))
    assert all(cell.get("outputs", []) == [] for cell in notebook["cells"]), "outputs are stripped"
    namespace: dict[str, Any] = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            *statements, last = ast.parse("".join(cell["source"])).body
            exec(compile(ast.Module(statements, []), "cell", "exec"), namespace)
            if isinstance(last, ast.Expr):
                assert eval(compile(ast.Expression(last.value), "cell", "eval"), namespace) is not None
            else:
                exec(compile(ast.Module([last], []), "cell", "exec"), namespace)
    assert set(namespace["run"].stages["state"]) <= {"success", "failure"}


def test_no_script_of_a_page_guards_against_being_imported_by_workers() -> None:
    """Workers do not import the script: tests/evaluation/run/test_nothing_lost.py runs one without a guard."""
    guarded = [str(page) for page in pages() for text in python_texts(page) if "__main__" in text]
    assert guarded == []


@pytest.fixture(scope="module")
def tutorial() -> dict[str, Any]:
    """The names that the tutorial defines, without its evaluation."""
    namespace: dict[str, Any] = {}
    for text in python_texts(Path("docs/tutorial-agent.md")):
        if "evonav.evaluate" not in text:
            exec(compile(text, "tutorial-agent.md", "exec", dont_inherit=True), namespace)
    return namespace


@pytest.mark.parametrize(
    ("name", "seen_again", "stops"),
    [
        ("Believer", False, True),
        ("Looker", True, True),
        ("Looker", False, False),
        ("Checker", True, True),
        ("Checker", False, False),
    ],
)
def test_an_agent_of_the_tutorial_stops_at_a_remembered_object(
    name: str, seen_again: bool, stops: bool, tutorial: dict[str, Any]
) -> None:
    agent = tutorial[name]()
    agent.begin_task(TaskInfo("a-task", 2, 50, MapFrame(40, 60, 0.1, (-3.0, -1.0)), 0))
    goal = "Please find the mug."
    for stage in (1, 2):
        agent.begin_stage(Goal(stage, "Mug", goal, goal, goal, np.zeros((8, 8, 3), np.uint8)))
        target = agent.act(observation_of(*["Mug"] * (stage == 1)))
        assert isinstance(target, NavigateTo)
        assert math.dist(target.position_m, (0.0, 2.0)) < 0.2
    assert agent.act(observation_of()) == target, "still on its way"
    answer = agent.act(observation_of(*["Mug"] * seen_again, has_arrived=True))
    assert isinstance(answer, Stop) == (stops or (not agent.objects.entries and not agent.map.frontiers))
    assert len(agent.objects.entries) == stops


def observation_of(*labels: str, has_arrived: bool = False) -> Observation:
    """One view of a plate 2 m ahead, which is detected once for each label."""
    depth_m = np.full((60, 60), np.inf, np.float32)
    masks = np.full((60, 60), -1, np.int32)
    for index, _ in enumerate(labels):
        depth_m[20:40, 20:40], masks[20:40, 20:40] = 2.0, index
    detections = Detections(masks, labels, np.ones(len(labels), np.float32))
    cells = VisibleOccupancy(np.array([[10, 30]], np.int32), np.zeros((0, 2), np.int32))
    view = View(Pose(0.0, 1.575, 0.0, 0.0, 0.0), Intrinsics(60, 60, math.pi / 2), depth_m, detections, cells)
    pose = Pose(0.0, 0.9, 0.0, 0.0)
    return Observation((view,), pose, is_action_success=True, num_rounds_left=9, has_arrived=has_arrived)
