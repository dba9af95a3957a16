"""Derive command-line options from the settings models that sweep files use.

`@with_settings("decisions")` gives a command one option for each field of `DecisionSettings`, and passes the settings
as the argument `decisions`. Loading the models takes time, so `evonav.cli.group.Group` adds these options only to the
command that is called.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import wraps
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union, get_args, get_origin

import typer

if TYPE_CHECKING:  # the command must start fast
    from evonav.evaluation.run.settings_model import Settings

MODEL_PANEL = "Decision model"
"""Heading of the options of decision models in the help."""
_METAVARS = {
    "base_url": "URL",
    "exchanges": "FILE",
    "models": "FOLDER",
    "noise": "NAME=RATE",
    "prices": "FILE",
}
"""Placeholders of the values of some fields in the help."""
WORKER_PANEL = "Workers and limits"
"""Heading of the options of workers in the help."""


@dataclass(frozen=True)
class Options:
    """The options that one settings model has on the command line."""

    model: "type[Settings]"
    panel: str | None = None
    """Heading in the command's help; default: that of plain options."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Option by field, where its name differs."""
    fields: tuple[str, ...] = ()
    """The fields that are options; default: all that fit on a command line."""
    parse: Mapping[str, Callable[[str], Any]] = field(default_factory=dict)
    """Functions that read fields which are no plain values."""
    hidden: bool = False
    """The options work, but the help does not show them."""
    overrides: bool = False
    """The options override a file: none has a default, and an option that is given counts even if it is the model's."""

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

    def flag(self, name: str) -> str:
        """Return the flag of a field's option."""
        return f"--{self.option(name).replace('_', '-')}"

    def parameters(self, *, has_help: bool) -> list[inspect.Parameter]:
        """Return a keyword parameter for each option, as typer reads them.

        Args:
            has_help: True to give them their help, which takes time to read.
        """
        texts = _descriptions(self.model) if has_help else {}
        return [
            inspect.Parameter(
                self.option(name),
                inspect.Parameter.KEYWORD_ONLY,
                default=self._default(name),
                annotation=Annotated[self._type(name), self._hint(name, texts.get(name, ""))],
            )
            for name in self.chosen
        ]

    def _default(self, name: str) -> Any:  # noqa: ANN401 - a default
        if self.overrides:
            return None
        return "" if name in self.parse else self.model.model_fields[name].get_default(call_default_factory=True)

    def _type(self, name: str) -> Any:  # noqa: ANN401 - a type hint
        kind = str if name in self.parse else _option_type(self.model.model_fields[name].annotation)
        return kind | None if self.overrides else kind

    def _hint(self, name: str, description: str) -> Any:  # noqa: ANN401 - typer's
        found = self.model.model_fields[name]
        text = " ".join(description.split())
        if self.overrides:
            what, _, default = text.partition(" Default: ")
            text = f"{what} Default: the file's{', else ' + default if default else '.'}"
        flags = f"{self.flag(name)}/--no-{self.flag(name)[2:]}" if found.default is True else self.flag(name)
        least: Any = next((limit.ge for limit in found.metadata if hasattr(limit, "ge")), None)
        metavar = _METAVARS.get(name) or _metavar(found.annotation)
        return typer.Option(
            flags, min=least, help=text, rich_help_panel=self.panel, hidden=self.hidden, metavar=metavar
        )

    def read(self, given: dict[str, Any]) -> "Settings":
        """Take the options out of `given` and return the settings.

        Raises:
            SettingError: A value cannot be read.
            typer.BadParameter: A value is invalid.
        """
        from pydantic import ValidationError

        values: dict[str, Any] = {}
        for name in self.chosen:
            value = given.pop(self.option(name))
            value = value.value if isinstance(value, Enum) else value
            if name in self.parse:
                value = self.parse[name](value)
            default = self.model.model_fields[name].get_default(call_default_factory=True)
            if value != (None if self.overrides else default):
                values[name] = value
        try:
            return self.model.model_validate(values)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise typer.BadParameter(
                f"{self.flag(str(first['loc'][0]))} = {first['input']!r}: {first['msg']}"
            ) from None


def settings_options(name: str) -> Options:
    """Return the options that the argument of a command with this name has."""
    return _run_options(name) or _part_options()[name]


