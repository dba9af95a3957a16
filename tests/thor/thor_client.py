"""A client to be killed: `python thor_client.py HOUSE [STEPS]` drives a controller, for ever without STEPS.

Says `started PID` (of the engine), `stepped N` now and then, `failed ERROR` and `stopped`.
"""

import contextlib
import json
import sys
from pathlib import Path

from ai2thor.controller import Controller

import evonav.thor


def _say(*words: object) -> None:
    print(*words, flush=True)


def main() -> None:
    house = json.loads(Path(sys.argv[1]).read_text())
    num_steps = int(sys.argv[2]) if len(sys.argv) > 2 else None
    controller = Controller(
        local_executable_path=evonav.thor.executable(), x_display="0", scene=house, server_timeout=3.0
    )
    _say("started", controller.server.unity_proc.pid)
    done = 0
    try:
        while done != num_steps:
            controller.step("RotateRight", degrees=30)
            done += 1
            if done % 10 == 0:
                _say("stepped", done)
    except (Exception, KeyboardInterrupt) as error:
        _say("failed", type(error).__name__)
    # What was not yet sent when the engine went is sent again at closing, in vain.
    with contextlib.suppress(BrokenPipeError):
        controller.stop()
    _say("stopped")


if __name__ == "__main__":
    main()
