"""Find the function of an action by name, and answer wrong arguments as AI2-THOR does.

AI2-THOR matches an action to a method by the names of its parameters. It answers mistakes with an error code, which its
client turns into a `ValueError`. `call` does the same.
"""

import importlib
import inspect
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from types import MappingProxyType
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, PydanticUserError, TypeAdapter, ValidationError

# The functions of these modules register themselves.
_MODULES = (
    *("session", "motion", "teleport", "paths", "spawn"),
    *("object_queries", "interactable_poses", "object_placement", "object_states", "cameras"),
)

# Keys that any action may contain (`DynamicServerAction.AllowedExtraneousParameters`) or that the client may add.
_COMMON = frozenset(
    {
        *("action", "sequenceId", "agentId", "renderImage", "renderObjectImage", "renderClassImage"),
        *("renderNormalsImage", "renderInstanceSegmentation", "renderSemanticSegmentation"),
        *("physicsSimulationParams", "visibilityDistance"),
    }
)
_ENVELOPE = frozenset({"action", "sequenceId", "agentId", "renderImage"})
# Maximal number of characters of a value in a message.
_BRIEF = 200

Function = TypeVar("Function", bound=Callable[..., object])


class ErrorCode(str, Enum):
    """AI2-THOR's `errorCode`; its client raises `ValueError` for all but `NONE`."""

    NONE = ""
    INVALID_ACTION = "InvalidAction"
    MISSING_ARGUMENTS = "MissingArguments"
    AMBIGUOUS_ACTION = "AmbiguousAction"
    INVALID_ARGUMENT = "InvalidArgument"
    LOOK_DOWN_CANT_EXCEED_MIN = "LookDownCantExceedMin"
    """The client raises nothing for this one."""


class ActionError(Exception):
    """A failed action: `lastActionSuccess` is false and `errorMessage` is this message."""

    def __init__(self, message: str, code: ErrorCode = ErrorCode.NONE) -> None:
        super().__init__(message)
        self.code = code


class Vector3(BaseModel):
    """Unity's vector on the wire; an absent component is 0, as the client's scalar rotations need."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass(slots=True)
class _Action:
    function: Callable[..., object]
    is_open: bool
    """Whether the function takes any other keyword too."""
    required: tuple[str, ...]
    types: dict[str, Any]
    """Types of the parameters, by name."""
    unused: frozenset[str]
    """Names in `types` that are not passed to the function."""
    adapters: dict[str, TypeAdapter[Any]] = field(default_factory=dict)
    """Validators of `types`, made on first use: making one takes longer than most actions."""

    @property
    def signature(self) -> str:
        """The signature in the form of AI2-THOR's messages."""
        used = [_shown(parameter) for parameter in list(inspect.signature(self.function).parameters.values())[1:]]
        return ", ".join(used + [f"{_type_name(self.types[name])} {name}" for name in sorted(self.unused)])


_ACTIONS: dict[str, _Action] = {}


def action(*names: str, unused: Mapping[str, type] = MappingProxyType({})) -> Callable[[Function], Function]:
    """Register `function(engine, *, parameters as on the wire) -> actionReturn` under AI2-THOR's names for it.

    Args:
        names: Names of the action.
        unused: Types of AI2-THOR's parameters that have no effect here, by name.
    """

    def register(function: Function) -> Function:
        parameters = list(inspect.signature(function, eval_str=True).parameters.values())[1:]
        named = [p for p in parameters if p.kind is not p.VAR_KEYWORD]
        required = tuple(p.name for p in named if p.default is p.empty)
        types = {p.name: p.annotation for p in named} | dict(unused)
        for name in names:
            if name in _ACTIONS:
                raise ValueError(f"{name} is registered twice")
            _ACTIONS[name] = _Action(function, named != parameters, required, types, frozenset(unused))
        return function

    return register


