"""The examples work: an agent by its file, and one of an installed package."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

EXAMPLES = Path(__file__).parents[2] / "examples"
OWN = "./examples/own_agent.py:OwnAgent"


def evonav(*arguments, **variables):
    return subprocess.run(
        [sys.executable, "-m", "evonav", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=EXAMPLES.parent,
        env={**os.environ, "COLUMNS": "200", **variables},
    )


def results(run_dir):
    return json.loads((run_dir / "summary.json").read_text())["agents"]


def code_lines(path):
    """Lines that are no docstring, comment or blank."""
    text = path.read_text()
    told = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node):
            told |= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    lines = enumerate(text.splitlines(), start=1)
    return [line for number, line in lines if number not in told and line.strip() and not line.strip().startswith("#")]


def test_the_example_is_short_and_keeps_the_contract():
    assert len(code_lines(EXAMPLES / "own_agent.py")) <= 30
    done = evonav("check-agent", OWN)
    assert done.returncode == 0, done.stdout
    assert "│ fail │" not in done.stdout


@pytest.mark.slow
def test_the_example_is_better_than_chance(tmp_path):
    done = evonav("evaluate", "--agent", OWN, "--agent", "random-walk", "--limit", 6, "--workers", 2, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    found = results(tmp_path)
    assert not found[OWN]["is_incomplete"]
    assert found[OWN]["sr"] > found["random-walk"]["sr"] + 0.1


def install(folder, name, site):
    """Lay a package down as an installer leaves it: its modules, and its entry points beside them."""
    project = tomllib.loads((EXAMPLES / folder / "pyproject.toml").read_text())
    (where,) = project["tool"]["setuptools"]["packages"]["find"]["where"]
    (site / name).symlink_to(EXAMPLES / folder / where / name)
    facts = project["project"]
    info = site / f"{name}-{facts['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {facts['name']}\nVersion: {facts['version']}\n")
    lines = []
    for group, entries in facts["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    return site


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    return install("agent_package", "asking_agent", tmp_path_factory.mktemp("site"))


def test_variants_and_ablations_are_a_plug_in(tmp_path_factory, tmp_path):
    """All of its names can be made, and one is run by its name, also in a process of its own."""
    site = install("studies", "evonav_studies", tmp_path_factory.mktemp("studies"))
    code = """
from importlib.metadata import entry_points
from evonav.agents.registry import BUILT_IN, agent_factory, new_agent
found = [one.name for one in entry_points(group="evonav.agents") if one.dist.name == "evonav-studies"]
assert not set(found) & set(BUILT_IN)
print(*(f"{name}={type(new_agent(agent_factory(name))).__name__}" for name in found))
"""
    variables = {**os.environ, "PYTHONPATH": str(site)}
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=variables)
    agents = dict(pair.split("=") for pair in made.stdout.split())
    assert len(agents) == 20
    assert agents["3d-mem+"] == "ThreeDMem"
    assert agents["pro-without-rooms"] == "Proactive"
    listed = evonav("agents", PYTHONPATH=str(site)).stdout
    assert "plug-in: evonav_studies.relook:FailThenUpdateRelook" in listed
    options = ("--limit", 1, "--workers", 1, "--out", tmp_path)
    done = evonav("evaluate", "--agent", "ftu-early-stop", *options, PYTHONPATH=str(site))
    assert done.returncode == 0, done.stdout + done.stderr
    assert not results(tmp_path)["ftu-early-stop"]["is_incomplete"]


@pytest.mark.slow
def test_an_agent_of_a_package_has_a_name(installed):
    listed = evonav("agents", PYTHONPATH=str(installed)).stdout
    assert "plug-in: asking_agent.agent:AskingAgent" in listed
    done = evonav("check-agent", "asking", PYTHONPATH=str(installed))
    assert done.returncode == 0, done.stdout


MODEL = """
class Contrary:
    '''Answers with what is no number the first time, and then with the first object.'''

    def __init__(self):
        self.num_asked = 0

    def ask(self, prompt):
        assert "Which one is meant?" in prompt.text
        self.num_asked += 1
        return "I cannot say" if self.num_asked == 1 else "1"
"""


@pytest.mark.slow
def test_its_questions_reach_a_model_of_ones_own(installed, tmp_path):
    (tmp_path / "contrary_model.py").write_text(MODEL)
    path = f"{installed}{os.pathsep}{tmp_path}"
    options = ("--decision", "contrary_model:Contrary", "--limit", 1, "--workers", 1, "--out", tmp_path / "run")
    done = evonav("evaluate", "--agent", "asking", *options, PYTHONPATH=path)
    assert done.returncode == 0, done.stdout + done.stderr
    from evonav.evaluation.records.store import RunStore

    with RunStore(tmp_path / "run") as store:
        last = list(store.records("asking"))[-1].trace[-1].counters
    assert last["invalid_answers"] >= 1
    assert last["decisions"] > last["invalid_answers"]
    assert "failed_decisions" not in last
