"""Actions by name: which function does them, and what a wrong argument gets.

AI2-THOR matches an action to a method by the names of its parameters and answers mistakes with an error code, which its
client turns into a `ValueError`. So does `call`.
"""

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, validate_call

# Whose functions register themselves.
_MODULES = ("engine", "motion", "teleport", "paths")

# What the client or AI2-THOR's own dispatcher adds to any action.
_COMMON = frozenset({"action", "sequenceId", "agentId", "renderImage", "physicsSimulationParams", "visibilityDistance"})

Function = TypeVar("Function", bound=Callable[..., object])


class ErrorCode(str, Enum):
    """AI2-THOR's `errorCode`; its client raises `ValueError` for all but `NONE`."""

    NONE = ""
    INVALID_ACTION = "InvalidAction"
    MISSING_ARGUMENTS = "MissingArguments"
    AMBIGUOUS_ACTION = "AmbiguousAction"
    INVALID_ARGUMENT = "InvalidArgument"
    LOOK_DOWN_CANT_EXCEED_MIN = "LookDownCantExceedMin"
    """The client does not raise for this one."""


class ActionError(Exception):
    """An action failed: `lastActionSuccess` is false and `errorMessage` is this message."""

    def __init__(self, message: str, code: ErrorCode = ErrorCode.NONE) -> None:
        super().__init__(message)
        self.code = code


class Vector3(BaseModel):
    """Unity's vector on the wire; what is left out is 0, as the client's scalar rotations need."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass(slots=True)
class _Action:
    function: Callable[..., object]
    names: frozenset[str]
    """Of parameters."""
    required: tuple[str, ...]
    is_open: bool
    """Takes any other keyword too."""
    validated: Callable[..., object] | None = field(default=None)


_ACTIONS: dict[str, _Action] = {}


def action(*names: str) -> Callable[[Function], Function]:
    """Registers `function(engine, *, parameters as on the wire) -> actionReturn` under AI2-THOR's names for it."""

    def register(function: Function) -> Function:
        parameters = list(inspect.signature(function).parameters.values())[1:]
        named = [p for p in parameters if p.kind is not p.VAR_KEYWORD]
        required = tuple(p.name for p in named if p.default is p.empty)
        for name in names:
            _ACTIONS[name] = _Action(function, frozenset(p.name for p in named), required, named != parameters)
        return function

    return register


def action_names() -> tuple[str, ...]:
    """All that are served, sorted."""
    return tuple(sorted(_served()))


def call(engine: object, message: Mapping[str, Any]) -> object:
    """Does an action.

    Args:
        engine: What it acts on.
        message: The action as the client sent it.

    Returns:
        Its `actionReturn`.

    Raises:
        ActionError: It failed; with a code where the request itself was wrong.
    """
    name = message.get("action")
    found = _served().get(name) if isinstance(name, str) else None
    if found is None:
        raise ActionError(f"{name} is not an action of this engine", ErrorCode.INVALID_ACTION)
    arguments = {key: value for key, value in message.items() if key in found.names or key not in _COMMON}
    missing = [key for key in found.required if key not in arguments]
    if missing:
        raise ActionError(f"{name} misses arguments: {', '.join(missing)}", ErrorCode.MISSING_ARGUMENTS)
    unknown = sorted(set(arguments) - found.names)
    if unknown and not found.is_open:
        raise ActionError(f"{name} has no arguments {', '.join(unknown)}", ErrorCode.INVALID_ARGUMENT)
    if found.validated is None:
        config = ConfigDict(arbitrary_types_allowed=True, allow_inf_nan=False)
        found.validated = validate_call(config=config)(found.function)
    try:
        return found.validated(engine, **arguments)
    except ValidationError as error:
        raise ActionError(f"{name}: {_summary(error)}", ErrorCode.INVALID_ARGUMENT) from error


@cache
def _served() -> dict[str, _Action]:
    for module in _MODULES:
        importlib.import_module(f"evonav.thor.{module}")
    return _ACTIONS


def _summary(error: ValidationError) -> str:
    return "; ".join(
        f"{'.'.join(str(part) for part in item['loc'])} = {item['input']!r}: {item['msg']}" for item in error.errors()
    )
