"""An AI2-THOR-compatible engine: what `ai2thor.controller.Controller(local_executable_path=...)` starts for Unity.

The `ai2thor` package is not needed here: the engine is a process of its own that speaks its client's wire protocol
(`fifo`). Degrees live in this package and nowhere below it.
"""

import shlex
import shutil
import sys
import sysconfig
from pathlib import Path

from evonav.errors import SimulationError

__all__ = ["executable"]


def executable() -> str:
    """What to pass as `local_executable_path`: the installed `evonav-thor`, quoted as the client needs it.

    Raises:
        SimulationError: It is not installed.
    """
    folders = (Path(sys.executable).parent, Path(sysconfig.get_path("scripts")))
    found = next((str(f / "evonav-thor") for f in folders if (f / "evonav-thor").is_file()), None)
    found = found or shutil.which("evonav-thor")
    if found is None:
        places = ", ".join(dict.fromkeys(str(folder) for folder in folders))
        raise SimulationError(f"evonav-thor is neither in {places} nor on the PATH: install evonav there")
    # The client splits the path as a shell does.
    return shlex.quote(found)
