"""An AI2-THOR-compatible engine, which `ai2thor.controller.Controller(local_executable_path=...)` starts like Unity.

The engine does not need the `ai2thor` package: it is a separate process that speaks the wire protocol of AI2-THOR's
client (`transport`). Angles are in degrees in this package and in radians everywhere below it.
"""

import shlex

__all__ = ["executable"]


def executable() -> str:
    """Return the value for `local_executable_path`: the installed `evonav-thor`, quoted as the client needs it.

    Raises:
        SimulationError: The program is not installed.
    """
    from evonav.world.ai2thor.startup import own_engine  # the engine's own process must start without NumPy

    # The client splits the path like a shell.
    return shlex.quote(str(own_engine()))
