"""Start AI2-THOR, and explain what to do where that fails."""

import os
import re
import shlex
import shutil
import sys
import sysconfig
import time
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from evonav.errors import InvalidArgumentError, SimulationError, SimulatorLostError
from evonav.records import Record
from evonav.world.ai2thor.guard import ProcessEndedError
from evonav.world.simulator import SimulatorConfig

if TYPE_CHECKING:
    from evonav.world.ai2thor.process import GuardedController

OWN_ENGINE = "evonav"
"""Name of evonav's own engine as an executable; it is installed with evonav as `evonav-thor`."""

START_TIMEOUTS = 3.0
"""Time limit of a start, in timeouts of one answer."""

_PLAYER_LOG = Path(".config/unity3d/Allen Institute for Artificial Intelligence/AI2-THOR/Player.log")
_LOG_LINES = 12


class Ai2ThorOptions(Record):
    """Build of AI2-THOR and its rendering device."""

    executable: str | None = None
    """AI2-THOR: path of a build's executable, or `evonav` for our engine. Default: download a build."""
    commit_id: str | None = None
    """AI2-THOR: commit of the build to download. Default: the client's."""
    platform: Literal["cloud", "x11"] | None = None
    """AI2-THOR: draw with Vulkan and no display (cloud), or on an X display (x11). Default: the client's choice."""
    gpu_device: int | None = Field(default=None, ge=0)
    """AI2-THOR: index of the GPU that draws, as CUDA counts."""
    x_display: str | None = None
    """AI2-THOR: X display, such as :0. Default: DISPLAY."""
    timeout_s: float = Field(default=100.0, gt=0.0)
    """AI2-THOR: seconds to wait for an answer before it is restarted; starting may take three times as long.
    Default: 100."""

    @property
    def is_own_engine(self) -> bool:
        """Whether it is evonav's engine, which needs neither GPU nor display."""
        return self.executable == OWN_ENGINE

    def check(self) -> None:
        """Reject options that contradict each other.

        Raises:
            InvalidArgumentError: The options contradict each other.
        """
        if self.gpu_device is not None and self.is_own_engine:
            raise InvalidArgumentError(f"gpu_device = {self.gpu_device}: evonav's engine draws on the processor")
        if self.executable is not None and self.commit_id is not None:
            raise InvalidArgumentError("executable and commit_id: give one, an executable is a build already")


class ProcessLog:
    """The output of the simulator's process, in a temporary folder of its own."""

    def __init__(self) -> None:
        self._temporary = TemporaryDirectory(prefix="evonav.ai2thor-")
        self._begin_s = time.time()
        self.folder = Path(self._temporary.name)

    def tail(self) -> str:
        """Return the last lines, with those of Unity's own log if this process wrote them; empty without any."""
        lines: list[str] = []
        for path in (self.folder / "unity.log", Path.home() / _PLAYER_LOG):
            with suppress(OSError):
                if path.stat().st_mtime >= self._begin_s - 1.0:
                    lines += path.read_text(errors="replace").splitlines()[-_LOG_LINES:]
        return "\n".join(line for line in lines if line.strip())

    def close(self) -> None:
        """Remove the log; safe to call twice."""
        self._temporary.cleanup()


