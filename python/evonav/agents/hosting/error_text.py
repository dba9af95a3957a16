"""Describe an agent's exceptions, the same way in whatever process they were raised."""

import re
import traceback
from types import TracebackType

MAX_MESSAGE = 2000
"""Longest message of an error, in characters."""
MAX_TRACEBACK = 20_000
"""Longest traceback, in characters; its end is what remains."""
MAX_NAME = 200
"""Longest name of a type, module or function in a message, in characters."""
NUM_FRAMES = 3
"""Number of places of a traceback, the innermost ones."""

COLOURS_HINT = "`view.rgb` is None unless the agent asks for colours: `SensorConfig(needs_rgb=True)`"

_OURS = ("evonav.agents.hosting.", "evonav.agents.explanation")
_ADDRESS = re.compile(r"0x[0-9a-fA-F]{6,}")


def describe(error: BaseException, *, caller: str | None = None) -> str:
    """Describe an agent's exception in a line or few: type, message and places, the innermost place last.

    The text is the same in whatever process and at whatever address the exception was raised.

    Args:
        caller: Package that called the agent in this process; its own places are left out.
    """
    text = _bounded(_ADDRESS.sub("0x...", f"{_type_name(error)}: {_message(error)}"))
    if "NoneType" in text and _reads_colours(error.__traceback__):
        text += f" ({COLOURS_HINT})"
    places = _places(error.__traceback__, _OURS if caller is None else (*_OURS, f"{caller}."))
    return f"{text} [{' > '.join(places)}]" if places else text


def message_of(error: BaseException) -> str:
    """Return an exception's message alone, cut to its limit."""
    return _bounded(_message(error))


def traceback_of(error: BaseException) -> str:
    """Return the whole traceback, for people who look for the cause; it differs from process to process."""
    try:
        return clean("".join(traceback.format_exception(error)))[-MAX_TRACEBACK:]
    except KeyboardInterrupt:
        raise
    except BaseException:  # its message cannot be read
        return _type_name(error)


def clean(text: str) -> str:
    """Return text that every file can hold: halves of surrogate pairs become question marks."""
    return text.encode("utf-8", "replace").decode()


def _bounded(text: str) -> str:
    return clean(text if len(text) <= MAX_MESSAGE else text[:MAX_MESSAGE] + " ...")


def _type_name(error: BaseException) -> str:
    """Return the name of an exception's type, which its metaclass cannot hide."""
    name: str = type.__dict__["__name__"].__get__(type(error))
    return name[:MAX_NAME]


def _message(error: BaseException) -> str:
    """Return an exception's message, cut to a few times its limit; the agent's code may run, and raise anything."""
    try:
        return str(error)[: 4 * MAX_MESSAGE]
    except KeyboardInterrupt:
        raise
    except BaseException:
        return "(its message cannot be read)"


def _places(trace: TracebackType | None, outside: tuple[str, ...]) -> list[str]:
    places: list[str] = []
    while trace is not None:
        found = trace.tb_frame.f_globals.get("__name__")
        module = found[:MAX_NAME] if isinstance(found, str) else "?"
        if places or not module.startswith(outside):
            places.append(clean(f"{module}:{trace.tb_lineno} in {trace.tb_frame.f_code.co_name[:MAX_NAME]}"))
        trace = trace.tb_next
    return places[-NUM_FRAMES:]


def _reads_colours(trace: TracebackType | None) -> bool:
    """Return true if a function of the traceback reads an attribute `rgb`."""
    while trace is not None:
        if "rgb" in trace.tb_frame.f_code.co_names:
            return True
        trace = trace.tb_next
    return False
