"""Find the function of an action by name, and answer wrong arguments as AI2-THOR does.

AI2-THOR matches an action to a method by the names of its parameters. It answers mistakes with an error code, which its
client turns into a `ValueError`. `call` does the same.
"""

import importlib
import inspect
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cache, cached_property
from types import MappingProxyType
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, create_model

# The functions of these modules register themselves.
_MODULES = (
    *("session", "appearance", "motion", "paths", "spawn"),
    *("object_queries", "object_placement", "object_states", "cameras"),
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


class Arguments(BaseModel):
    """The arguments of an action whose function takes them as one; with `extra="allow"`, others have no effect."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


@dataclass
class _Action:
    function: Callable[..., object]
    fields: dict[str, tuple[Any, Any]]
    """Types and default values of the parameters, by name; the default of a required one is `...`."""
    unused: Mapping[str, type]
    """Types of the arguments that are not passed to the function, by name."""
    is_open: bool
    """Whether any other argument may be given too."""
    given_model: type[Arguments] | None
    """The model that the function takes; `None` for a function that takes the arguments by name."""

    @property
    def types(self) -> dict[str, Any]:
        """Types of all arguments, by name."""
        return {name: annotation for name, (annotation, _) in self.fields.items()} | dict(self.unused)

    @cached_property
    def model(self) -> type[BaseModel]:
        """The validator of the arguments, made on first use: making one takes longer than most actions."""
        if self.given_model is not None:
            return self.given_model
        fields: dict[str, Any] = self.fields | {name: (kind, None) for name, kind in self.unused.items()}
        return create_model("Arguments", __base__=Arguments, **fields)

    @property
    def signature(self) -> str:
        """The signature in the form of AI2-THOR's messages."""
        used = [
            f"{_type_name(annotation)} {name}" + ("" if default is ... else f" = {default}")
            for name, (annotation, default) in self.fields.items()
        ]
        return ", ".join(used + [f"{_type_name(self.unused[name])} {name}" for name in sorted(self.unused)])


_ACTIONS: dict[str, _Action] = {}


def action(*names: str, unused: Mapping[str, type] = MappingProxyType({})) -> Callable[[Function], Function]:
    """Register a function under AI2-THOR's names for it.

    The function is `function(engine, *, parameters as on the wire) -> actionReturn`, or takes one model of `Arguments`.

    Args:
        unused: Types of AI2-THOR's parameters that have no effect here, by name.
    """

    def register(function: Function) -> Function:
        parameters = list(inspect.signature(function, eval_str=True).parameters.values())[1:]
        model = None
        if parameters and parameters[0].kind is inspect.Parameter.POSITIONAL_OR_KEYWORD:
            model = parameters[0].annotation
            parameters = list(inspect.signature(model).parameters.values())
        named = [p for p in parameters if p.kind is not p.VAR_KEYWORD]
        fields = {p.name: (p.annotation, ... if p.default is p.empty else p.default) for p in named}
        for name in names:
            if name in _ACTIONS:
                raise ValueError(f"{name} is registered twice")
            _ACTIONS[name] = _Action(function, fields, unused, named != parameters, model)
        return function

    return register


# Actions of AI2-THOR that the engine lacks: their refusal differs from that of a misspelling.
_AI2THOR_ONLY = frozenset(
    {
        "BakeNavMesh",
        "BreakObject",
        "ChangeSkyboxColor",
        "CreateObjectPrefab",
        "CreateRuntimeAsset",
        "DirectionalPush",
        "DropHandObject",
        "FlyAhead",
        "FlyDown",
        "FlyTo",
        "FlyUp",
        "LaunchDroneObject",
        "MoveAgent",
        "MoveArm",
        "MoveArmBase",
        "MoveArmRelative",
        "MoveHeldObject",
        "MoveHeldObjectAhead",
        "MoveHeldObjectBack",
        "MoveHeldObjectDown",
        "MoveHeldObjectLeft",
        "MoveHeldObjectRight",
        "MoveHeldObjectUp",
        "PickupObject",
        "PullObject",
        "PushObject",
        "PutObject",
        "ReleaseObject",
        "RotateAgent",
        "RotateHeldObject",
        "RotateWristRelative",
        "SetHandSphereRadius",
        "SetSkybox",
        "SliceObject",
        "ThrowObject",
        "TouchThenApplyForce",
        "UseUpObject",
    }
)


def action_names() -> tuple[str, ...]:
    """Return the names of all actions, sorted."""
    return tuple(sorted(_served()))


def parameter_types(name: str) -> Mapping[str, Any]:
    """Return the types of an action's parameters, by name."""
    return MappingProxyType(_served()[name].types)


def _not_served(name: object) -> str:
    reason = " (AI2-THOR has it, evonav's engine does not)" if name in _AI2THOR_ONLY else ""
    return f"Invalid action: {brief(name)}{reason}"


def call(engine: object, message: Mapping[str, Any]) -> object:
    """Execute an action.

    Args:
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
        raise ActionError(str(problem or _not_served(name)), ErrorCode.INVALID_ACTION)
    common = _ENVELOPE if found.is_open else _COMMON  # an open action may read what Initialize also sets
    types = found.types
    arguments = {key: value for key, value in message.items() if key in types or key not in common}
    unknown = [key for key in arguments if key not in types and not (found.is_open and key != "engine")]
    if unknown:
        raise ActionError(_invalid(str(name), found, unknown, list(arguments)), ErrorCode.INVALID_ARGUMENT)
    try:
        values = found.model.model_validate({key: arguments[key] for key in arguments if key in types})
    except ValidationError as error:
        raise _refusal(str(name), types, arguments, error) from error
    if found.given_model is not None:
        return found.function(engine, values)
    others = {key: value for key, value in arguments.items() if key not in types}
    return found.function(engine, **{key: getattr(values, key) for key in arguments if key in found.fields}, **others)


@cache
def _served() -> dict[str, _Action]:
    for module in _MODULES:
        importlib.import_module(f"evonav.thor.actions.{module}")
    return _ACTIONS


def _refusal(
    name: str, types: Mapping[str, Any], arguments: Mapping[str, object], error: ValidationError
) -> ActionError:
    """Return the error for the first argument that cannot be converted, or for the missing ones."""
    problems = error.errors(include_url=False, include_context=False)
    missing = [str(problem["loc"][0]) for problem in problems if problem["loc"][0] not in arguments]
    if len(missing) == len(problems):
        return missing_arguments(name, *missing)
    wrong = {problem["loc"][0]: problem for problem in reversed(problems)}
    key = next(key for key in arguments if key in wrong)
    place = ".".join(str(part) for part in wrong[key]["loc"][1:])
    message = (
        f"action: {name} has an invalid argument: {key} (=={brief(arguments[key])})."
        f" Cannot convert to: {_type_name(types[key])}{place and f' ({place})'}: {wrong[key]['msg']}"
    )
    return ActionError(message, ErrorCode.INVALID_ARGUMENT)


def missing_arguments(name: str, *arguments: str) -> ActionError:
    """Return the error that AI2-THOR reports for an action that lacks arguments."""
    message = f"action: {name} is missing the following arguments: {','.join(arguments)}"
    return ActionError(message, ErrorCode.MISSING_ARGUMENTS)


def _invalid(name: str, found: _Action, unknown: list[str], given: list[str]) -> str:
    """Return AI2-THOR's message for invalid arguments, which its users search for."""
    quoted = [", ".join(f"'{brief(key)}'" for key in keys[:20]) for keys in (unknown, given)]
    return (
        f'\n\tAction: "{name}" called with invalid argument{"s" if len(unknown) > 1 else ""}: {quoted[0]}'
        f"\n\tExpected arguments: {found.signature}"
        f"\n\tYour arguments: {quoted[1]}"
        f'\n\tValid ways to call "{name}" action:\n\t\t{name}({found.signature})'
    )


def _type_name(annotation: object) -> str:
    return annotation.__name__ if isinstance(annotation, type) else str(annotation).rpartition(".")[2]


def brief(value: object) -> str:
    """Abbreviate a value for a message, to about two hundred characters."""
    return value[:_BRIEF] if isinstance(value, str) else reprlib.repr(value)
