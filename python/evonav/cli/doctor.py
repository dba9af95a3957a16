"""`evonav doctor`: check what works on this machine, quickly and without changing anything."""

import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from evonav.cli.examples import DOCS
from evonav.cli.options.shared import AsJson
from evonav.counted import counted

if TYPE_CHECKING:  # the command must start fast
    from evonav.perception.predicted import StackName

State = Literal["ok", "missing", "failed"]
Result = tuple[State, str] | tuple[State, str, str]
"""State, finding and, where there is one, the remedy of a check."""
EXIT_BROKEN = 1
RENDER_S = 1.0
PING_S = 5.0
MIN_FREE_GB = 2.0
ESSENTIAL = ("evonav", "python", "bundled tasks", "renderer")
EXTRAS = {
    "bench": "evonav bench: what evonav is compared with",
    "coco": "--perception predicted:coco: YOLOv4-tiny's weights",
    "data": "Parquet tables",
    "ray": "--set engine=ray: many machines",
    "rerun": "episodes as .rrd for the rerun viewer",
    "text": "entries ranked by features of words (MiniLM, no torch)",
    "thor": "--simulator ai2thor",
    "torch": "--perception predicted: models",
    "video": "videos of episodes",
    "viz": "plots; maps as PNG and PDF",
    "vlm": "--decision vlm: a model behind an endpoint",
    "yolo": "--perception predicted:3d-mem, AGPL-3.0",
}
"""Purposes of the extras of the package."""
_STYLES = {"ok": "green", "missing": "yellow", "failed": "bold red"}


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The result of one check."""

    name: str
    state: State
    """missing: an optional part is not installed; failed: a part does not work, or an essential one is missing."""
    finding: str
    remedy: str = ""
    """The action that repairs it."""
    is_essential: bool = False


def doctor(
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder in which runs will be written.")] = Path("out"),
    every: Annotated[bool, typer.Option("--all", help="Also show the optional parts that are not installed.")] = False,
    network: Annotated[bool, typer.Option(help="Contact the model server, if one is configured.")] = True,
    base_url: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="VLM: address of an OpenAI-compatible API, with its /v1. Default: OPENAI_BASE_URL, else OpenAI's.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check what works on this machine, and how to install the rest.

    The exit code is 1 if an essential part does not work.
    """
    import json

    from evonav.cli.display import status

    checks = []
    with status("Checking") as tell:
        for check in all_checks(out, uses_network=network, base_url=base_url):
            checks.append(check)
            tell(check.name)
    is_ok = all(check.state == "ok" for check in checks if check.is_essential)
    if as_json:
        typer.echo(json.dumps({"is_ok": is_ok, "checks": [asdict(check) for check in checks]}, indent=2))
    else:
        _print([check for check in checks if every or check.state != "missing"])
        num_missing = 0 if every else sum(check.state == "missing" for check in checks)
        ready = "evonav is ready: all that the benchmark needs works."
        optional = f" {counted(num_missing, 'optional part')} not found: `evonav doctor --all`." if num_missing else ""
        typer.echo((ready if is_ok else "evonav is not ready: see what failed above.") + optional)
    if not is_ok:
        raise typer.Exit(EXIT_BROKEN)


def _print(checks: list[CheckResult]) -> None:
    from rich.console import Console
    from rich.text import Text

    console = Console()
    width = max(len(check.name) for check in checks)
    for check in checks:
        line = Text.assemble((f"{check.state:8}", _STYLES[check.state]), f"{check.name:{width}}  ", check.finding)
        if check.remedy:
            line.append(f" -> {check.remedy}", style="bold")
        console.print(line, soft_wrap=True)


def all_checks(out: Path, *, uses_network: bool = True, base_url: str | None = None) -> Iterator[CheckResult]:
    """Run every check; a check that raises counts as failed.

    Args:
        out: Folder for runs; it need not exist.
        uses_network: Ask the model's endpoint.
        base_url: Its address; default: that of the environment.
    """
    from evonav.perception.predicted import STACKS

    checks: dict[str, Callable[[], Result]] = {
        "evonav": _core,
        "python": _python,
        "bundled tasks": _bundled,
        "renderer": _renderer,
        "run folder": partial(_folder, out),
        "sandbox": _sandbox,
        "GPU": _gpu,
        **{f"extra {extra}": partial(_extra, extra) for extra in EXTRAS},
        **{f"models {stack}": partial(_models, stack) for stack in STACKS},
        "AI2-THOR": _thor,
        "ProcTHOR-10k": _procthor,
        "model endpoint": partial(_endpoint, base_url, uses_network),
    }
    for name, check in checks.items():
        is_essential = name in ESSENTIAL
        try:
            found = check()
        except Exception as error:  # a broken part may raise anything
            finding = " ".join(f"{type(error).__name__}: {error}".split())
            found = ("failed", finding, "pip install --force-reinstall evonav" if is_essential else "")
        state, finding, *remedy = found
        yield CheckResult(name, state, finding, "".join(remedy), is_essential)


