"""Keep old names of commands and options working for one version; the help does not show them."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import typer

OLD_COMMANDS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "evonav generate": ("tasks", "generate"),
        "evonav measures": ("report", "--text"),
    }
)
"""The words that stand for a command that was renamed or moved."""
_AGENTS = {"--agents": "--agent"}
_IN_PROCESS = {"--in-process": "--isolation=none"}
OLD_OPTIONS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "evonav check-agent": {"--timeout": "--agent-timeout"},
        "controlled evaluate": {**_AGENTS, **_IN_PROCESS},
        "evonav demo": {**_AGENTS, **_IN_PROCESS},
        "evonav evaluate": {**_AGENTS, **_IN_PROCESS},
        "evonav sweep": _IN_PROCESS,
        "evonav measures": {**_AGENTS, "--out": "--md"},
        "evonav pack": _AGENTS,
        "evonav paper": {"--out": "--md"},
        "evonav perception": {"--houses": "--houses-per-task"},
        "evonav strip": {**_AGENTS, "--stages": "--stage"},
        "tasks write": {
            "--vlm-model": "--model",
            "--vlm-base-url": "--base-url",
            "--vlm-exchanges": "--exchanges",
            "--vlm-workers": "--concurrency",
        },
    }
)
"""Options by command: the old spelling, and the one that took its place."""
JSON_FILES = ("evonav compare", "tasks validate")
"""Commands whose `--json FILE` wrote a file; `--json` now prints."""


def in_new_names(group: str, command_line: Sequence[str], *, is_quiet: bool = False) -> list[str]:
    """Return a command line in which old names are replaced.

    Args:
        group: Name of the group that the first word is a command of, such as `evonav` or `tasks`.
        command_line: The command's name and its arguments.
        is_quiet: Do not print which names are new.
    """
    if not command_line:
        return []
    name, *rest = command_line
    renamed = OLD_OPTIONS.get(f"{group} {name}", {})
    for place, word in enumerate(rest):
        if word == "--":
            break
        option, equals, value = word.partition("=")
        follows = value if equals else rest[place + 1] if place + 1 < len(rest) else ""
        if option == "--json" and f"{group} {name}" in JSON_FILES and follows.endswith(".json"):
            rest[place] = f"--json-file{equals}{value}"
            if not is_quiet:
                typer.echo(f"note: --json now prints: write --json > {follows}", err=True)
        if option in renamed:
            rest[place] = f"{renamed[option]}{equals}{value}"
            if not is_quiet:
                typer.echo(f"note: {option} is now {renamed[option]}", err=True)
    new = OLD_COMMANDS.get(f"{group} {name}")
    if new is not None and not is_quiet:
        typer.echo(f"note: `evonav {name}` is now `evonav {' '.join(new)}`", err=True)
    return [*(new or (name,)), *rest]
