"""Every block of code in the documentation: Python is run, commands are run where they can be and parsed where not."""

import ast
import gzip
import json
import math
import re
import shlex
import shutil
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import short_stages
import typer
from build_docs import ROOT, links, pages
from typer.testing import CliRunner

import evonav
from evonav.agents.agent import NavigateTo, Stop
from evonav.cli import app
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import check_agent_names
from evonav.evaluation.run.evaluate import evaluate
from evonav.house import bundled_houses
from evonav.sensors.observation import Detections, MapFrame, Observation, View, VisibleOccupancy
from evonav.tasks.listing import BUNDLED_TASKS, task_files
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

BLOCK = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.DOTALL | re.MULTILINE)
PARSED_ONLY = {
    "evonav bench": "minutes: tests/cli/test_bench_memory.py and tests/speed_benchmark run these commands, smaller",
    "evonav demo": "what `make demo` does; tests/e2e",
    "evonav doctor": "depends on the machine; tests of its own",
    "evonav houses fetch": "network",
    "evonav sweep": "minutes: tests/sweeps/test_sweep.py runs these files, smaller",
    "--houses procthor-10k": "needs what the network brings",
    "evonav-10k": "minutes: tests/house/test_evonav10k.py makes smaller sets",
    "test-90": "needs a whole dataset",
    "--simulator ai2thor": "AI2-THOR: tests/world, tests/thor",
    "--decision vlm": "a model: tests/decision, with a stand-in",
    "evonav tasks write": "a model: tests/decision, with a stand-in",
    "--perception predicted": "weights: tests/models",
    "python -m evonav.decision.vlm.mock_server": "serves until it is stopped: tests/decision",
    "my_package": "a package that is not there",
    "--open": "opens a browser",
    "--assets": "a file of sizes that is not here: tests/house",
    "delay=": "waits",
    "--isolation sandbox": "needs workers, and Linux: tests/agents",
}
"""Commands with these words are not run here, only parsed."""
STUDIES = Path("docs/studies")
"""Pages for researchers, linked from their own list."""
LIMITED = ("evaluate", "tasks generate", "perception")
"""Commands that get one task, one or two agents and this process: the words are tested, not the machine."""


@pytest.fixture(scope="module", autouse=True)
def few_rounds() -> Iterator[None]:
    """Stages end after a few rounds here."""
    paper = ProtocolConfig.__init__.__defaults__
    ProtocolConfig.__init__.__defaults__ = short_stages.defaults_of_the_protocol()
    yield
    ProtocolConfig.__init__.__defaults__ = paper


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    yield from BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))


def command_lines(page: Path) -> list[str]:
    found = []
    for language, text in blocks(page):
        if language not in ("", "bash", "console", "sh"):
            continue
        has_prompt = any(line.startswith("$ ") for line in text.splitlines())
        for raw in text.splitlines():
            if has_prompt and not raw.startswith("$ "):
                continue  # what a command prints
            line = re.split(r"\s+#\s", raw.removeprefix("$ "))[0].strip()
            if re.match(r"(evonav|make|pip|python|export|PYTHONPATH|\.venv)", line):
                found.append(line)
    return found


def python_texts(page: Path) -> list[str]:
    return [text for language, text in blocks(page) if language == "python"]


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory, few_rounds: None) -> Path:
    """A folder with what commands of the documentation take: houses, tasks, a run."""
    folder = tmp_path_factory.mktemp("docs")
    houses = [house.to_json() for house in sorted(bundled_houses(), key=lambda house: len(house.rooms))[:2]]
    for name in ("houses.jsonl.gz", "uniform-hard-val-75.jsonl.gz"):
        (folder / name).write_bytes(gzip.compress("\n".join(houses).encode()))
    tasks = folder / "tasks"
    task = min(task_files(BUNDLED_TASKS), key=lambda task: task.num_stages)
    shutil.copytree(task.path, tasks / task.task_id)
    evaluate(["fu", "ftu"], task_files(tasks), folder / "out" / "run", num_workers=0)
    return folder


