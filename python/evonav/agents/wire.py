"""What an agent says, as JSON: the only thing that ever leaves an agent's process.

The evaluator reads it the same way whether the agent runs in a process of its own or not, so that the records of both
are the same. Nothing here trusts what it reads.
"""

import json
import math
import re
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from types import TracebackType
from typing import Any

import numpy as np

from evonav.agents.agent import (
    AgentAction,
    EntryBelief,
    Move,
    NavigateTo,
    RoundDiagnostics,
    Sensing,
    Stop,
    ViewSchedule,
)
from evonav.errors import InvalidArgumentError
from evonav.world.simulator import Action

MAX_DIAGNOSTICS_BYTES = 1_000_000
"""Of a round, as JSON: they are kept in the records."""
MAX_ENTRIES_BYTES = 16_000_000
MAX_DEPTH = 32
"""Of lists and dictionaries in each other."""
MAX_MESSAGE = 2000
"""Characters of an error's message that are kept."""
MAX_TRACEBACK = 20_000
"""Characters of a traceback that are kept: the last."""
NUM_FRAMES = 3
"""Of a traceback, the innermost ones."""

_OURS = ("evonav.agents.wire", "evonav.agents.serving")
_ADDRESS = re.compile(r"0x[0-9a-fA-F]{6,}")
_CONTAINERS = (dict, list, tuple)
_SURROGATE = re.compile(rb"\\u[dD][89a-fA-F]")


def describe(error: BaseException, *, caller: str | None = None) -> str:
    """Describe an agent's exception in a line or few: type, message and places, the innermost place last.

    The text is the same in whatever process and at whatever address the exception was raised.

    Args:
        error: The exception.
        caller: Package that called the agent in this process; its own places are left out.
    """
    try:
        text = str(error)
    except Exception:
        text = "(its message cannot be read)"
    text = _ADDRESS.sub("0x...", f"{type(error).__name__}: {text}")
    text = clean(text if len(text) <= MAX_MESSAGE else text[:MAX_MESSAGE] + " ...")
    places = _places(error.__traceback__, _OURS if caller is None else (*_OURS, f"{caller}."))
    return f"{text} [{' > '.join(places)}]" if places else text


def traceback_of(error: BaseException) -> str:
    """All of an exception, for the one who looks for its cause; not the same wherever it was raised."""
    try:
        return clean("".join(traceback.format_exception(error)))[-MAX_TRACEBACK:]
    except Exception:  # of a message that cannot be read
        return f"{type(error).__name__}"


def _places(trace: TracebackType | None, outside: tuple[str, ...]) -> list[str]:
    places: list[str] = []
    while trace is not None:
        module = str(trace.tb_frame.f_globals.get("__name__", "?"))
        if places or not module.startswith(outside):
            places.append(clean(f"{module}:{trace.tb_lineno} in {trace.tb_frame.f_code.co_name}"))
        trace = trace.tb_next
    return places[-NUM_FRAMES:]


def clean(text: str) -> str:
    """Text that every file can hold: no halves of surrogate pairs."""
    return text.encode("utf-8", "replace").decode()


def checked_action(action: object, sensing: Sensing) -> AgentAction:
    """What an agent answered, if it is an action.

    Raises:
        InvalidArgumentError: It is not, has a coordinate that is not a finite number, or is a `NavigateTo` of an agent
            whose budget counts single actions.
    """
    if isinstance(action, Move) and isinstance(action.action, Action):
        return Stop() if action.action is Action.STOP else action
    if isinstance(action, NavigateTo):
        if sensing.motion == "actions":
            raise InvalidArgumentError("NavigateTo: an agent whose `sensing.motion` is `actions` answers Move or Stop")
        position_m = _finite_point("position_m", action.position_m)
        face_m = None if action.face_m is None else _finite_point("face_m", action.face_m)
        return replace(action, position_m=position_m, face_m=face_m)
    if isinstance(action, Stop):
        return Stop(clean(str(action.reason))[:MAX_MESSAGE])
    raise InvalidArgumentError(f"{action!r} is no action: answer Move(Action), NavigateTo((x, z)) or Stop()")


