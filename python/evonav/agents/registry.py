"""Agents by name: evonav's own, those of installed packages, and any class by its import path or file."""

import inspect
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, cast

from evonav.agents.agent import Agent
from evonav.decision.question import DecisionModel
from evonav.errors import InvalidArgumentError

ENTRY_POINT_GROUP = "evonav.agents"
"""A package adds agents by naming classes (or functions that make one) in this entry-point group."""

BUILT_IN: dict[str, tuple[str, str]] = {
    "fu": (
        "evonav.agents.frontier_update.agent:FrontierUpdate",
        "Frontier-Update: rebuilds its map when it is contradicted",
    ),
    "stage-reset": (
        "evonav.agents.frontier_update.stage_reset:StageReset",
        "Frontier-Update that forgets everything at each stage",
    ),
    "ftu": (
        "evonav.agents.frontier_update.fail_then_update:FailThenUpdate",
        "Frontier-Update that checks its target on arrival",
    ),
    "3d-mem": (
        "evonav.agents.three_d_mem.agent:ThreeDMem",
        "3D-Mem: chooses among snapshots and frontiers, forgets nothing",
    ),
    "msgnav": ("evonav.agents.msgnav.agent:MsgNav", "MSGNav: a scene graph with images; stops only where it says yes"),
    "unigoal": (
        "evonav.agents.unigoal.agent:UniGoal",
        "UniGoal as released: single actions, detector, nearest frontiers",
    ),
    "unigoal-paper": ("evonav.agents.unigoal.agent:UniGoalAsPublished", "UniGoal as published: the graphs do match"),
    "stay-still": ("evonav.agents.stay_still:StayStill", "baseline: stops at once; its successes are free"),
    "random-walk": ("evonav.agents.random_walk:RandomWalk", "baseline: walks in random directions"),
}
"""Import path and description of each built-in agent, by name."""


def agent_factory(name: str) -> Callable[..., Agent]:
    """Return the class or function that makes an agent.

    Args:
        name: A built-in name, an entry point of the group `evonav.agents`, `package.module:Class`, or
            `path/to/file.py:Class`.

    Raises:
        InvalidArgumentError: There is no such agent, or importing it fails.
    """
    if name in BUILT_IN:
        return imported(BUILT_IN[name][0])
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        if entry.name == name:
            return imported(entry.value)
    if ":" in name:
        return imported(name)
    if name.endswith(".py"):
        raise InvalidArgumentError(f"agent `{name}` is a file: name the class in it, too, such as `{name}:MyAgent`")
    known = ", ".join(sorted(agent_descriptions()))
    raise InvalidArgumentError(
        f"no agent `{name}`; there are {known}, or name a class as `package.module:Class` or `./file.py:Class`"
    )


def new_agent(factory: Callable[..., Agent], decision: DecisionModel | None = None) -> Agent:
    """Make an agent; a factory with a parameter `decision` is given the run's model."""
    try:
        takes_decision = "decision" in inspect.signature(factory).parameters
    except (TypeError, ValueError):  # builtins and some extension types tell nothing
        takes_decision = False
    options: dict[str, Any] = {"decision": decision} if takes_decision and decision is not None else {}
    return factory(**options)


def agent_descriptions() -> dict[str, str]:
    """Return the names and descriptions of built-in agents and of those of installed packages."""
    installed = {entry.name: f"plug-in: {entry.value}" for entry in entry_points(group=ENTRY_POINT_GROUP)}
    return {**installed, **{name: description for name, (_, description) in BUILT_IN.items()}}


def imported(path: str, what: str = "agent") -> Callable[..., Any]:
    """Return the callable at `package.module:name`, or at `path/to/file.py:name`.

    Args:
        path: Import path or file, with a name.
        what: The noun for it in error messages.

    Raises:
        InvalidArgumentError: It cannot be imported, or is not callable.
    """
    module, _, attribute = path.rpartition(":")
    try:
        found = getattr(_file_module(module) if module.endswith(".py") else import_module(module), attribute)
    except Exception as error:  # importing runs a stranger's code: whatever it raises belongs to the name
        raise InvalidArgumentError(f"{what} `{path}` cannot be imported: {type(error).__name__}: {error}") from error
    if not callable(found):
        raise InvalidArgumentError(f"{what} `{path}` is not callable: name a class or a function that makes one")
    return cast("Callable[..., Any]", found)


def _file_module(path: str) -> ModuleType:
    """Load a Python file as a module by its own name, once; the module may import its neighbours."""
    file = Path(path).resolve()
    there = sys.modules.get(file.stem)
    if there is not None and getattr(there, "__file__", None) == str(file):
        return there
    if there is not None:
        raise ImportError(f"a module `{file.stem}` is there already: give the file another name")
    spec = spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None or not file.is_file():
        raise FileNotFoundError(f"no file {path}")
    module = module_from_spec(spec)
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))
    sys.modules[file.stem] = module  # before it runs, as import does: dataclasses look there
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[file.stem]
        raise
    return module
