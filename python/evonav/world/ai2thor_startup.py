"""Starts AI2-THOR, and says what to do where that fails."""

import os
import re
import shlex
import shutil
import signal
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

from evonav.errors import InvalidArgumentError, SimulationError, SimulatorLostError
from evonav.world.simulator import SimulatorConfig

if TYPE_CHECKING:
    from evonav.world.ai2thor_process import GuardedController

OWN_ENGINE = "evonav"
"""As an executable: our own engine, installed with evonav as `evonav-thor`."""

START_TIMEOUTS = 3.0
"""How many timeouts of an answer a start may take."""

_PLAYER_LOG = Path(".config/unity3d/Allen Institute for Artificial Intelligence/AI2-THOR/Player.log")
_LOG_LINES = 12


@dataclass(frozen=True, slots=True)
class Ai2ThorOptions:
    """Which AI2-THOR, and where it draws. By default the client's own build, downloaded on first use."""

    executable: str | None = None
    """Path of a build's executable, or `evonav` for our engine."""
    commit_id: str | None = None
    """Of the build to download; default: the client's."""
    platform: Literal["cloud", "x11"] | None = None
    """`cloud`: on a GPU through Vulkan, without a display. `x11`: on an X display. Default: what the client takes."""
    gpu_device: int | None = None
    """As CUDA counts them."""
    x_display: str | None = None
    """Such as `:0`; default: DISPLAY."""
    timeout_s: float = 100.0
    """For one answer, three times that to come up; a process that takes longer counts as hanging."""

    @property
    def is_own_engine(self) -> bool:
        """Whether it is our engine, which needs neither GPU nor display."""
        return self.executable == OWN_ENGINE

    def check(self) -> None:
        """Refuses options that contradict each other.

        Raises:
            InvalidArgumentError: They do.
        """
        if not self.timeout_s > 0.0:
            raise InvalidArgumentError(f"timeout_s = {self.timeout_s}: must be > 0")
        if self.platform not in (None, "cloud", "x11"):
            raise InvalidArgumentError(f"platform = {self.platform!r}: must be `cloud` or `x11`")
        if self.gpu_device is not None and (self.is_own_engine or self.gpu_device < 0):
            raise InvalidArgumentError(
                f"gpu_device = {self.gpu_device}: "
                + ("evonav's engine draws on the processor" if self.is_own_engine else "must be 0 or more")
            )
        if self.executable is not None and self.commit_id is not None:
            raise InvalidArgumentError("executable and commit_id: give one, an executable is a build already")


class ProcessEndedError(Exception):
    """The process has ended, or speaks nonsense; the message continues `AI2-THOR's process`."""

    @staticmethod
    def of(returncode: int | None) -> "ProcessEndedError":
        """For an exit status; `None` if the process lives on without its pipe."""
        if returncode is None:
            return ProcessEndedError("hung up")
        if returncode < 0:
            with suppress(ValueError):
                return ProcessEndedError(f"was killed by {signal.Signals(-returncode).name}")
        return ProcessEndedError(f"ended with exit code {returncode}")


class ProcessLog:
    """What the simulator's process prints, in a temporary folder of its own."""

    def __init__(self) -> None:
        self._temporary = TemporaryDirectory(prefix="evonav.ai2thor-")
        self._begin_s = time.time()
        self.folder = Path(self._temporary.name)

    def tail(self) -> str:
        """Last lines, and those of Unity's own log if they are of this process's time; empty if there are none."""
        lines: list[str] = []
        for path in (self.folder / "unity.log", Path.home() / _PLAYER_LOG):
            with suppress(OSError):
                if path.stat().st_mtime >= self._begin_s - 1.0:
                    lines += path.read_text(errors="replace").splitlines()[-_LOG_LINES:]
        return "\n".join(line for line in lines if line.strip())

    def close(self) -> None:
        """Removes it; safe to call twice."""
        self._temporary.cleanup()


def start_controller(
    config: SimulatorConfig,
    options: Ai2ThorOptions,
    scene: str | dict[str, Any],
    log: ProcessLog,
) -> "GuardedController":
    """Starts AI2-THOR.

    Args:
        config: Camera and steps.
        options: Which, and where.
        scene: A house, or the name of a scene.
        log: Takes the process's output.

    Raises:
        InvalidArgumentError: The options contradict each other.
        SimulationError: It cannot be started as things are; the message says what to do.
        SimulatorLostError: The process ended or hung while starting.
    """
    options.check()
    try:
        import ai2thor.platform

        from evonav.world.ai2thor_process import GuardedController
    except ImportError as error:
        raise SimulationError(f"AI2-THOR's client cannot be imported ({error}): pip install 'evonav[thor]'") from error
    settings: dict[str, Any] = {
        "scene": scene,
        "width": config.width_px,
        "height": config.height_px,
        "fieldOfView": config.vertical_fov_deg,
        "gridSize": config.grid_m,
        "snapToGrid": False,  # on, AI2-THOR refuses to turn by less than 90 degrees
        "rotateStepDegrees": config.turn_deg,
        "renderDepthImage": True,
        "renderInstanceSegmentation": True,
        "server_timeout": options.timeout_s,
        "server_start_timeout": START_TIMEOUTS * options.timeout_s,
        "gpu_device": options.gpu_device,
        "x_display": _x_display(options),
    }
    if options.executable is not None:
        # The client takes it apart as a shell would.
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
        raise _explained(error, options, log.tail()) from error


