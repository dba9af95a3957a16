"""Read TOML, the one format of files that people write for evonav, and set values in it by `KEY=VALUE`."""

import json
import sys
from pathlib import Path
from typing import Any

from evonav.errors import InvalidArgumentError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file as plain values.

    Args:
        path: A file whose name ends in `.toml`.

    Raises:
        InvalidArgumentError: It cannot be read or is not TOML, for example because a key is given twice.
    """
    if path.suffix.lower() != ".toml":
        raise InvalidArgumentError(f"{path}: expected TOML: write it as TOML, in a file whose name ends in .toml")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidArgumentError(f"{path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise InvalidArgumentError(f"{path}: not UTF-8: {error}") from None
    except (ValueError, RecursionError) as error:
        raise InvalidArgumentError(f"{path}: not TOML: {' '.join(str(error).split())}") from None


def key_and_value(change: str) -> tuple[str, Any]:
    """Return the key and the value of `KEY=VALUE`; a value is JSON, or text.

    Raises:
        InvalidArgumentError: It is no such change.
    """
    key, equals, text = change.partition("=")
    if not equals or not all(key.strip().split(".")):
        raise InvalidArgumentError(f"--set {change}: expected KEY=VALUE, such as engine=ray or perception.device=cpu")
    try:
        return key.strip(), json.loads(text)
    except ValueError:
        return key.strip(), text.strip()


def set_value(table: dict[str, Any], key: str, value: Any, where: str = "the settings") -> None:  # noqa: ANN401 - any
    """Set a value in a table; a key with dots reaches into tables in it.

    Args:
        where: Name of the table in errors.

    Raises:
        InvalidArgumentError: The key reaches into what is no table.
    """
    *tables, last = key.split(".")
    for depth, name in enumerate(tables):
        inner = table.setdefault(name, {})
        if not isinstance(inner, dict):
            raise InvalidArgumentError(
                f"--set {key}: {'.'.join(tables[: depth + 1])} is no table in {where}: give the whole of it"
            )
        table = inner
    table[last] = value
