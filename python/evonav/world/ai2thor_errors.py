"""Define the error of an AI2-THOR process that ended."""

import signal
from contextlib import suppress


class ProcessEndedError(Exception):
    """The process ended, or broke the protocol; the message continues `AI2-THOR's process`."""

    @staticmethod
    def of(returncode: int | None) -> "ProcessEndedError":
        """Return the error for an exit status; `None` if the process still runs without its pipe."""
        if returncode is None:
            return ProcessEndedError("hung up")
        if returncode < 0:
            with suppress(ValueError):
                return ProcessEndedError(f"was killed by {signal.Signals(-returncode).name}")
        return ProcessEndedError(f"ended with exit code {returncode}")