def action_names() -> tuple[str, ...]:
    """Return the names of all actions, sorted."""
    return tuple(sorted(_served()))


def parameter_types(name: str) -> Mapping[str, Any]:
    """Return the types of an action's parameters, by name."""
    return MappingProxyType(_served()[name].types)


def call(engine: object, message: Mapping[str, Any]) -> object:
    """Execute an action.

    Args:
        engine: The engine that executes it.
        message: The action as the client sent it.

    Returns:
        The action's `actionReturn`.

    Raises:
        ActionError: The action failed; the error has a code if the request itself was wrong.
    """
    name = message.get("action")
    found = _served().get(name) if isinstance(name, str) else None
    if found is None:
        problem = message.get("problem") if name is None else None
        raise ActionError(str(problem or f"Invalid action: {brief(name)}"), ErrorCode.INVALID_ACTION)
    common = _ENVELOPE if found.is_open else _COMMON  # an open action may read what Initialize also sets
    arguments = {key: value for key, value in message.items() if key in found.types or key not in common}
    unknown = [key for key in arguments if key not in found.types and not (found.is_open and key != "engine")]
    if unknown:
        raise ActionError(_invalid(str(name), found, unknown, list(arguments)), ErrorCode.INVALID_ARGUMENT)
    values = {key: _converted(str(name), found, key, value) for key, value in arguments.items()}
    missing = [key for key in found.required if key not in arguments]
    if missing:
        message_ = f"action: {name} is missing the following arguments: {','.join(missing)}"
        raise ActionError(message_, ErrorCode.MISSING_ARGUMENTS)
    return found.function(engine, **{key: value for key, value in values.items() if key not in found.unused})


@cache
def _served() -> dict[str, _Action]:
    for module in _MODULES:
        importlib.import_module(f"evonav.thor.actions.{module}")
    return _ACTIONS


def _converted(name: str, found: _Action, key: str, value: object) -> object:
    if key not in found.types:
        return value
    adapter = found.adapters.get(key)
    if adapter is None:
        adapter = found.adapters[key] = _adapter(found.types[key])
    try:
        return adapter.validate_python(value)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        place = "".join(f".{part}" for part in first["loc"])
        message = (
            f"action: {name} has an invalid argument: {key} (=={brief(value)})."
            f" Cannot convert to: {_type_name(found.types[key])}{place and f' ({place[1:]})'}: {first['msg']}"
        )
        raise ActionError(message, ErrorCode.INVALID_ARGUMENT) from error


def _adapter(annotation: Any) -> TypeAdapter[Any]:  # noqa: ANN401
    try:
        return TypeAdapter(annotation, config=ConfigDict(allow_inf_nan=False))
    except PydanticUserError:
        # A model has a configuration of its own.
        return TypeAdapter(annotation)


def _invalid(name: str, found: _Action, unknown: list[str], given: list[str]) -> str:
    """Return AI2-THOR's message for invalid arguments, which its users search for."""
    quoted = [", ".join(f"'{brief(key)}'" for key in keys[:20]) for keys in (unknown, given)]
    return (
        f'\n\tAction: "{name}" called with invalid argument{"s" if len(unknown) > 1 else ""}: {quoted[0]}'
        f"\n\tExpected arguments: {found.signature}"
        f"\n\tYour arguments: {quoted[1]}"
        f'\n\tValid ways to call "{name}" action:\n\t\t{name}({found.signature})'
    )


def _shown(parameter: inspect.Parameter) -> str:
    default = "" if parameter.default is parameter.empty else f" = {parameter.default}"
    return f"{_type_name(parameter.annotation)} {parameter.name}{default}"


def _type_name(annotation: object) -> str:
    return annotation.__name__ if isinstance(annotation, type) else str(annotation).rpartition(".")[2]


def brief(value: object) -> str:
    """Abbreviate a value for a message, to about two hundred characters."""
    return value[:_BRIEF] if isinstance(value, str) else reprlib.repr(value)