def start_controller(
    config: SimulatorConfig,
    options: Ai2ThorOptions,
    scene: str | dict[str, Any],
    log: ProcessLog,
) -> "GuardedController":
    """Start AI2-THOR.

    Args:
        config: Camera and steps.
        options: Build and rendering device.
        scene: A house, or the name of a scene.
        log: Log that receives the process's output.

    Raises:
        InvalidArgumentError: The options contradict each other.
        SimulationError: It cannot be started here; the message says what to do.
        SimulatorLostError: The process ended or did not answer while starting.
    """
    options.check()
    try:
        import ai2thor.platform

        from evonav.world.ai2thor.process import GuardedController
    except ImportError as error:
        raise SimulationError(f"AI2-THOR's client cannot be imported ({error}): pip install 'evonav[thor]'") from error
    settings: dict[str, Any] = {
        "scene": scene,
        "width": config.width_px,
        "height": config.height_px,
        "fieldOfView": config.vertical_fov_deg,
        "gridSize": config.grid_m,
        "snapToGrid": False,  # if true, AI2-THOR refuses turns of less than 90 degrees
        "rotateStepDegrees": config.turn_deg,
        "renderDepthImage": True,
        "renderInstanceSegmentation": True,
        "server_timeout": options.timeout_s,
        "server_start_timeout": START_TIMEOUTS * options.timeout_s,
        "gpu_device": options.gpu_device,
        "x_display": _x_display(options),
    }
    if options.executable is not None:
        # The client splits it like a shell.
        settings["local_executable_path"] = shlex.quote(str(_executable(options.executable)))
    else:
        if options.platform is not None:
            name = {"cloud": "CloudRendering", "x11": "Linux64"}[options.platform]
            settings["platform"] = getattr(ai2thor.platform, name)
        if options.commit_id is not None:
            settings["commit_id"] = options.commit_id
    try:
        return GuardedController(log_dir=log.folder, uses_gpu=not options.is_own_engine, **settings)
    except Exception as error:
        raise _helpful_error(error, options, log.tail()) from error


def lost(doing: str, error: BaseException, log_tail: str) -> SimulatorLostError:
    """Return the error to raise when the process ended or hung.

    Args:
        doing: Present participle of the work that failed.
        error: Error that the client raised; its cause may be among those it was raised from.
        log_tail: End of the process's log.
    """
    cause = _cause(error)
    how = f"hangs ({cause})" if isinstance(cause, TimeoutError) else str(cause)
    return SimulatorLostError(f"AI2-THOR's process {how}, {doing}{_logged(log_tail)}")


def _cause(error: BaseException) -> BaseException:
    """Return the original error: the client wraps it into errors that do not contain its message."""
    chain: list[BaseException] = [error]
    while (inner := chain[-1].__cause__ or chain[-1].__context__) is not None:
        chain.append(inner)
    # The reason is the innermost of the errors that the client wrapped, and the outermost of our own.
    ours = (ProcessEndedError, TimeoutError)
    return next((found for found in reversed(chain) if isinstance(found, ours)), chain[-1])


def _logged(tail: str) -> str:
    return f". The end of its log:\n{tail}" if tail else "; it logged nothing"


def own_engine() -> Path:
    """Return the program of evonav's engine.

    Raises:
        SimulationError: It is not installed.
    """
    folders = (Path(sys.executable).parent, Path(sysconfig.get_path("scripts")))
    found = next((str(f / "evonav-thor") for f in folders if (f / "evonav-thor").is_file()), None)
    found = found or shutil.which("evonav-thor")
    if found is None:
        places = ", ".join(dict.fromkeys(str(folder) for folder in folders))
        raise SimulationError(f"evonav-thor is neither in {places} nor on the PATH: install evonav there")
    return Path(found)


def _executable(named: str) -> Path:
    if named == OWN_ENGINE:
        return own_engine()
    path = Path(named).expanduser().resolve()
    if not path.exists():
        raise SimulationError(f"{path}: no such executable of AI2-THOR; `{OWN_ENGINE}` names evonav's own engine")
    if not path.is_file():
        raise SimulationError(f"{path}: a folder; name the executable in it")
    if not os.access(path, os.X_OK):
        raise SimulationError(f"{path}: not executable; chmod +x it")
    return path


def _x_display(options: Ai2ThorOptions) -> str | None:
    """Return the display for the client, which demands one for every executable that it is given."""
    display = options.x_display or os.environ.get("DISPLAY")
    if display is None and options.platform == "x11":
        raise SimulationError(
            "no X display: set DISPLAY or simulator.x_display (`sudo ai2thor-xorg start` makes one on an NVIDIA GPU), "
            "or take simulator.platform=cloud, which needs none"
        )
    if display is None and options.executable is not None:
        return "0"  # without meaning for evonav's engine and for builds of CloudRendering
    return display