def _finite_point(name: str, point_m: object) -> tuple[float, float]:
    try:
        x_m, z_m = (float(value) for value in point_m)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InvalidArgumentError(f"NavigateTo.{name} = {point_m!r}: must be (x, z)") from None
    if not (math.isfinite(x_m) and math.isfinite(z_m)):
        raise InvalidArgumentError(f"NavigateTo.{name} = {point_m!r}: must be finite")
    return x_m, z_m


def action_json(action: AgentAction) -> str:
    """A checked action."""
    if isinstance(action, NavigateTo):
        return json.dumps({"kind": "navigate_to", "position_m": action.position_m, "face_m": action.face_m})
    if isinstance(action, Move):
        return json.dumps({"kind": "move", "action": action.action.value})
    return json.dumps({"kind": "stop", "reason": action.reason})


def action_of(said: Any, sensing: Sensing) -> AgentAction:  # noqa: ANN401 - JSON
    """The action that was said.

    Raises:
        InvalidArgumentError: It is none.
    """
    try:
        kind = said["kind"]
        if kind == "navigate_to":
            face_m = said["face_m"]
            found: AgentAction = NavigateTo(tuple(said["position_m"]), None if face_m is None else tuple(face_m))
        elif kind == "move":
            found = Move(Action(said["action"]))
        elif kind == "stop":
            found = Stop(str(said["reason"]))
        else:
            raise InvalidArgumentError(f"`{kind}` is no kind of action")
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidArgumentError(f"no action: {type(error).__name__}: {error}") from error
    return checked_action(found, sensing)


def sensing_json(sensing: Sensing) -> str:
    """What an agent asks of its sensors."""
    if not isinstance(sensing, Sensing):
        raise InvalidArgumentError(f"sensing = {sensing!r}: must be a `Sensing`")
    return _dumped("sensing", asdict(sensing), MAX_DIAGNOSTICS_BYTES)


