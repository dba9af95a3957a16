"""Starts AI2-THOR's process so that it ends with evonav: `python ai2thor_guard.py PARENT_PID IS_BOUND PROGRAM ...`.

Run as a script, before the program takes this process's place; imports nothing of evonav, to be quick.
"""

import os
import signal
import sys

_PR_SET_PDEATHSIG = 1  # linux/prctl.h


def main(parent_pid: int, is_bound: bool, command: list[str]) -> None:
    """Binds this process to its parent and becomes `command`.

    Args:
        parent_pid: Of evonav.
        is_bound: Have the kernel end this process when the thread that started it ends.
        command: Program and arguments.
    """
    os.setsid()  # a group of its own: ended as a whole, and Ctrl-C in the terminal goes to evonav alone
    if is_bound and sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent_pid:  # it ended before the kernel was told
            sys.exit(1)
    try:
        os.execvp(command[0], command)  # noqa: S606 - the caller's own command, without a shell
    except OSError as error:
        sys.exit(f"{command[0]}: {error.strerror}")


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2] == "1", sys.argv[3:])
