"""Define strict records, the parts of files and messages, and say what is wrong in one."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from evonav.errors import InvalidArgumentError

MAX_SHOWN = 100
"""Longest wrong value in a sentence, in characters."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Version = Annotated[int, Field(ge=1, le=1, strict=True)]
"""The version of a file's format, of which there is one so far. `Literal[1]` would take `true` for it."""


class Record(BaseModel):
    """A part of a file: frozen, without coercion, unknown keys, infinity or NaN."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False, defer_build=True)


class Options(Record):
    """Options that people give by name. An unknown one, or a wrong value, is an `InvalidArgumentError`."""

    of: ClassVar[str]
    """The thing that has the options, for the error."""

    def __init__(self, **options: Any) -> None:  # noqa: ANN401 - as people give them, checked
        """Check all options; an `InvalidArgumentError` names the first wrong one, and its value."""
        try:
            super().__init__(**options)
        except ValidationError as error:
            unknown = next((name for name in options if name not in type(self).model_fields), None)
            if unknown is not None:
                hint = did_you_mean(unknown, type(self).model_fields)
                raise InvalidArgumentError(f"{self.of} has no option {unknown!r}; {hint}") from None
            raise InvalidArgumentError(f"{self.of}: {sentence_of(error)}") from error


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the known name that is nearest to a wrong one, as the end of a sentence, or all of them."""
    names = list(known)
    near = get_close_matches(name, names, 1)
    return f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}"


def sentence_of(error: ValidationError, name: str = "") -> str:
    """Return the first problem that pydantic found as a sentence with the wrong field and its value.

    Args:
        name: The thing that was read, which begins the field's path.
    """
    return sentences_of(error, name)[0]


def sentences_of(error: ValidationError, name: str = "") -> list[str]:
    """Return all problems that pydantic found, each as a sentence with the wrong field and its value."""
    return [_sentence(problem, name) for problem in error.errors(include_url=False, include_context=False)]


def _sentence(problem: Any, name: str) -> str:  # noqa: ANN401 - pydantic's `ErrorDetails`
    place = ".".join(str(part)[:MAX_SHOWN] for part in (name, *problem["loc"][:10]) if part != "")
    if problem["type"] == "missing":
        return f'missing "{place}"'
    return wrong_value(place, problem.get("input"), problem["msg"])


def wrong_value(place: str, value: Any, message: str) -> str:  # noqa: ANN401
    """Return the sentence for a wrong value of a field; without a place, it is the whole that is wrong."""
    shown = repr(value)
    shown = shown if len(shown) <= MAX_SHOWN else f"{shown[:MAX_SHOWN]} ..."
    message = message[:300]
    return f"{place} = {shown}: {message}" if place else f"{message}, got {shown}"
