"""`evonav new-agent`: write an agent to begin with."""

from pathlib import Path
from typing import Annotated

import typer

CLASS = "MyAgent"
"""The agent's class in the template."""


def new_agent(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Python file to write, such as my_agent.py.")] = Path(
        "my_agent.py"
    ),
) -> None:
    """Write a Python file with an agent to begin with.

    The agent maps the house, remembers objects and explores. The commands that check and evaluate it are printed.
    """
    from importlib.resources import files

    from evonav.errors import InvalidArgumentError
    from evonav.parallel.folders import write_atomically

    if file.suffix != ".py" or not file.stem.isidentifier():
        raise InvalidArgumentError(f"{file}: name a Python file, such as my_agent.py")
    if file.exists():
        raise InvalidArgumentError(f"{file} exists already: name another file")
    text = (files("evonav.cli.run") / "agent_template.py").read_text(encoding="utf-8")
    name = file.as_posix() if file.is_absolute() else f"./{file.as_posix()}"
    write_atomically(file, text.replace("./my_agent.py", name))
    typer.echo(f"written: {file}")
    typer.echo(f"check it:    evonav check-agent {name}:{CLASS}")
    typer.echo(f"evaluate it: evonav evaluate --agent {name}:{CLASS} --agent fu --limit 4 --out out/mine")
