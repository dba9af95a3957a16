"""Start AI2-THOR's process so that it ends with evonav: `python ai2thor_guard.py PARENT_PID IS_BOUND PROGRAM ...`.

This is a script. It imports nothing of evonav, to start quickly, and is then replaced by the program.
"""

import os
import signal
import sys

_PR_SET_PDEATHSIG = 1  # linux/prctl.h


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
