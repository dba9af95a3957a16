"""What does not start says why, and leaves nothing behind."""

import os
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from evonav.errors import InvalidArgumentError, SimulationError, SimulatorLostError
from evonav.world.ai2thor import Ai2ThorOptions, Ai2ThorSimulator
from evonav.world.simulator import SimulatorConfig

pytest.importorskip("ai2thor", reason="the thor dependency group (ai2thor) is not installed")
Script = Callable[[str], str]


@pytest.fixture(autouse=True)
def _machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A home folder without builds, and neither display nor GPU named."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for name in ("DISPLAY", "CUDA_VISIBLE_DEVICES"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def script(tmp_path: Path) -> Script:
    """Makes an executable shell script."""

    def make(body: str) -> str:
        path = tmp_path / "build with spaces" / "thor"
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"#!/bin/sh\n{body}\n")
        path.chmod(0o755)
        return str(path)

    return make


@pytest.fixture
def _no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything goes through a proxy that nobody serves."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{probe.getsockname()[1]}"
    for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"):
        monkeypatch.setenv(name, address)
    for name in ("no_proxy", "NO_PROXY"):
        monkeypatch.delenv(name, raising=False)


def failure(options: Ai2ThorOptions) -> str:
    """Message of the error that starting gives."""
    simulator = Ai2ThorSimulator(options=options)
    with pytest.raises(SimulationError) as raised:
        simulator.start()
    simulator.close()
    return str(raised.value)


def build(home: Path, platform: str, commit: str = "abc") -> None:
    """A downloaded build, as far as the client looks."""
    folder = home / ".ai2thor" / "releases" / f"thor-{platform}-{commit}"
    folder.mkdir(parents=True)
    (folder / "metadata.json").write_text('{"server_types": ["FIFO", "WSGI"]}')
    program = folder / f"thor-{platform}-{commit}"
    program.write_text("#!/bin/sh\necho 'no Vulkan device' >&2\nexit 3\n")
    program.chmod(0o755)


def test_the_error_for_a_process_that_ends_at_once_has_its_log(script: Script) -> None:
    began_s = time.monotonic()
    with pytest.raises(SimulatorLostError, match=r"(?s)ended with exit code 7 while starting.*cannot find the moon"):
        Ai2ThorSimulator(options=Ai2ThorOptions(executable=script("echo cannot find the moon >&2; exit 7"))).start()
    assert time.monotonic() - began_s < 5.0
    assert "SIGSEGV" in failure(Ai2ThorOptions(executable=script("kill -SEGV $$")))


@pytest.mark.parametrize(
    ("printed", "advice"),
    [("Failed to create Vulkan instance", "vulkaninfo"), ("Unable to open DISPLAY", "simulator.x_display")],
)
def test_errors_in_the_log_become_advice(script: Script, printed: str, advice: str) -> None:
    assert advice in failure(Ai2ThorOptions(executable=script(f"echo {printed}; exit 1")))


def test_a_process_that_does_not_answer_is_ended(script: Script, tmp_path: Path) -> None:
    pid_file = tmp_path / "pid"
    message = failure(
        Ai2ThorOptions(executable=script(f"echo $$ > '{pid_file}'; echo loading; sleep 600"), timeout_s=0.3)
    )
    assert "did not come up" in message
    assert "simulator.timeout_s" in message
    assert "loading" in message
    assert not _is_alive(int(pid_file.read_text()))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, "no such executable"),
        (lambda path: path.mkdir(), "a folder"),
        (lambda path: path.write_text("#!/bin/sh\n"), "chmod"),
    ],
)
def test_a_wrong_executable_is_reported(tmp_path: Path, make: Callable[[Path], object], words: str) -> None:
    path = tmp_path / "thor"
    make(path)
    assert words in failure(Ai2ThorOptions(executable=str(path)))


def test_a_file_that_cannot_be_executed_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "thor"
    path.write_bytes(b"\x7fELF not really")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    assert "Exec format error" in failure(Ai2ThorOptions(executable=str(path)))


def test_a_display_is_required_only_where_it_is_needed(script: Script) -> None:
    assert "no X display" in failure(Ai2ThorOptions(platform="x11"))
    assert "no X display" in failure(Ai2ThorOptions(executable=script("exit 0"), platform="x11"))
    # A build given by path may draw without one, so it is started.
    assert "while starting" in failure(Ai2ThorOptions(executable=script("exit 0")))


@pytest.mark.filterwarnings("ignore:unclosed <socket:ResourceWarning")
def test_a_missing_display_is_reported(tmp_path: Path) -> None:
    build(tmp_path / "home", "Linux64")
    message = failure(Ai2ThorOptions(commit_id="abc", platform="x11", x_display=":97"))
    assert "no usable X display" in message


