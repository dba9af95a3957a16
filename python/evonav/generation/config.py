"""Read the generation parameters from a file and from options of the command line."""

import json
from pathlib import Path
from typing import Any

from evonav.errors import InvalidArgumentError
from evonav.tasks.parameters import GenerationParameters
from evonav.tasks.records import parse_record
from evonav.toml import read_toml


def read_parameters(
    path: Path | None = None, *, evolve_probability: float | None = None, num_stages: str | None = None
) -> GenerationParameters:
    """Return the paper's parameters, overridden by a file's, overridden by options.

    Args:
        path: TOML file with any of the fields of `GenerationParameters`.
        evolve_probability: Chance that a transition evolves the house.
        num_stages: Numbers of stages to draw from, separated by commas, for example `6,8`.

    Raises:
        TaskError: A field of the file is unknown or has a wrong value; names the field.
        InvalidArgumentError: An option is outside its domain, or the file cannot be read as TOML.
    """
    parameters = GenerationParameters()
    if path is not None:
        content = json.dumps(read_toml(path), default=str)  # a date is no value of any field
        parameters = parse_record(GenerationParameters, content.encode(), path)
    changes: dict[str, Any] = {}
    if evolve_probability is not None:
        if not 0.0 <= evolve_probability <= 1.0:
            raise InvalidArgumentError(f"evolve_probability is {evolve_probability}, expected in 0..=1")
        changes["evolve_probability"] = evolve_probability
    if num_stages is not None:
        try:
            counts = tuple(int(part) for part in num_stages.split(","))
        except ValueError:
            counts = ()
        if not counts or not all(1 <= count <= 64 for count in counts):
            raise InvalidArgumentError(f"num_stages is {num_stages!r}, expected counts of 1..=64 such as 3,4,5")
        changes["num_stages"] = counts
    return parameters.model_copy(update=changes)
