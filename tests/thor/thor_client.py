"""A client to be killed: `python thor_client.py HOUSE [--steps N]` drives a controller, for ever without `--steps`.

Says `started PID` (of the engine), `stepped N` now and then, `failed ERROR` and `stopped`.
"""

import argparse
import contextlib
import json
from pathlib import Path

from ai2thor.controller import Controller

import evonav.thor


def _say(*words: object) -> None:
    print(*words, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("house", type=Path)
    parser.add_argument("--steps", type=int)
    parser.add_argument("--size", type=int, default=300)
    parser.add_argument("--timeout", type=float, default=100.0)  # the client's default
    options = parser.parse_args()
    controller = Controller(
        local_executable_path=evonav.thor.executable(),
        x_display="0",
        scene=json.loads(options.house.read_text()),
        width=options.size,
        height=options.size,
        server_timeout=options.timeout,
    )
    _say("started", controller.unity_pid)
    done = 0
    try:
        while done != options.steps:
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