def _helpful_error(error: Exception, options: Ai2ThorOptions, log_tail: str) -> SimulationError:
    """Turn an error of the client's start into one that says what to do."""
    if isinstance(error, SimulationError):
        return error
    cause, text = _cause(error), f"{error}"
    if (exited := re.search(r"Unity process has exited.*returncode=(-?\d+)", text, re.DOTALL)) is not None:
        cause = ProcessEndedError.of(int(exited[1]))  # for CloudRendering, the client itself checks the process
    if isinstance(cause, ProcessEndedError):
        advice = _advice(log_tail) if not options.is_own_engine else ""
        return SimulatorLostError(f"AI2-THOR's process {cause} while starting{_logged(log_tail)}{advice}")
    if isinstance(cause, TimeoutError):
        return SimulatorLostError(
            f"AI2-THOR did not come up ({cause}): raise simulator.timeout_s if the machine is slow{_logged(log_tail)}"
        )
    if "vulkaninfo" in text:
        return SimulationError(
            "AI2-THOR finds GPUs with `vulkaninfo`, which failed: install vulkan-tools and the GPU's driver, "
            "and see that `vulkaninfo` lists the GPU; or leave out simulator.gpu_device"
        )
    if "nvidia-smi" in text or "Could not find a Vulkan device" in text:
        return SimulationError(
            f"no such GPU ({text}): see what `nvidia-smi -L` and `vulkaninfo` list; "
            f"without a GPU take simulator.executable={OWN_ENGINE}"
        )
    if "Vulkan API driver missing" in text:
        return SimulationError(
            "no Vulkan: CloudRendering needs libvulkan1 and a GPU driver with Vulkan (`vulkaninfo` must list the GPU); "
            f"without a GPU take simulator.executable={OWN_ENGINE}"
        )
    if "No valid X display" in text or "Invalid display" in text:
        return SimulationError(
            f"no usable X display ({text.splitlines()[-1].strip()}): set DISPLAY or simulator.x_display, "
            "or take simulator.platform=cloud"
        )
    if "no build exists" in text or "No build exists" in text:
        return SimulationError(_no_build(options))
    if type(cause).__module__.partition(".")[0] in ("requests", "urllib3") or isinstance(cause, ConnectionError):
        return SimulationError(f"AI2-THOR's build cannot be downloaded: {_short(cause)}. {_WITHOUT_NETWORK}")
    if isinstance(error, OSError):
        return SimulationError(f"AI2-THOR cannot be run: {error}")
    return SimulationError(f"AI2-THOR does not start: {type(error).__name__}: {text or _short(cause)}")


_WITHOUT_NETWORK = (
    "Without a network, copy ~/.ai2thor/releases from a machine with one, name a build with simulator.executable=PATH, "
    f"or take simulator.executable={OWN_ENGINE}"
)


def _no_build(options: Ai2ThorOptions) -> str:
    """Find out whether the build or the network is missing: the client reports both alike."""
    import ai2thor.build
    import ai2thor.platform
    import requests

    commit = options.commit_id or ai2thor.build.COMMIT_ID
    name = "CloudRendering" if options.platform == "cloud" else "Linux64"
    build = ai2thor.build.Build(getattr(ai2thor.platform, name), commit, False)
    try:
        requests.head(build.url, timeout=10.0)
    except requests.RequestException as error:
        return f"AI2-THOR's build cannot be downloaded: {_short(error)}. {_WITHOUT_NETWORK}"
    return f"there is no AI2-THOR build {build.name}: another commit_id, another platform, or simulator.executable=PATH"


def _short(error: BaseException) -> str:
    text = str(error) or type(error).__name__
    return text if len(text) <= 200 else f"{text[:200]}..."


def _advice(log_tail: str) -> str:
    text = log_tail.lower()
    if "vulkan" in text or "vk_" in text:
        return "\nVulkan failed: `vulkaninfo` must list the GPU (libvulkan1, a driver with Vulkan)"
    if "display" in text or "x11" in text:
        return "\nThe display failed: check simulator.x_display, or take simulator.platform=cloud"
    return ""
