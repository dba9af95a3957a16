"""An AI2-THOR-compatible engine, which `ai2thor.controller.Controller(local_executable_path=...)` starts like Unity.

The engine does not need the `ai2thor` package: it is a separate process that speaks the wire protocol of AI2-THOR's
client (`transport`). Angles are in degrees in this package and in radians everywhere below it.
"""

import shlex
import shutil
import sys
import sysconfig
from pathlib import Path

from evonav.errors import SimulationError

__all__ = ["executable"]


def executable() -> str:
    """Return the value for `local_executable_path`: the installed `evonav-thor`, quoted as the client needs it.

    Raises:
        SimulationError: The program is not installed.
    """
    folders = (Path(sys.executable).parent, Path(sysconfig.get_path("scripts")))
    found = next((str(f / "evonav-thor") for f in folders if (f / "evonav-thor").is_file()), None)
    found = found or shutil.which("evonav-thor")
    if found is None:
        places = ", ".join(dict.fromkeys(str(folder) for folder in folders))
        raise SimulationError(f"evonav-thor is neither in {places} nor on the PATH: install evonav there")
    # The client splits the path like a shell.
    return shlex.quote(found)