def _core() -> Result:
    import evonav
    from evonav import _core as core

    return "ok", f"{evonav.__version__}, Rust core {core.__version__}, in {Path(evonav.__file__).parent}"


def _python() -> Result:
    from evonav.parallel.local import num_cores

    machine = f"{platform.platform(terse=True)} {platform.machine()}, {num_cores()} cores for workers"
    return "ok", f"{platform.python_version()} ({sys.executable}), numpy {version('numpy')}, {machine}"


def _bundled() -> Result:
    from evonav.tasks.files import load_task
    from evonav.tasks.listing import BUNDLED_TASKS, task_roots

    roots = task_roots(BUNDLED_TASKS)
    task = load_task(roots[0])
    return "ok", f"{len(roots)}, the first of {counted(task.num_stages, 'stage')}"


def _renderer() -> Result:
    """Render views of a bundled house for one second."""
    from dataclasses import replace

    from evonav.house import bundled_houses
    from evonav.world.embedded import EmbeddedSimulator

    simulator = EmbeddedSimulator()
    pose = simulator.reset(next(iter(bundled_houses())).to_json())
    num = 0
    began_s = time.monotonic()
    while (took_s := time.monotonic() - began_s) < RENDER_S:
        frame = simulator.render(replace(pose, yaw_rad=pose.yaw_rad + 0.5 * num), rgb=True, instances=True)
        num += 1
    simulator.close()
    if frame.instances is None or frame.instances.max() == 0:
        return "failed", "sees nothing in a bundled house", "report this as a bug"
    size = f"{simulator.config.width_px}x{simulator.config.height_px}"
    return "ok", f"{num / took_s:.0f} views/s of {size} (colour, depth, instances) on one core"


def _folder(out: Path) -> Result:
    """Check free space and file locks in the folder for runs."""
    from evonav.errors import StoreError
    from evonav.parallel.folders import writing

    place = next(folder for folder in (out.absolute(), *out.absolute().parents) if folder.is_dir())
    free_gb = shutil.disk_usage(place).free / 1e9
    has_locks = False
    try:
        with tempfile.TemporaryDirectory(dir=place, prefix=".evonav-doctor-") as folder, writing(Path(folder)):
            try:
                with writing(Path(folder)):
                    pass
            except StoreError:  # as a second command would find
                has_locks = True
    except OSError as error:
        return "failed", f"{place}: {error.strerror or error}", "name a folder that you may write to with --out"
    finding = f"{place}: {free_gb:.0f} GB free, {'locks work' if has_locks else 'no file locks'}"
    if not has_locks and os.name == "nt":
        return "ok", f"{finding}: evonav has none on Windows, so let only one command write to a folder"
    if not has_locks:
        return "failed", finding, "put runs on a local disk: two commands could write to one run"
    if free_gb < MIN_FREE_GB:
        return "failed", finding, "a run takes about 0.1 MB a stage, with a model 1 MB: make room"
    return "ok", finding


def _extra(extra: str) -> Result:
    """Look for the packages that the metadata of evonav name for an extra."""
    needed = [text for text in requires("evonav") or () if re.search(rf"extra == ['\"]{extra}['\"]", text)]
    found, lacking = [], []
    for package in (re.split(r"[^\w.-]", text)[0] for text in needed):
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            lacking.append(package)
    if lacking:
        return "missing", f"{EXTRAS[extra]} (no {', '.join(lacking)})", f"pip install 'evonav[{extra}]'"
    return "ok", f"{EXTRAS[extra]} ({', '.join(found)})"


def _sandbox() -> Result:
    from evonav.agents.hosting.sandbox import landlock_abi, sandbox_problem
    from evonav.evaluation.hosting.isolation import usual_isolation

    if reason := sandbox_problem():
        return "missing", f"--isolation sandbox: {reason}"
    usual = "" if usual_isolation() == "sandbox" else "; not the default where there is a GPU"
    return "ok", f"--isolation sandbox: Landlock {landlock_abi()} and seccomp shut agents in{usual}"


