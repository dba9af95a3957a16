"""Run commands of evonav in this process."""

from typer.testing import CliRunner

from evonav.cli import app


def command(*words: object, columns: int = 300) -> str:
    """What a command prints, which must succeed."""
    done = CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": str(columns)})
    assert done.exit_code == 0, done.output
    return done.output
