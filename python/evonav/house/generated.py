"""Houses from seeds: made when they are read, or into a file.

The core makes them (`evonav_core::house_generation`), in the way of ProcTHOR (Deitke et al., NeurIPS 2022).
"""

import hashlib
import json
import re
from collections.abc import Iterator
from functools import lru_cache
from itertools import count
from pathlib import Path

from evonav._core import HouseMaker, __version__, default_house_parameters
from evonav.errors import InvalidArgumentError
from evonav.toml import read_toml

ENDLESS = "endless"
"""`endless:SEED` names the endless houses of a seed, and `endless:SEED:N` the N-th of them, from 1."""
SPLIT_SEEDS = {"train": 20_001, "val": 20_002, "test": 20_003}
"""Seeds of `endless:train`, `endless:val` and `endless:test`, which have the assets of their split."""
MAX_SEED = 2**64 - 1
_NAME = re.compile(rf"{ENDLESS}:(\d+|{'|'.join(SPLIT_SEEDS)})(?::([1-9]\d*))?")


class EndlessHouses:
    """The endless houses of a seed, or one of them, made as they are read."""

    def __init__(self, name: str) -> None:
        """Read a name.

        Args:
            name: `endless:SEED` or `endless:SPLIT`, and `:N` for the N-th of them.

        Raises:
            InvalidArgumentError: The name has another form, or a number is too large.
        """
        found = _NAME.fullmatch(name)
        if found is None:
            splits = ", ".join(SPLIT_SEEDS)
            raise InvalidArgumentError(
                f"{name}: expected {ENDLESS}:SEED or {ENDLESS}:SEED:N, with N from 1, and {splits} or a number as SEED"
            )
        self.name = f"{ENDLESS}:{found[1]}"
        """Name of all houses of the seed."""
        split = found[1] if found[1] in SPLIT_SEEDS else None
        self.seed = int(found[1]) if split is None else SPLIT_SEEDS[split]
        self.parameters = "{}" if split is None else json.dumps({"split": split})
        """Parameters as JSON."""
        self.number = None if found[2] is None else int(found[2])
        """Number of the only house, from 1; `None` for all."""
        if max(self.seed, self.number or 0) > MAX_SEED:
            raise InvalidArgumentError(f"{name}: a number is beyond {MAX_SEED}")

    def sha256(self) -> str:
        """Return the checksum of everything that decides the houses: version, seed and parameters."""
        return hashlib.sha256(
            f"{__version__} {self.seed} {default_house_parameters()} {self.parameters}".encode()
        ).hexdigest()

    def __iter__(self) -> Iterator[tuple[str, str]]:
        """Yield the name `endless:SEED:N` and the text of each house, from the first one on."""
        for number in count(1) if self.number is None else [self.number]:
            yield self.house(number)

    def house(self, number: int) -> tuple[str, str]:
        """Make the house of a number from 1; return its name and its text."""
        return f"{self.name}:{number}", house_maker(self.parameters).make(self.seed, number - 1)


@lru_cache(maxsize=4)
def house_maker(parameters_json: str) -> HouseMaker:
    """Return the maker of houses with these parameters; it is made once in a process.

    Raises:
        InvalidArgumentError: A parameter is wrong; names the field.
    """
    return HouseMaker(parameters_json)


def read_house_parameters(path: Path | None) -> str:
    """Read the parameters of houses from a TOML file, as JSON.

    Args:
        path: Tables and keys of `evonav_core::house_generation::HouseParameters`; what is left out has its default.
            `None` for all defaults.

    Raises:
        InvalidArgumentError: The file cannot be read, or a parameter is wrong; names file, field and value.
    """
    if path is None:
        return "{}"
    text = _json_of(path)
    try:
        house_maker(text)
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"{path}: {error}") from None
    return text


def _json_of(path: Path) -> str:
    try:
        return json.dumps(read_toml(path), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(f"{path}: {error}: expected finite numbers, words and lists") from None