def lost(doing: str, error: BaseException, log_tail: str) -> SimulatorLostError:
    """What to raise when the process ended or hung.

    Args:
        doing: What it was asked for.
        error: What the client raised; the cause may be hidden in what that was raised from.
        log_tail: Of the process.
    """
    cause = _cause(error)
    how = f"hangs ({cause})" if isinstance(cause, TimeoutError) else str(cause)
    return SimulatorLostError(f"AI2-THOR's process {how}, {doing}{_logged(log_tail)}")


def _cause(error: BaseException) -> BaseException:
    """What happened: the client wraps it into errors that no longer say it."""
    chain: list[BaseException] = [error]
    while (inner := chain[-1].__cause__ or chain[-1].__context__) is not None:
        chain.append(inner)
    # Of what the client wrapped, the reason is innermost; of our own, what was caught on the way to it is.
    ours = (ProcessEndedError, TimeoutError)
    return next((found for found in reversed(chain) if isinstance(found, ours)), chain[-1])


def _logged(tail: str) -> str:
    return f". The end of its log:\n{tail}" if tail else "; it logged nothing"


def _executable(asked: str) -> Path:
    if asked == OWN_ENGINE:
        beside = Path(sys.executable).with_name("evonav-thor")
        found = str(beside) if beside.is_file() else shutil.which("evonav-thor")
        if found is None:
            raise SimulationError("evonav's engine `evonav-thor` is not on PATH: reinstall evonav")
        return Path(found)
    path = Path(asked).expanduser().resolve()
    if not path.exists():
        raise SimulationError(f"{path}: no such executable of AI2-THOR; `{OWN_ENGINE}` names evonav's own engine")
    if not path.is_file():
        raise SimulationError(f"{path}: a folder; name the executable in it")
    if not os.access(path, os.X_OK):
        raise SimulationError(f"{path}: not executable; chmod +x it")
    return path


def _x_display(options: Ai2ThorOptions) -> str | None:
    """The display for the client, which insists on one for every executable that it is given."""
    display = options.x_display or os.environ.get("DISPLAY")
    if display is None and options.platform == "x11":
        raise SimulationError(
            "no X display: set DISPLAY or --thor-display (`sudo ai2thor-xorg start` makes one on an NVIDIA GPU), "
            "or take --thor-platform cloud, which needs none"
        )
    if display is None and options.executable is not None:
        return "0"  # of no meaning to our engine and to builds for CloudRendering
    return display


def _explained(error: Exception, options: Ai2ThorOptions, log_tail: str) -> SimulationError:
    """An error of the client's start, in words that help."""
    if isinstance(error, SimulationError):
        return error
    cause, text = _cause(error), f"{error}"
    if (told := re.search(r"Unity process has exited.*returncode=(-?\d+)", text, re.DOTALL)) is not None:
        cause = ProcessEndedError.of(int(told[1]))  # of CloudRendering, the client looks itself
    if isinstance(cause, ProcessEndedError):
        advice = _advice(log_tail) if not options.is_own_engine else ""
        return SimulatorLostError(f"AI2-THOR's process {cause} while starting{_logged(log_tail)}{advice}")
    if isinstance(cause, TimeoutError):
        return SimulatorLostError(
            f"AI2-THOR did not come up ({cause}): raise --thor-timeout if the machine is slow{_logged(log_tail)}"
        )
    if "vulkaninfo" in text:
        return SimulationError(
            "AI2-THOR finds GPUs with `vulkaninfo`, which failed: install vulkan-tools and the GPU's driver, "
            "and see that `vulkaninfo` lists the GPU; or leave out --thor-gpu"
        )
    if "nvidia-smi" in text or "Could not find a Vulkan device" in text:
        return SimulationError(
            f"no such GPU ({text}): see what `nvidia-smi -L` and `vulkaninfo` list; "
            f"without a GPU take --thor-executable {OWN_ENGINE}"
        )
    if "Vulkan API driver missing" in text:
        return SimulationError(
            "no Vulkan: CloudRendering needs libvulkan1 and a GPU driver with Vulkan (`vulkaninfo` must list the GPU); "
            f"without a GPU take --thor-executable {OWN_ENGINE}"
        )
    if "No valid X display" in text or "Invalid display" in text:
        return SimulationError(
            f"no usable X display ({text.splitlines()[-1].strip()}): set DISPLAY or --thor-display, "
            "or take --thor-platform cloud"
        )
    if "no build exists" in text or "No build exists" in text:
        return SimulationError(_no_build(options))
    if type(cause).__module__.partition(".")[0] in ("requests", "urllib3") or isinstance(cause, ConnectionError):
        return SimulationError(f"AI2-THOR's build cannot be downloaded: {_short(cause)}. {_WITHOUT_NETWORK}")
    if isinstance(error, OSError):
        return SimulationError(f"AI2-THOR cannot be run: {error}")
    return SimulationError(f"AI2-THOR does not start: {type(error).__name__}: {text or _short(cause)}")


_WITHOUT_NETWORK = (
    "Without a network, copy ~/.ai2thor/releases from a machine with one, name a build with --thor-executable PATH, "
    f"or take --thor-executable {OWN_ENGINE}"
)


def _no_build(options: Ai2ThorOptions) -> str:
    """The client says the same of a build that is not there and of a network that is not: ask again."""
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
    return f"there is no AI2-THOR build {build.name}: another commit_id, another platform, or --thor-executable PATH"


def _short(error: BaseException) -> str:
    text = str(error) or type(error).__name__
    return text if len(text) <= 200 else f"{text[:200]}..."


def _advice(log_tail: str) -> str:
    text = log_tail.lower()
    if "vulkan" in text or "vk_" in text:
        return "\nVulkan failed: `vulkaninfo` must list the GPU (libvulkan1, a driver with Vulkan)"
    if "display" in text or "x11" in text:
        return "\nThe display failed: check --thor-display, or take --thor-platform cloud"
    return ""
