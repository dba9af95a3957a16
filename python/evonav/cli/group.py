"""Parse and show commands: `-h`, flags and arguments without a type, and errors of settings that name the option."""

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

HELP_NAMES = {"help_option_names": ["-h", "--help"]}


class Command(TyperCommand):
    """A command."""

    def get_params(self, ctx: Any) -> list[Any]:  # noqa: ANN401 - click's
        """Return the parameters; the help shows no type of flags and arguments, whose names say it."""
        return _without_types(super().get_params(ctx))

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401 - click's
        """Run the command; an invalid setting is wrong usage."""
        try:
            return super().invoke(ctx)
        except Exception as error:
            from evonav.cli.options.settings import usage_error  # the command must start fast

            usage = usage_error(error)
            if usage is None:
                raise
            usage.ctx = ctx
            raise usage from None


def _without_types(params: list[Any]) -> list[Any]:
    for param in params:
        if getattr(param, "is_flag", False):
            param.metavar = ""
        elif param.param_type_name == "argument":
            param.display_type_rich = lambda ctx: None
    return params


class Group(TyperGroup):
    """A group of commands."""

    order: tuple[str, ...] = ()
    """Names of commands in the order of the help; default: as they were added."""

    def get_params(self, ctx: Any) -> list[Any]:  # noqa: ANN401 - click's
        """Return the parameters; the help shows no type of flags."""
        return _without_types(super().get_params(ctx))

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401 - click's
        """Return the names of the commands in the order of the help."""
        places = {name: place for place, name in enumerate(self.order)}
        return sorted(super().list_commands(ctx), key=lambda name: places.get(name, len(places)))


def new_app(name: str | None = None, *, help: str | None = None, cls: type[Group] = Group) -> typer.Typer:
    """Return an empty group of commands; without a name, it gets one when it is added."""
    return typer.Typer(
        name=name,
        cls=cls,
        help=help,
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        context_settings=HELP_NAMES,
    )


def add_commands(app: typer.Typer, *commands: Callable[..., None], panel: str | None = None) -> None:
    """Add commands, named as their functions are, to a group; `panel` is their heading in its help."""
    for command in commands:
        app.command(cls=Command, rich_help_panel=panel)(command)