@pytest.mark.usefixtures("_no_network")
@pytest.mark.parametrize("platform", ["cloud", "x11", None])
def test_without_a_network_nothing_can_be_downloaded(platform: Any) -> None:
    message = failure(Ai2ThorOptions(platform=platform, x_display=":97", commit_id="abc"))
    assert "cannot be downloaded" in message
    assert "simulator.executable=evonav" in message


def test_no_vulkan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build(tmp_path / "home", "CloudRendering")
    monkeypatch.setattr("ctypes.util.find_library", lambda name: None)
    message = failure(Ai2ThorOptions(platform="cloud", commit_id="abc"))
    assert "no Vulkan" in message
    assert "vulkaninfo" in message


def test_unity_without_a_gpu_ends_with_advice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build(tmp_path / "home", "CloudRendering")
    monkeypatch.setattr("ctypes.util.find_library", lambda name: "libvulkan.so.1")
    message = failure(Ai2ThorOptions(platform="cloud", commit_id="abc"))
    assert "ended with exit code 3 while starting" in message
    assert "no Vulkan device" in message
    assert "vulkaninfo" in message


def test_gpus_are_found_before_starting(script: Script, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    monkeypatch.setenv("PATH", str(tools))
    options = Ai2ThorOptions(executable=script("exit 0"), gpu_device=0)
    assert "vulkan-tools" in failure(options)
    vulkaninfo = tools / "vulkaninfo"
    vulkaninfo.write_text("#!/bin/sh\n")
    vulkaninfo.chmod(0o755)
    assert "no such GPU" in failure(options)


def test_a_missing_client_package_is_named() -> None:
    """In an interpreter that cannot import it."""
    program = (
        "import sys; sys.modules['ai2thor'] = None\n"
        "from evonav.world.ai2thor import Ai2ThorSimulator\n"
        "try: Ai2ThorSimulator().start()\n"
        "except Exception as error: print(type(error).__name__, error)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("SimulationError")
    assert "pip install 'evonav[thor]'" in done.stdout


@pytest.mark.parametrize("field", ["camera_height_m", "agent_radius_m", "agent_height_m"])
def test_a_body_unlike_ai2thors_is_refused(field: str) -> None:
    with pytest.raises(InvalidArgumentError, match=f"{field} = 1"):
        Ai2ThorSimulator(SimulatorConfig(**{field: 1.0}))


@pytest.mark.parametrize("values", [{"timeout_s": 0.0}, {"gpu_device": -1}, {"platform": "metal"}, {"display": ":0"}])
def test_wrong_options_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=next(iter(values))):
        Ai2ThorOptions(**values)


@pytest.mark.parametrize("more", [{"gpu_device": 0}, {"commit_id": "abc"}])
def test_contradicting_options_are_refused(more: dict[str, Any]) -> None:
    with pytest.raises(InvalidArgumentError, match=" ".join(more)):
        Ai2ThorSimulator(options=Ai2ThorOptions(executable="evonav", **more))


def test_nothing_is_left_of_starts_that_failed(script: Script, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    failure(Ai2ThorOptions(executable=script("exit 1")))  # what is opened once for all is open now
    before = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(3):
        failure(Ai2ThorOptions(executable=script("exit 1")))
    assert len(list(Path("/proc/self/fd").iterdir())) <= before
    assert not list(temporary.iterdir())


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_the_process_ends_with_evonav_however_that_ends(script: Script, tmp_path: Path, number: int) -> None:
    """A process that, unlike our engine, does not look whether anybody is left."""
    pid_file = tmp_path / "pid"
    program = (
        "import sys\n"
        "from evonav.world.ai2thor import Ai2ThorOptions, Ai2ThorSimulator\n"
        "Ai2ThorSimulator(options=Ai2ThorOptions(executable=sys.argv[1])).start()\n"
    )
    executable = script(f"trap '' TERM INT HUP; echo $$ > '{pid_file}'; while :; do sleep 0.1; done")
    environment = os.environ | {"TMPDIR": str(tmp_path)}  # a process that is killed cannot clean up
    command = [sys.executable, "-c", program, executable]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, env=environment) as evonav:
        _wait_until(lambda: pid_file.is_file() and pid_file.read_text().endswith("\n"))
        pid = int(pid_file.read_text())
        evonav.send_signal(number)
        try:
            evonav.wait(10.0)
        finally:
            evonav.kill()
    try:
        _wait_until(lambda: not _is_alive(pid))
    finally:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def _wait_until(is_met: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 15.0
    while not is_met():
        assert time.monotonic() < deadline_s
        time.sleep(0.02)


def _is_alive(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[:1]
    except FileNotFoundError:
        return False
