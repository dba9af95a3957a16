"""Define the base of all settings and how they are read, apart from the settings: small commands start fast."""

import json
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from evonav.errors import InvalidArgumentError
from evonav.tasks.records import Record

NUM_RETRIES = 2
"""Number of retries of a stage that lost its worker, its simulator or its agent's process."""
MAX_SHOWN = 80
"""Characters of the longest value that an error shows."""

SettingsT = TypeVar("SettingsT", bound="Settings")


class SettingError(InvalidArgumentError):
    """A setting that is invalid beside the others; the command and sweep files add its full name."""

    def __init__(self, settings: "type[Settings]", key: str, problem: str) -> None:
        """Create the error.

        Args:
            key: A field of the settings; dots reach into settings that are fields.
            problem: The problem, as the end of a sentence that begins with the field's name.
        """
        super().__init__(f"{key} {problem}")
        self.settings = settings
        self.key = key
        self.problem = problem


class Settings(Record):
    """Options that people write, in a file or on the command line.

    The string below a field is its description in the JSON Schema of sweep files and in the list of keys.
    """


def settings_of(model: type[SettingsT], raw: Mapping[str, Any]) -> SettingsT:
    """Return settings from plain values, as a file or options give them.

    Raises:
        SettingError: A key is unknown or missing, or a value invalid.
    """
    try:
        text = json.dumps(raw, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(f"holds a value that is no text, number, list or table: {error}") from None
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        raise _first_problem(model, error) from None


def keys_of(model: type[Settings]) -> Iterator[str]:
    """Yield the keys of settings, those of settings that are fields with a dot."""
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, Settings):
            yield from (f"{name}.{key}" for key in keys_of(field.annotation))
        else:
            yield name


def unknown_key(model: type[Settings], key: str, known: Sequence[str], hint: str = "") -> SettingError:
    """Return the error of a key that there is not, with the nearest one that there is.

    Args:
        hint: What it says if no key is near; default: the keys that there are.
    """
    last = key.rpartition(".")[2]
    near = [one for one in known if one.rpartition(".")[2] == last] or get_close_matches(key, known, 1)
    near = near or [one for one in known if get_close_matches(last, [one.rpartition(".")[2]])]
    hint = f"did you mean {near[0]}?" if near else hint or f"there are {', '.join(known)}"
    return SettingError(model, key, f"is no such key; {hint}")


def _first_problem(model: type[Settings], error: ValidationError) -> SettingError:
    found = error.errors(include_url=False, include_context=True)
    # A key that nobody knows explains what is missing.
    first = next((one for one in found if one["type"] == "extra_forbidden"), found[0])
    key = ".".join(str(part) for part in first["loc"] if part != "[key]")
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    if first["type"] == "extra_forbidden":
        before = "".join(f"{part}." for part in first["loc"][:-1])
        unknown = unknown_key(model, key, [f"{before}{name}" for name in _model_at(model, first["loc"]).model_fields])
        return SettingError(model, key, f"{unknown.problem}{more}")
    if first["type"] == "missing":
        return SettingError(model, key, f"is missing{more}")
    if first["type"] == "string_pattern_mismatch" and "[key]" in first["loc"]:
        rule = "is no name: letters, digits, '.', '-' and single '_', and the first is a letter or digit"
        return SettingError(model, key, f"{rule}{more}")
    shown = repr(first.get("input"))
    shown = shown if len(shown) <= MAX_SHOWN else shown[: MAX_SHOWN - 3] + "..."
    return SettingError(model, key, f"= {shown}: {first['msg']}{more}")


def _model_at(model: type[Settings], place: Sequence[int | str]) -> type[Settings]:
    """Return the settings that a place of an error is in."""
    for part in place[:-1]:
        if part in model.model_fields:
            model = next(_models_in(model.model_fields[str(part)].annotation), model)
    return model


def _models_in(annotation: Any) -> Iterator[type[Settings]]:  # noqa: ANN401 - a type hint
    if isinstance(annotation, type) and issubclass(annotation, Settings):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)
