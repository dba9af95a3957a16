"""Write and read an agent's answers as JSON: nothing else ever leaves an agent's process.

The side of the agent writes the parts of an answer, the evaluator reads them. Reading is the one check of an answer: it
trusts nothing. An agent in the evaluator's own process is written and read in the same way, so that the records do not
depend on where it ran.
"""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Annotated, Any, Generic, Literal, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    Discriminator,
    FailFast,
    Field,
    TypeAdapter,
    ValidationError,
)
from pydantic_core import PydanticSerializationError, to_json, to_jsonable_python

from evonav.agents.agent import (
    Agent,
    AgentAction,
    EntryBelief,
    Move,
    NavigateTo,
    PlaceBelief,
    SensorConfig,
    Stop,
)
from evonav.agents.explanation import RoundDiagnostics
from evonav.agents.hosting.error_text import MAX_MESSAGE, MAX_TRACEBACK
from evonav.agents.hosting.shared_slots import NUM_SLOTS
from evonav.errors import InvalidArgumentError
from evonav.points import MAX_M
from evonav.records import sentence_of
from evonav.world.simulator import Action

MAX_DIAGNOSTICS_BYTES = 1_000_000
"""Limit of a round's diagnostics as JSON: the records hold them."""
MAX_STAGE_BYTES = 32_000_000
"""Limit of the diagnostics of a stage's rounds together: a record is one text."""
MAX_ENTRIES_BYTES = 16_000_000
MAX_DEPTH = 32
"""Limit of lists and dictionaries in each other, in diagnostics."""
MAX_VALUE = 200
"""Longest value in an error, in characters."""
MAX_LABEL = 1000
"""Longest label of an entry, in characters."""
MAX_PLACES = 20_000
"""Largest number of squares of a belief about places."""
SUM_SLACK = 1e-6
"""Rounding by which probabilities may sum to more than 1."""
MAX_COUNTERS = 1000
"""Largest number of a round's counters."""
MAX_COUNT = 10**15
"""Largest count and cost; sums of such numbers are still finite, and SQLite can hold them."""

T = TypeVar("T")


@dataclass(frozen=True)
class Part(Generic[T]):
    """A kind of value that an answer can have, and its JSON."""

    name: str
    kind: Any
    """A type hint."""
    max_bytes: int
    """Limit of the JSON that is written or read."""

    @cached_property
    def _adapter(self) -> TypeAdapter[T]:
        """Reads the value; an agent's process only writes, and never makes it."""
        return TypeAdapter(self.kind)

    def write(self, value: object) -> bytes:
        """Return a value as JSON in one line; numbers and arrays of NumPy are written as Python's.

        Raises:
            InvalidArgumentError: The value holds what JSON cannot, or is too large.
        """
        try:
            text = _json_of(value)
        except (TypeError, ValueError, RecursionError) as error:
            raise InvalidArgumentError(f"{self.name}: not JSON-ready: {error}") from error
        return self.checked(text)

    def read(self, text: bytes) -> T:
        """Return the value of a JSON text.

        Raises:
            InvalidArgumentError: The text is malformed; the message has the first field that is wrong, and its value.
        """
        try:
            return self._adapter.validate_json(self.checked(text), strict=True)
        except ValidationError as error:
            raise InvalidArgumentError(sentence_of(error, self.name)) from None

    def checked(self, text: bytes) -> bytes:
        """Return a JSON text that is not too large.

        Raises:
            InvalidArgumentError: It is.
        """
        if len(text) > self.max_bytes:
            raise InvalidArgumentError(f"{self.name}: {len(text)} bytes of JSON: must be at most {self.max_bytes}")
        return text


def _json_of(value: object) -> bytes:
    try:
        return to_json(value, inf_nan_mode="constants", fallback=_plain)
    except PydanticSerializationError:  # perhaps for a half of a surrogate pair, which no file can hold
        plain = to_jsonable_python(value, inf_nan_mode="constants", fallback=_plain)
        return json.dumps(plain, ensure_ascii=False).encode("utf-8", "replace")


