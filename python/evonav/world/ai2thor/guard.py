"""Start AI2-THOR's process so that it ends with evonav: `python guard.py PARENT_PID IS_BOUND PROGRAM ...`.

This is a script. It imports nothing of evonav, to start quickly, and is then replaced by the program. It also defines
the error of a process that ended.
"""

import os
import signal
import sys
from contextlib import suppress

_PR_SET_PDEATHSIG = 1  # linux/prctl.h


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


def main(parent_pid: int, is_bound: bool, command: list[str]) -> None:
    """Bind this process to its parent and become `command`.

    Args:
        parent_pid: Process id of evonav.
        is_bound: Whether the kernel ends this process when the thread that started it ends.
        command: Program and arguments.
    """
    os.setsid()  # a group of its own: it is ended as a whole, and Ctrl-C in the terminal goes to evonav alone
    if is_bound and sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent_pid:  # the parent ended before the request reached the kernel
            sys.exit(1)
    try:
        os.execvp(command[0], command)  # noqa: S606 - the caller's own command, without a shell
    except OSError as error:
        sys.exit(f"{command[0]}: {error.strerror}")


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2] == "1", sys.argv[3:])