def _run_options(name: str) -> Options | None:
    """Return the options of workers and limits, without what the models of a run's parts import."""
    from evonav.evaluation.run.run_settings import RunSettings

    run_names = {"num_retries": "retries", "agent_timeout_s": "agent_timeout", "agent_memory_mb": "agent_memory"}
    pool = ("workers", "engine", "ray_address")
    evaluators = (*pool, "episodes_at_once", "worker_gpus")
    return {
        "workers": Options(RunSettings, fields=("workers",)),
        "pool": Options(RunSettings, WORKER_PANEL, fields=pool),
        "run": Options(
            RunSettings,
            WORKER_PANEL,
            names=run_names,
            fields=(
                *evaluators,
                "num_retries",
                "isolation",
                "agent_timeout_s",
                "agent_memory_mb",
            ),
        ),
        "changes": Options(RunSettings, WORKER_PANEL, fields=evaluators, overrides=True),
    }.get(name)


def _part_options() -> Mapping[str, Options]:
    from evonav.evaluation.run import settings
    from evonav.evaluation.run.decision_resources import SpendingSettings

    return {
        "decisions": Options(
            settings.DecisionSettings,
            MODEL_PANEL,
            {"kind": "decision", "mode": "vlm_mode", "request_timeout_s": "request_timeout"},
            parse={"noise": _noise},
        ),
        "endpoint": Options(
            settings.DecisionSettings,
            MODEL_PANEL,
            {"mode": "vlm_mode"},
            fields=("model", "base_url", "mode", "exchanges", "images"),
        ),
        "spending": Options(SpendingSettings, MODEL_PANEL),
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
    }


def with_settings(*names: str, hidden: tuple[str, ...] = ()) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options of settings; its arguments `names` are the settings.

    Args:
        *names: Names that `settings_options` knows.
        hidden: Those of them that the help does not show.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command)
        plain = [parameter for name, parameter in own.parameters.items() if name not in names]

        def expand(*, has_help: bool) -> Callable[..., None]:
            """Return the command with all its options."""
            groups = {name: replace(settings_options(name), hidden=name in hidden) for name in names}

            def run(**given: Any) -> None:  # noqa: ANN401 - values of options
                from evonav.evaluation.run.settings_model import SettingError

                try:
                    command(**{name: options.read(given) for name, options in groups.items()}, **given)
                except SettingError as error:
                    found = [options for options in groups.values() if options.model is error.settings]
                    if not found:
                        raise
                    raise typer.BadParameter(f"{found[0].flag(error.key)} {error.problem}") from None

            added = [parameter for options in groups.values() for parameter in options.parameters(has_help=has_help)]
            return _signed(run, command, [*plain, *added])

        @wraps(command)
        def wrapped(**_: Any) -> None:  # noqa: ANN401 - values of options
            raise AssertionError("`Group` calls the expanded command")

        _signed(wrapped, command, plain)
        wrapped.expand = expand  # type: ignore[attr-defined]
        return wrapped

    return decorate


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


def _descriptions(model: "type[Settings]") -> Mapping[str, str]:
    from evonav.tasks.records import descriptions

    return descriptions(model)


def _option_type(annotation: Any) -> Any:  # noqa: ANN401 - a type hint
    """Return the type of an option: a choice for literals, and all else as in the model."""
    if get_origin(annotation) in (Union, UnionType):
        (inner,) = (part for part in get_args(annotation) if part is not type(None))
        return _option_type(inner) | None
    if get_origin(annotation) is Literal:
        return Enum("Choice", {value: value for value in get_args(annotation)}, type=str)
    return annotation


def _metavar(annotation: Any) -> str | None:  # noqa: ANN401 - a type hint
    """Return the word that stands for a value in the help; `None` leaves it to typer, which lists choices."""
    kinds = {int: "N", float: "X", str: "TEXT"}
    return next((kinds[part] for part in (annotation, *get_args(annotation)) if part in kinds), None)


def _noise(text: str) -> dict[str, float]:
    """Read rates of mistakes, such as wrong=0.1,lost=0.01."""
    from evonav.decision.noisy import NoiseRates, read_rates
    from evonav.errors import InvalidArgumentError
    from evonav.evaluation.run.settings import DecisionSettings
    from evonav.evaluation.run.settings_model import SettingError

    try:
        return read_rates(text, list(NoiseRates.__dataclass_fields__))
    except InvalidArgumentError as error:
        raise SettingError(DecisionSettings, "noise", str(error)) from None
