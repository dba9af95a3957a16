"""Read TOML, the one format of files that people write for evonav."""

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
