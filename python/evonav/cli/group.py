"""Parse and show commands as evonav does: `-h`, plain flags, and panels in order."""

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

HELP_NAMES = {"help_option_names": ["-h", "--help"]}


class _Shown:
    """Show flags without a type, arguments in capitals, and no hidden argument."""

    def get_params(self, ctx: Any) -> list[Any]:  # noqa: ANN401 - click's
        """Return the parameters, with the names under which the help shows their values."""
        params: list[Any] = super().get_params(ctx)  # type: ignore[misc]
        for param in params:
            if getattr(param, "is_flag", False):
                param.metavar = ""
            elif param.param_type_name == "argument":
                param.metavar = param.metavar or str(param.name).upper()
                param.display_type_rich = _without_type
        return params

    def collect_usage_pieces(self, ctx: Any) -> list[str]:  # noqa: ANN401 - click's
        """Return the parts of the line `Usage:`."""
        hidden = {
            piece for param in self.get_params(ctx) if getattr(param, "hidden", False) for piece in _pieces(param, ctx)
        }
        pieces: list[str] = super().collect_usage_pieces(ctx)  # type: ignore[misc]
        return [piece for piece in pieces if piece not in hidden]

    def format_help(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401 - click's
        """Show an option's names and type in one column, so that its help has room."""
        for param in self.get_params(ctx):
            if param.param_type_name == "option":
                _show_in_one_column(param, ctx)
        super().format_help(ctx, formatter)  # type: ignore[misc]


MAX_TYPE = 16
"""Characters of the longest type that the help shows; a longer list of choices is part of the option's help."""


def _show_in_one_column(param: Any, ctx: Any) -> None:  # noqa: ANN401 - click's
    """Change an option for the help, which is the last that the process does with it."""
    names = sorted(param.opts, key=len)
    if param.secondary_opts:
        default = str((param.opts if param.default else param.secondary_opts)[0]).lstrip("-")
        param._get_default_string = lambda **_: default
        names = [f"--[no-]{name[2:]}" if f"--no-{name[2:]}" in param.secondary_opts else name for name in names]
    shown = param.display_type_rich(ctx=ctx) or ""
    if len(shown) > MAX_TYPE:
        choices = shown.strip("<[]>").split("|")
        if not all(choice in (param.help or "") for choice in choices):
            param.help = f"One of {', '.join(choices)}. {param.help or ''}"
        shown = names[-1].rpartition("-")[2].upper()
    param.opts, param.secondary_opts = [f"{', '.join(names)} {shown}".rstrip()], []
    param.display_type_rich = _without_type


def _without_type(ctx: Any) -> None:  # noqa: ANN401 - click's
    """Stand for the type of an argument, which its name tells."""


def _pieces(param: Any, ctx: Any) -> list[str]:  # noqa: ANN401 - click's
    return list(param.get_usage_pieces(ctx)) if param.param_type_name == "argument" else []


class Command(_Shown, TyperCommand):
    """A command."""


class Group(_Shown, TyperGroup):
    """A group of commands in which the called one gets the options of its settings (`evonav.cli.options.settings`).

    A command's `beginning` is a context in which it runs, and which is entered before those options are made.
    """

    order: tuple[str, ...] = ()
    """Names of commands in the order of the help; default: as they were added."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401 - click's
        """Return the names of the commands in the order of the help."""
        places = {name: place for place, name in enumerate(self.order)}
        return sorted(super().list_commands(ctx), key=lambda name: places.get(name, len(places)))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - click's
        """Return the called command's name, the command with all its options, and its arguments."""
        name, command, rest = super().resolve_command(ctx, args)
        callback, asks_for_help = getattr(command, "callback", None), ctx.resilient_parsing or _asks_for_help(rest)
        beginning, expand = getattr(callback, "beginning", None), getattr(callback, "expand", None)
        if beginning is not None and not asks_for_help:
            ctx.with_resource(beginning())
        if command is not None and expand is not None:
            app = new_app()
            app.command(name, help=command.help, epilog=command.epilog, cls=Command)(expand(has_help=asks_for_help))
            command = typer.main.get_command(app)
        return name, command, rest


def _asks_for_help(args: list[str]) -> bool:
    return any(name in args for name in HELP_NAMES["help_option_names"])


def new_app(name: str | None = None, *, help: str | None = None, cls: type[Group] = Group) -> typer.Typer:
    """Return an empty group of commands.

    Args:
        name: Its name; default: the one it gets when it is added.
    """
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
    """Add commands to a group.

    Args:
        *commands: Functions; a command is named as its function is.
        panel: Heading in the group's help.
    """
    for command in commands:
        app.command(cls=Command, rich_help_panel=panel)(command)