def sensing_of(said: Any) -> Sensing:  # noqa: ANN401 - JSON
    """The sensing that was said; the protocol's caps are not looked at here.

    Raises:
        InvalidArgumentError: It is none.
    """
    try:
        schedules = {
            name: ViewSchedule(_whole(said[name]["count"]), float(said[name]["spacing_deg"]))
            for name in ("first_round", "later_rounds")
        }
        return Sensing(
            **schedules,
            needs_rgb=bool(said["needs_rgb"]),
            motion=said["motion"],
            max_travel_m=float(said["max_travel_m"]),
            occupancy_range_m=float(said["occupancy_range_m"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidArgumentError(f"no sensing: {type(error).__name__}: {error}") from error


def diagnostics_json(told: RoundDiagnostics) -> str:
    """A round in the agent's own words.

    Raises:
        InvalidArgumentError: It is no `RoundDiagnostics`, not JSON-ready, or too large to be kept.
    """
    if not isinstance(told, RoundDiagnostics):
        raise InvalidArgumentError(f"diagnostics() answered {type(told).__name__}: must be a `RoundDiagnostics`")
    entry = told.chosen_entry
    return _dumped(
        "diagnostics",
        {
            "choice": told.choice,
            "chosen_entry": None if entry is None else _entry_row(entry),
            "num_entries": told.num_entries,
            "num_frontiers": told.num_frontiers,
            "counters": told.counters,
            "details": told.details,
        },
        MAX_DIAGNOSTICS_BYTES,
    )


def diagnostics_of(said: Any) -> RoundDiagnostics:  # noqa: ANN401 - JSON
    """The diagnostics that were said.

    Raises:
        InvalidArgumentError: They are none.
    """
    try:
        entry, counters, details = said["chosen_entry"], said["counters"], said["details"]
        if not isinstance(counters, Mapping) or not isinstance(details, Mapping):
            raise TypeError("counters and details must be dictionaries")
        return RoundDiagnostics(
            choice=str(said["choice"]),
            chosen_entry=None if entry is None else _entry_of(entry),
            num_entries=_whole(said["num_entries"]),
            num_frontiers=_whole(said["num_frontiers"]),
            counters={str(name): _whole(count) for name, count in counters.items()},
            details=dict(details),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidArgumentError(f"no diagnostics: {type(error).__name__}: {error}") from error


def entries_json(entries: Sequence[EntryBelief]) -> str:
    """An object memory.

    Raises:
        InvalidArgumentError: It is none, or too large to be kept.
    """
    return _dumped("entries", [_entry_row(entry) for entry in entries], MAX_ENTRIES_BYTES)


def entries_of(said: Any) -> list[EntryBelief]:  # noqa: ANN401 - JSON
    """The object memory that was said.

    Raises:
        InvalidArgumentError: It is none.
    """
    try:
        return [_entry_of(row) for row in said]
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidArgumentError(f"no entries: {type(error).__name__}: {error}") from error


COSTS = (
    "decision_wall_s",
    "decision_cpu_s",
    "num_questions",
    "num_replayed",
    "input_tokens",
    "output_tokens",
    "cost_usd",
    "agent_peak_rss_mb",
)
"""What an agent's process may say of its costs."""


def costs_of(said: Any) -> dict[str, float]:  # noqa: ANN401 - JSON
    """The costs that were said, as far as they are numbers: they decide nothing."""
    if not isinstance(said, Mapping):
        return {}
    told = {name: said[name] for name in COSTS if name in said}
    return {
        name: value
        for name, value in told.items()
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value >= 0
    }


def read_json(text: bytes) -> Any:  # noqa: ANN401 - JSON
    """JSON that a stranger wrote.

    Raises:
        ValueError: It is no JSON, or too deep.
    """
    try:
        said = json.loads(text)
        if _SURROGATE.search(text):
            said = json.loads(json.dumps(said, ensure_ascii=False).encode("utf-8", "replace"))
    except RecursionError:
        raise ValueError("lists and dictionaries are too deep") from None
    _check_depth(said, MAX_DEPTH + 2)  # an answer holds the agent's own words
    return said


def _check_depth(said: object, depth: int) -> None:
    if not said or not isinstance(said, _CONTAINERS):
        return
    if depth == 0:
        raise ValueError(f"lists and dictionaries are deeper than {MAX_DEPTH}")
    for part in said.values() if isinstance(said, dict) else said:
        if isinstance(part, _CONTAINERS):
            _check_depth(part, depth - 1)


def _entry_row(entry: EntryBelief) -> list[Any]:
    if not isinstance(entry, EntryBelief):
        raise InvalidArgumentError(f"an entry is {type(entry).__name__}: must be an `EntryBelief`")
    return [entry.entry_id, entry.label, list(entry.centre_m), list(entry.size_m), entry.num_detections]


def _entry_of(row: Any) -> EntryBelief:  # noqa: ANN401 - JSON
    entry_id, label, centre_m, size_m, num_detections = row
    return EntryBelief(_whole(entry_id), str(label), _point3(centre_m), _point3(size_m), _whole(num_detections))


def _point3(values: Any) -> tuple[float, float, float]:  # noqa: ANN401 - JSON
    x_m, y_m, z_m = (float(value) for value in values)
    return x_m, y_m, z_m


def _whole(value: Any) -> int:  # noqa: ANN401 - JSON
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"{value!r} is no whole number")
    return value


def _dumped(name: str, value: object, max_bytes: int) -> str:
    try:
        _check_depth(value, MAX_DEPTH)
        text = json.dumps(value, default=_plain)
    except (TypeError, ValueError, RecursionError) as error:
        raise InvalidArgumentError(f"{name}: not JSON-ready: {error}") from error
    if len(text) > max_bytes:
        raise InvalidArgumentError(f"{name}: {len(text)} bytes of JSON: must be at most {max_bytes}")
    return text


def _plain(value: object) -> object:
    """NumPy's numbers as Python's."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} is no JSON")