def _gpu() -> Result:
    """Ask nvidia-smi; PyTorch's version is read without loading it, which would take seconds."""
    try:
        torch = f", torch {version('torch')}"
    except PackageNotFoundError:
        torch = ""
    tool = shutil.which("nvidia-smi")
    none: Result = ("missing", f"none found{torch}; evonav's own simulator and agents need none")
    if tool is None:
        return none
    command = [tool, "--query-gpu=name,memory.total,driver_version", "--format=csv,noheader"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)  # noqa: S603 - nvidia-smi
    names = [" ".join(line.split()) for line in done.stdout.splitlines() if line.strip()]
    return ("ok", "; ".join(names) + torch) if done.returncode == 0 and names else none


def _models(stack: "StackName") -> Result:
    """Look for the files of a stack by name; hashes take seconds and are compared before a run."""
    from evonav.perception.predicted import StackConfig, weights_of
    from evonav.perception.weights import models_folder, places

    folder = models_folder(None)
    files = {
        file.name: (file, path)
        for one in weights_of(stack, StackConfig()).values()
        for file, path in places(one, folder)
    }
    lacking = [file for file, path in files.values() if not path.is_file()]
    where = str(folder) if folder is not None else "the libraries' own folders"
    if lacking:
        size_mb = sum(file.size_mb for file in lacking)
        finding = f"{len(lacking)} of {len(files)} files are not in {where} (about {size_mb} MB): {lacking[0].name}"
        remedy = "fetched at first use" if folder is None else f"{DOCS}/perception.md says where to download them"
        return "missing", f"{finding}, ..." if len(lacking) > 1 else finding, remedy
    return "ok", f"{counted(len(files), 'file')} in {where}"


def _thor() -> Result:
    from evonav.errors import SimulationError
    from evonav.thor import executable

    try:
        engine = f"evonav-thor in {Path(executable().strip(chr(39))).parent}"
    except SimulationError as error:
        return "failed", str(error), "pip install --force-reinstall evonav"
    if find_spec("ai2thor") is None:
        return "missing", f"no client; {engine}", "pip install 'evonav[thor]'"
    releases = Path.home() / ".ai2thor" / "releases"
    return "ok", f"client {version('ai2thor')}, {engine}, Unity builds, if any, in {releases}"


def _procthor() -> Result:
    from evonav.house.procthor10k import dataset_folder, read_manifest

    folder = dataset_folder()
    manifest = read_manifest(folder)
    if manifest is None:
        return "missing", f"not in {folder}", "evonav houses fetch procthor-10k"
    listed = ", ".join(f"{name} {split.num_houses}" for name, split in manifest.splits.items())
    return "ok", f"{listed} houses in {folder}"


def _endpoint(base_url: str | None, uses_network: bool) -> Result:
    """Ask the configured endpoint for its models, if there is one; a redirection would give away the key."""
    from http.client import HTTPConnection, HTTPException, HTTPSConnection
    from urllib.parse import urlsplit

    from evonav.decision.vlm.client import KEY_VARIABLE, URL_VARIABLE
    from evonav.decision.vlm.secrets import without_secrets

    key, url = os.environ.get(KEY_VARIABLE), base_url or os.environ.get(URL_VARIABLE)
    if not key and not url:
        remedy = f"export {KEY_VARIABLE}=..., or {URL_VARIABLE} of your own server ({DOCS}/decision.md)"
        return "missing", "none configured; rules decide without one", remedy
    shown = re.sub(r"//[^/@]*@", "//", (url or "https://api.openai.com/v1").rstrip("/"))
    if not uses_network:
        return "ok", f"{shown} configured, not asked (--no-network)"
    parts = urlsplit(shown)
    if parts.scheme not in ("http", "https"):
        return "failed", f"{shown}: no http address", f"set {URL_VARIABLE} to http(s)://.../v1"
    connect = HTTPSConnection if parts.scheme == "https" else HTTPConnection
    try:
        connection = connect(parts.netloc, timeout=PING_S)
        connection.request("GET", f"{parts.path}/models", headers={"Authorization": f"Bearer {key or 'none'}"})
        status = connection.getresponse().status
        connection.close()
    except (OSError, HTTPException, ValueError) as error:
        reason = without_secrets(str(error), [key or ""])
        return "failed", f"{shown}: {reason}", "is the server up? --no-network skips this"
    if status != 200:
        is_key = status in (401, 403)
        remedy = f"check {KEY_VARIABLE}" if is_key else f"check {URL_VARIABLE}: it ends in /v1 for most servers"
        return "failed", f"{shown} answers {status}", remedy
    return "ok", f"{shown} answers; {KEY_VARIABLE} is {'set' if key else 'not set'}"
