"""Find the names of agents that are given as names, classes or functions."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from evonav.agents.registry import import_name, needed_arguments, new_agent, register
from evonav.errors import InvalidArgumentError
from evonav.evaluation.run.components import check_agent_names


@dataclass(frozen=True, slots=True)
class NamedAgents:
    """Agents by the names that a run records."""

    names: tuple[str, ...]
    local: tuple[str, ...]
    """Those that other processes cannot import: classes of a notebook or of the running script, lambdas."""


def named_agents(agents: Iterable[Any]) -> NamedAgents:
    """Return the names of agents, and register those that cannot be imported.

    Args:
        agents: Names, classes, functions that make an agent, and lists of these.

    Raises:
        InvalidArgumentError: One is none of these or unknown, or two have the same name.
    """
    names: list[str] = []
    local: list[str] = []
    for agent in _flat(agents):
        if isinstance(agent, str):
            check_agent_names([agent])
            names.append(agent)
            continue
        _check(agent)
        name = import_name(agent)
        if name is None:
            name = _local_name(agent)
            if name in names:
                raise InvalidArgumentError(f"two agents are called `{name}`: give one of the classes another name")
            register(name, agent)
            local.append(name)
        names.append(name)
    if not names:
        raise InvalidArgumentError("no agent to evaluate: give names or classes, such as `evaluate(MyAgent, 'fu')`")
    return NamedAgents(tuple(names), tuple(local))


def _flat(agents: Iterable[Any]) -> Iterable[Any]:
    for agent in agents:
        if isinstance(agent, list | tuple):
            yield from _flat(agent)
        else:
            yield agent


def _check(agent: Any) -> None:  # noqa: ANN401 - whatever was given
    """Reject what is no class or function that makes an agent without arguments."""
    if isinstance(agent, type):
        if not hasattr(agent, "act"):
            raise InvalidArgumentError(f"`{agent.__name__}` is no agent: the class has no method `act`")
    elif hasattr(agent, "act"):
        name = type(agent).__name__
        raise InvalidArgumentError(
            f"an object of `{name}` was given: give the class, `{name}`, or a function that makes one, "
            "since every episode has a fresh agent"
        )
    elif not callable(agent):
        raise InvalidArgumentError(f"{agent!r} is no agent: give a name, a class, or a function that makes one")
    needed = needed_arguments(agent)
    if needed:
        name = getattr(agent, "__name__", "the agent")
        raise InvalidArgumentError(
            f"`{name}` needs the argument `{needed[0]}`: give a function that makes one, "
            f"such as `lambda: {name}({needed[0]}=...)`"
        )


def _local_name(agent: Callable[..., Any]) -> str:
    """Return the name of a class or function; that of the agents it makes, if it has none of its own."""
    name = getattr(agent, "__name__", "<none>")
    return name if name.isidentifier() else type(new_agent(agent)).__name__