def _plain(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is no JSON")


# Actions


_Action = Annotated[
    Annotated[Move, AfterValidator(lambda move: Stop() if move.action is Action.STOP else move)]
    | NavigateTo
    | Annotated[Stop, AfterValidator(lambda stop: Stop(stop.reason[:MAX_MESSAGE]))],
    Discriminator("kind"),
]
_ACTION: Part[AgentAction] = Part("action", _Action, MAX_DIAGNOSTICS_BYTES)


def write_action(action: object) -> bytes:
    """Return an agent's action as JSON.

    Raises:
        InvalidArgumentError: It is no action, or not JSON-ready.
    """
    for kind in (Move, NavigateTo, Stop):
        if isinstance(action, kind):
            return _ACTION.write({field.name: getattr(action, field.name) for field in fields(kind)})
    raise InvalidArgumentError(f"{action!r} is no action: answer Move(Action), NavigateTo((x, z)) or Stop()")


def read_action(text: bytes) -> AgentAction:
    """Return the action of a JSON text; a move of `STOP` is a `Stop`.

    Raises:
        InvalidArgumentError: It is no action, or has a coordinate that is not finite or out of range.
    """
    return _ACTION.read(text)


# Beliefs


def _check(name: str, values: Iterable[float], least: float, most: float) -> None:
    """Check that no value is out of a range, or NaN."""
    wrong = next((value for value in values if not least <= value <= most), None)
    if wrong is not None:
        raise ValueError(f"{name} = {wrong!r}: must be {least:.16g} to {most:.16g}")


def _possible_entry(entry: EntryBelief) -> EntryBelief:
    _check("size_m", entry.size_m, 0.0, MAX_M)
    if len(entry.label) > MAX_LABEL:
        raise ValueError(f"label must have at most {MAX_LABEL} characters")
    if not -(2**63) <= entry.entry_id < 2**63:
        raise ValueError("entry_id must have at most 64 bits")
    _check("num_detections", (entry.num_detections,), 0, MAX_COUNT)
    if entry.p_present is not None:
        _check("p_present", (entry.p_present,), 0, 1)
    return entry


def _check_places(places: PlaceBelief) -> None:
    if not 0.0 < places.cell_m <= MAX_M:
        raise ValueError(f"places.cell_m = {places.cell_m!r}: must be above 0 and at most {MAX_M:g} m")
    num, num_expected = len(places.probabilities), len(places.centres_m)
    if num != num_expected:
        raise ValueError(f"places.probabilities: {num} values, expected one for each of the {num_expected} centres_m")
    if num > MAX_PLACES:
        raise ValueError(f"places.centres_m: {num} squares, must be at most {MAX_PLACES}")
    for index, probability in enumerate(places.probabilities):
        _check(f"places.probabilities.{index}", (probability,), 0, 1)
    total = math.fsum(places.probabilities)
    if total > 1.0 + SUM_SLACK:
        raise ValueError(f"places.probabilities: their sum is {total!r}, must be at most 1")


def _possible_diagnostics(diagnostics: RoundDiagnostics) -> RoundDiagnostics:
    _check_depth(diagnostics.details, MAX_DEPTH - 1)
    for name in ("num_entries", "num_frontiers"):
        _check(name, (getattr(diagnostics, name),), 0, MAX_COUNT)
    if len(diagnostics.counters) > MAX_COUNTERS:
        raise ValueError(f"counters must be at most {MAX_COUNTERS}")
    for name, count in diagnostics.counters.items():
        _check(f"counters.{name[:MAX_VALUE]}", (count,), -MAX_COUNT, MAX_COUNT)
    if diagnostics.chosen_entry is not None:
        _possible_entry(diagnostics.chosen_entry)
    if diagnostics.places is not None:
        _check_places(diagnostics.places)
    return replace(diagnostics, choice=diagnostics.choice[:MAX_MESSAGE])


def _check_depth(value: object, depth: int) -> None:
    if not value or not isinstance(value, dict | list):
        return
    if depth == 0:
        raise ValueError(f"lists and dictionaries are deeper than {MAX_DEPTH}")
    for part in value.values() if isinstance(value, dict) else value:
        _check_depth(part, depth - 1)


SENSORS: Part[SensorConfig] = Part("sensors", SensorConfig, MAX_DIAGNOSTICS_BYTES)
"""The sensors that an agent needs; the limits of the protocol are not checked here."""


def write_sensors(agent: Agent) -> bytes:
    """Return an agent's sensors as JSON.

    Raises:
        InvalidArgumentError: The agent has no `sensors`, or they are no `SensorConfig`.
    """
    if not hasattr(agent, "sensors"):
        raise InvalidArgumentError(
            "the agent has no `sensors`: set `self.sensors = SensorConfig()` in `__init__`,"
            " or make its class a subclass of `evonav.Agent`"
        )
    return SENSORS.write(agent.sensors)


DIAGNOSTICS: Part[RoundDiagnostics] = Part(
    "diagnostics", Annotated[RoundDiagnostics, AfterValidator(_possible_diagnostics)], MAX_DIAGNOSTICS_BYTES
)
_Entry = Annotated[EntryBelief, AfterValidator(_possible_entry)]
ENTRY: Part[EntryBelief] = Part("entries", _Entry, MAX_ENTRIES_BYTES)
"""An entry of an object memory."""
ENTRIES: Part[list[EntryBelief]] = Part("entries", Annotated[list[_Entry], FailFast()], MAX_ENTRIES_BYTES)
"""An object memory."""


# An object memory, again and again

_BETWEEN = b",\t"
"""The JSON of an entry has no tab."""


class Entries:
    """The object memory of one agent, written and read as `ENTRIES`."""

    def __init__(self) -> None:
        """Know no entries yet."""
        self._written: dict[int, tuple[object, bytes]] = {}
        """The entries that were written last, and their JSON, by the number of the object."""
        self._read: dict[bytes, EntryBelief] = {}
        """The entries that were read last, by their JSON."""

    def write(self, entries: Sequence[object]) -> bytes:
        """Return entries as JSON in one line; what was written before is not written again.

        Raises:
            InvalidArgumentError: An entry holds what JSON cannot, or they are too large together.
        """
        before, self._written = self._written, {}
        texts = []
        for entry in entries:
            pair = before.get(id(entry)) or (entry, ENTRY.write(entry))
            texts.append(pair[1])
            if id(entry) in before or _is_constant(entry):
                self._written[id(entry)] = pair
        return ENTRIES.checked(b"[%b]" % _BETWEEN.join(texts))

    def read(self, text: bytes) -> list[EntryBelief]:
        """Return the entries of a JSON text; one that was read before is the same object.

        Raises:
            InvalidArgumentError: The text is malformed; the message has the first field that is wrong, and its value.
        """
        is_list = ENTRIES.checked(text).startswith(b"[") and text.endswith(b"]")
        texts = text[1:-1].split(_BETWEEN) if is_list else [text]
        try:
            entries = [self._read.get(one) or ENTRY.read(one) for one in texts]
        except InvalidArgumentError:
            return ENTRIES.read(text)  # which says where in the list it is wrong
        self._read = dict(zip(texts, entries, strict=True))
        return entries


def _is_constant(entry: object) -> bool:
    """Return whether an entry cannot change, nor anything in it: then it has a hash."""
    try:
        hash(entry)
    except TypeError:
        return False
    return type(entry) is EntryBelief


# Costs and failures

_CostName = Literal[
    "decision_wall_s",
    "decision_cpu_s",
    "num_questions",
    "num_replayed",
    "input_tokens",
    "output_tokens",
    "cost_usd",
    "agent_peak_rss_mb",
]
_Amount = Annotated[int, Field(ge=0, le=MAX_COUNT)] | Annotated[float, Field(ge=0, le=MAX_COUNT, allow_inf_nan=False)]
COSTS: Part[dict[_CostName, int | float]] = Part("costs", dict[_CostName, _Amount], MAX_DIAGNOSTICS_BYTES)
"""Costs of an agent's decision model and process."""


@dataclass(frozen=True, slots=True)
class Failure:
    """An exception of an agent."""

    kind: Literal["agent", "decision"]
    message: Annotated[str, AfterValidator(lambda text: text[:MAX_FAILURE])]
    traceback: Annotated[str, AfterValidator(lambda text: text[-MAX_TRACEBACK:])]


MAX_FAILURE = 2 * MAX_MESSAGE
"""Longest description of an exception, with the places where it was raised."""
FAILURE: Part[Failure] = Part("failure", Failure, MAX_DIAGNOSTICS_BYTES)


# Answers


@dataclass(frozen=True, slots=True)
class Head:
    """The first line of an answer."""

    number: int
    """Number of the request."""
    cpu_s: Annotated[float, Field(ge=0, le=MAX_COUNT, allow_inf_nan=False)]
    """CPU time of the process."""
    free_slot: Annotated[int, Field(ge=0, lt=NUM_SLOTS)]
    """Slot of the shared memory for the next request."""
    parts: tuple[str, ...]
    """Names of the lines that follow."""


_HEAD: Part[Head] = Part("", Head, MAX_DIAGNOSTICS_BYTES)


def write_answer(number: int, cpu_s: float, free_slot: int, parts: Mapping[str, bytes]) -> bytes:
    """Return an answer: a line that says what it is, then a line for each part, which is JSON by name."""
    return b"\n".join([to_json(Head(number, cpu_s, free_slot, tuple(parts))), *parts.values()])


def read_answer(message: bytes, number: int) -> tuple[Head, dict[str, bytes]]:
    """Return what an answer says of itself, and the parts, still as JSON.

    Args:
        message: Bytes that `write_answer` returned.
        number: Number of the request that it must answer.

    Raises:
        InvalidArgumentError: It is no answer to the request.
    """
    first, *texts = message.split(b"\n")
    head = _HEAD.read(first)
    if head.number != number:
        raise InvalidArgumentError(f"number = {head.number}: expected {number}")
    if len(head.parts) != len(texts):
        raise InvalidArgumentError(f"parts = {head.parts!r}: {len(texts)} follow")
    return head, dict(zip(head.parts, texts, strict=True))