@pytest.fixture
def place(template: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the template to work in."""
    shutil.copytree(template, tmp_path / "here")
    here = tmp_path / "here"
    for name in ("demo", "first", "six", "paper"):
        shutil.copytree(template / "out" / "run", here / "out" / name)
    shutil.copytree(here / "tasks", here / "tasks" / "test")
    for name in ("FOLDER",):
        (here / name).symlink_to("tasks")
    (here / "RUN").symlink_to("out/run")
    for name in ("examples", "scripts"):
        (here / name).symlink_to(ROOT / name)
    monkeypatch.chdir(here)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.delitem(sys.modules, "my_agent", raising=False)  # the agent of another page
    return here


def filled(line: str, task_id: str) -> str:
    """A command with its placeholders replaced."""
    line = re.sub(r"\bTASK_ID\b|(?<=--task )ID\b", task_id, line)
    return re.sub(r"\s(\.\.\.|…)(?=\s|$)", "", line)


def parse(arguments: list[str]) -> None:
    """Has the command's parser read arguments, without running anything."""
    if "--help" in arguments:
        arguments = arguments[: arguments.index("--help")]
    command: Any = typer.main.get_command(app)
    context, rest = typer.Context(command), arguments
    while hasattr(command, "commands"):
        if command.invoke_without_command and rest[0].startswith("-"):
            command.make_context(command.name, list(rest), parent=context)
            return
        assert rest[0] in command.commands, f"no command {rest[0]}"
        _, command, rest = command.resolve_command(context, rest)  # which adds the options of its settings
        if not rest:
            return  # the help of a command
    command.make_context(command.name, list(rest), parent=context)


@pytest.mark.parametrize("page", [page for page in pages() if command_lines(page)], ids=str)
def test_commands_of_a_page_do_what_they_say(page: Path, place: Path) -> None:
    task_id = next(path.name for path in sorted((place / "tasks").iterdir()) if (path / "task.json").exists())
    write_files_of(page, place)
    for line in command_lines(page):
        run_line(filled(line, task_id), place, parses_only="studies" in page.parts)


def write_files_of(page: Path, place: Path) -> None:
    """Blocks that the page says to save."""
    texts: dict[str, str] = {}
    for language, text in blocks(page):
        if language == "python" and (found := re.match(r"# (\w+\.py)\b", text)):
            texts[found[1]] = texts.get(found[1], "") + text
        if language == "toml":
            named = re.match(r"# (\w+\.toml)\b", text)
            texts[named[1] if named else "theta.toml"] = text
    for name, text in texts.items():
        (place / name).write_text(text)


def run_line(line: str, place: Path, *, parses_only: bool) -> None:
    """Runs a command, or parses it where it takes long: commands of studies ran for hours."""
    words = shlex.split(line.removesuffix("&").strip())
    if words[0] == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert words[1] in targets, f"{line}: no such target"
    elif words[0] == "pip":
        extras = re.findall(r"evonav\[(\w+)\]", line)
        told = (ROOT / "pyproject.toml").read_text()
        assert all(re.search(rf"^{extra} = \[", told, re.MULTILINE) for extra in extras), f"{line}: no such extra"
    elif words[0].startswith(("python", ".venv")):
        script = next((word for word in words if word.endswith(".py")), None)
        assert script is None or (ROOT / script).is_file(), f"{line}: no such file"
    elif words[0] != "export":
        environment = {}
        while "=" in words[0]:
            name, _, value = words.pop(0).partition("=")
            environment[name] = value
        assert words.pop(0) == "evonav", line
        run_evonav(line, words, environment, place, parses_only=parses_only)


def run_evonav(line: str, words: list[str], environment: dict[str, str], place: Path, *, parses_only: bool) -> None:
    if parses_only or environment or any(part in line for part in PARSED_ONLY):
        parse(words)
        return
    parse(words)
    if words[0] in LIMITED or " ".join(words[:2]) in LIMITED:
        words = made_small(words, place)
    result = CliRunner().invoke(app, words)
    error = result.exception if not isinstance(result.exception, SystemExit) else None
    assert result.exit_code == 0, f"{line}: exit code {result.exit_code}: {error}\n{result.output[-2000:]}"


def made_small(words: list[str], place: Path) -> list[str]:
    options = {"--limit": "1", "--workers": "0"}
    if "--subset" in words:
        del options["--limit"]
    if words.count("--agent") == 1:
        names = words[words.index("--agent") + 1].split(",")
        check_agent_names(names)
        options["--agent"] = ",".join(names if len(names) == 1 else [names[0], names[-1]])
    elif words[0] == "evaluate" and "--agent" not in words:
        options["--agent"] = "ftu" if "--perception" in words else "fu,ftu"
    for option, value in options.items():
        if option in words:
            words[words.index(option) + 1] = value
        else:
            words = [*words, option, value]
    if "--out" in words:  # a page may use a folder's name for several examples
        shutil.rmtree(place / words[words.index("--out") + 1], ignore_errors=True)
    return words


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


@pytest.mark.parametrize("page", pages(), ids=str)
def test_links_of_a_page_lead_somewhere(page: Path) -> None:
    for words, target in links(page):
        assert (ROOT / target).exists(), f"{page}: {words}"


def test_every_page_for_users_is_in_the_menu_once() -> None:
    _, _, navigation = (ROOT / "mkdocs.yml").read_text().partition("\nnav:\n")
    listed = Counter(re.findall(r": (\S+[.]md)$", navigation, re.MULTILINE))
    assert set(listed.values()) == {1}
    menu = {Path("README.md") if name == "index.md" else Path(name) for name in listed}
    studies = {page for page in pages() if page.parent == STUDIES} - menu
    assert menu | studies == set(pages())
    assert studies <= {target for _, target in links(STUDIES / "README.md")}


def test_api_pages_name_modules_that_exist() -> None:
    import importlib

    named = [name for page in pages() for name in re.findall(r"^::: (\S+)", (ROOT / page).read_text(), re.MULTILINE)]
    assert len(named) > 20
    for name in named:
        importlib.import_module(name)


def test_bundled_json_of_pages_is_json() -> None:
    for page in pages():
        for language, text in blocks(page):
            if language == "json":
                json.loads(text)
