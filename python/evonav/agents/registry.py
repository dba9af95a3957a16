"""Agents by name: evonav's own, those of installed packages, and any class by its import path or file."""

import inspect
import sys
from collections.abc import Callable
from importlib.metadata import entry_points

from evonav.agents.agent import Agent
from evonav.component import import_callable
from evonav.decision.question import DecisionModel
from evonav.errors import InvalidArgumentError

ENTRY_POINT_GROUP = "evonav.agents"
"""A package adds agents by naming classes (or functions that make one) in this entry-point group."""

RULE_MARK = "@"
"""Sign between a built-in agent's name and the rule by which it forgets object entries."""

BUILT_IN: dict[str, tuple[str, str]] = {
    "fu": ("frontier_update.agent:FrontierUpdate", "Frontier-Update: rebuilds its map when it is contradicted"),
    "stage-reset": ("frontier_update.agent:StageReset", "Frontier-Update that forgets everything at each stage"),
    "ftu": ("frontier_update.fail_then_update:FailThenUpdate", "Frontier-Update that checks its target on arrival"),
    "pro": ("proactive.agent:Proactive", "Belief-Weighted Search: goes where most of its posterior is found a metre"),
    "evolving": ("rivals.evolving:Evolving", "rival: EvolvingNav's belief over sites, with soft negative evidence"),
    "dynamem": (
        "rivals.dynamem:DynaMem",
        "rival: DynaMem deletes points that depth sees through, and looks again at what it saw long ago",
    ),
    "dualmap": (
        "rivals.dualmap:DualMap",
        "rival: DualMap remembers furniture, and what lay on it, and looks there again",
    ),
    "khronos-fu": (
        "rivals.khronos:KhronosFrontierUpdate",
        "rival: Frontier-Update with Khronos' votes of rays before and after each object",
    ),
    "vlfm": ("rivals.vlfm:Vlfm", "rival: VLFM explores frontiers by a value map that each goal begins again"),
    "onemap": (
        "rivals.onemap:OneMap",
        "rival: OneMap keeps one map over goals, and checks likely places again for each",
    ),
    "3d-mem": ("three_d_mem.agent:ThreeDMem", "3D-Mem: chooses among snapshots and frontiers, forgets nothing"),
    "msgnav": ("msgnav.agent:MsgNav", "MSGNav: a scene graph with images; stops only where it says yes"),
    "unigoal": ("unigoal.agent:UniGoal", "UniGoal as released: single actions, detector, nearest frontiers"),
    "stay-still": ("baselines:StayStill", "baseline: stops at once; its successes are free"),
    "random-walk": ("baselines:RandomWalk", "baseline: walks in random directions"),
}
"""Import path in `evonav.agents` and description of each built-in agent, by name."""

_REGISTERED: dict[str, Callable[..., Agent]] = {}
"""Agents of this process that other processes cannot import, by name."""


def register(name: str, factory: Callable[..., Agent]) -> None:
    """Let `agent_factory` find a class or function by a name, in this process.

    Raises:
        InvalidArgumentError: The name is a built-in agent's.
    """
    if name in BUILT_IN:
        raise InvalidArgumentError(f"a built-in agent is called `{name}`: give the class another name")
    _REGISTERED[name] = factory


def import_name(factory: Callable[..., Agent]) -> str | None:
    """Return `package.module:Class` if other processes can import a class or function by it, else `None`."""
    module, name = getattr(factory, "__module__", None), getattr(factory, "__qualname__", "")
    found = sys.modules.get(module or "")
    if found is None or module == "__main__" or getattr(found, "__file__", None) is None:
        return None
    return f"{module}:{name}" if getattr(found, name, None) is factory else None


def agent_factory(name: str) -> Callable[..., Agent]:
    """Return the class or function that makes an agent.

    Args:
        name: A built-in or registered name, an entry point of the group `evonav.agents`, `package.module:Class`, or
            `path/to/file.py:Class`; a built-in agent with object entries may have a forgetting rule, as in `fu@bayes`.

    Raises:
        InvalidArgumentError: There is no such agent or rule, or importing it fails.
    """
    base, at, rule = name.partition(RULE_MARK)
    if at and base in BUILT_IN:
        return _forgetful(base, rule)
    if name in BUILT_IN:
        return import_callable(f"evonav.agents.{BUILT_IN[name][0]}", "agent")
    if name in _REGISTERED:
        return _REGISTERED[name]
    if ":" in name:
        return import_callable(name, "agent")
    for entry in entry_points(group=ENTRY_POINT_GROUP):  # which reads a file of every installed package
        if entry.name == name:
            return import_callable(entry.value, "agent")
    if name.endswith(".py"):
        raise InvalidArgumentError(f"agent `{name}` is a file: name the class in it, too, such as `{name}:MyAgent`")
    known = ", ".join(sorted(agent_descriptions()))
    raise InvalidArgumentError(
        f"no agent `{name}`; there are {known}, or name a class as `package.module:Class` or `./file.py:Class`"
    )


def _forgetful(name: str, rule: str) -> Callable[..., Agent]:
    """Return a function that makes a built-in agent with a forgetting rule."""
    from evonav.memory.forgetting import check_name

    check_name(rule)
    factory = agent_factory(name)
    if not hasattr(factory, "forget_by"):
        raise InvalidArgumentError(f"agent `{name}` has no object entries that rule `{rule}` could forget")

    def make(decision: DecisionModel | None = None) -> Agent:
        agent = new_agent(factory, decision)
        agent.forget_by(rule)  # type: ignore[attr-defined]  # checked above, on its class
        return agent

    return make


def new_agent(factory: Callable[..., Agent], decision: DecisionModel | None = None) -> Agent:
    """Make an agent; a factory with a parameter `decision` is given the run's model."""
    takes_decision = any(parameter.name == "decision" for parameter in _parameters(factory))
    return factory(decision=decision) if takes_decision and decision is not None else factory()


def needed_arguments(factory: Callable[..., Agent]) -> list[str]:
    """Return the arguments without which an agent cannot be made, other than `decision`."""
    named = [p for p in _parameters(factory) if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    return [p.name for p in named if p.default is p.empty and p.name != "decision"]


def _parameters(factory: Callable[..., Agent]) -> list[inspect.Parameter]:
    try:
        return list(inspect.signature(factory).parameters.values())
    except (TypeError, ValueError):  # builtins and some extension types tell nothing
        return []


def agent_descriptions() -> dict[str, str]:
    """Return the names and descriptions of built-in agents and of those of installed packages."""
    installed = {entry.name: f"plug-in: {entry.value}" for entry in entry_points(group=ENTRY_POINT_GROUP)}
    return {**installed, **{name: description for name, (_, description) in BUILT_IN.items()}}
