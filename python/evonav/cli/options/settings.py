"""Derive command-line options from the settings models that sweep files use.

`@with_settings("decisions")` gives a command one option for each field of `DecisionSettings`, and passes the settings
as the argument `decisions`. Loading the models takes time, so `SettingsGroup` adds these options only to the command
that is called.
"""

import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from functools import wraps
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union, get_args, get_origin

import typer
from typer.core import TyperGroup

if TYPE_CHECKING:  # the command must start fast
    from evonav.evaluation.run.settings import Settings


@dataclass(frozen=True)
class Options:
    """The options that one settings model has on the command line."""

    model: "type[Settings]"
    panel: str
    """Heading in the command's help."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Option by field, where its name differs."""
    fields: tuple[str, ...] = ()
    """The fields that are options; default: all that fit on a command line."""
    parse: Mapping[str, Callable[[str], Any]] = field(default_factory=dict)
    """Functions that read fields which are no plain values."""

    def option(self, name: str) -> str:
        """Return the parameter name of a field's option."""
        return self.names.get(name, name)

    @property
    def chosen(self) -> tuple[str, ...]:
        """The fields that are options."""
        fields = self.model.model_fields
        return self.fields or tuple(
            name for name in fields if name in self.parse or get_origin(fields[name].annotation) is not dict
        )

    def parameters(self) -> list[inspect.Parameter]:
        """Return a keyword parameter for each option, as typer reads them."""
        parameters = []
        for name in self.chosen:
            found = self.model.model_fields[name]
            option, kind = self.option(name), str if name in self.parse else _option_type(found.annotation)
            flag = option.replace("_", "-")
            flags = f"--{flag}/--no-{flag}" if found.default is True else f"--{flag}"
            hint = typer.Option(flags, help=" ".join((found.description or "").split()), rich_help_panel=self.panel)
            default = "" if name in self.parse else found.default
            parameters.append(
                inspect.Parameter(
                    option, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, hint]
                )
            )
        return parameters

    def read(self, given: dict[str, Any]) -> "Settings":
        """Take the options out of `given` and return the settings.

        Raises:
            typer.BadParameter: A value is invalid.
        """
        from pydantic import ValidationError

        values: dict[str, Any] = {}
        with self.errors():
            for name in self.chosen:
                value = given.pop(self.option(name))
                value = value.value if isinstance(value, Enum) else value
                if name in self.parse:
                    value = self.parse[name](value)
                if value != self.model.model_fields[name].get_default(call_default_factory=True):
                    values[name] = value
        try:
            return self.model.model_validate(values)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            option = self.option(str(first["loc"][0])).replace("_", "-")
            raise typer.BadParameter(f"--{option} = {first['input']!r}: {first['msg']}") from None

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Name the option in errors about a field."""
        from evonav.evaluation.run.settings import SettingError

        try:
            yield
        except SettingError as error:
            raise typer.BadParameter(f"--{self.option(error.key).replace('_', '-')} {error.problem}") from None


def settings_options(name: str) -> Options:
    """Return the options of a settings argument: decisions, spending, simulation, perception or models."""
    from evonav.evaluation.run import settings

    return {
        "decisions": Options(
            settings.DecisionSettings,
            "Decisions",
            {"kind": "decision", "mode": "vlm_mode", "request_timeout_s": "request_timeout"},
            parse={"noise": _noise},
        ),
        "spending": Options(settings.SpendingSettings, "Decisions"),
        "simulation": Options(
            settings.SimulatorSettings,
            "Simulator",
            {
                "kind": "simulator",
                "executable": "thor_executable",
                "commit_id": "thor_commit",
                "platform": "thor_platform",
                "gpu_device": "thor_gpu",
                "x_display": "thor_display",
                "timeout_s": "thor_timeout",
            },
        ),
        "perception": Options(settings.PerceptionSettings, "Perception", {"make": "perception"}),
        "models": Options(settings.PerceptionSettings, "Perception", fields=("models", "device")),
    }[name]


def with_settings(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options of settings; its arguments `names` are the settings.

    Args:
        *names: Names that `settings_options` knows.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command)
        plain = [parameter for name, parameter in own.parameters.items() if name not in names]

        def expand() -> Callable[..., None]:
            """Return the command with all its options."""
            groups = {name: settings_options(name) for name in names}

            def run(**given: Any) -> None:  # noqa: ANN401 - values of options
                command(**{name: options.read(given) for name, options in groups.items()}, **given)

            added = [parameter for options in groups.values() for parameter in options.parameters()]
            return _signed(run, command, [*plain, *added])

        @wraps(command)
        def wrapped(**_: Any) -> None:  # noqa: ANN401 - values of options
            raise AssertionError("`SettingsGroup` calls the expanded command")

        _signed(wrapped, command, plain)
        wrapped.expand = expand  # type: ignore[attr-defined]
        return wrapped

    return decorate


class SettingsGroup(TyperGroup):
    """A group of commands in which the called one gets the options of its settings."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - click's
        """Return the called command's name, the command with all its options, and its arguments."""
        name, command, rest = super().resolve_command(ctx, args)
        expand = getattr(getattr(command, "callback", None), "expand", None)
        if command is not None and expand is not None:
            app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
            app.command(name, epilog=command.epilog)(expand())
            command = typer.main.get_command(app)
        return name, command, rest


def _signed(
    function: Callable[..., None], command: Callable[..., None], parameters: list[inspect.Parameter]
) -> Callable[..., None]:
    """Give a function a command's name and docstring, and these parameters."""
    keywords = [
        parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)
        for parameter in sorted(parameters, key=lambda parameter: parameter.default is not inspect.Parameter.empty)
    ]
    function.__name__, function.__doc__, function.__module__ = command.__name__, command.__doc__, command.__module__
    function.__signature__ = inspect.Signature(keywords)  # type: ignore[attr-defined]
    function.__annotations__ = {parameter.name: parameter.annotation for parameter in keywords}
    return function


def _option_type(annotation: Any) -> Any:  # noqa: ANN401 - a type hint
    """Return the type of an option: a choice for literals, and all else as in the model."""
    if get_origin(annotation) in (Union, UnionType):
        (inner,) = (part for part in get_args(annotation) if part is not type(None))
        return _option_type(inner) | None
    if get_origin(annotation) is Literal:
        return Enum("Choice", {value: value for value in get_args(annotation)}, type=str)
    return annotation


def _noise(text: str) -> dict[str, float]:
    """Read rates of mistakes, such as wrong=0.1,lost=0.01."""
    from evonav.decision.noisy import NoiseRates, read_rates
    from evonav.errors import InvalidArgumentError
    from evonav.evaluation.run.settings import SettingError

    try:
        return read_rates(text, list(NoiseRates.__dataclass_fields__))
    except InvalidArgumentError as error:
        raise SettingError("noise", str(error)) from None
