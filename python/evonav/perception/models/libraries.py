"""Import the libraries of extras, and choose the device that they compute on."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from evonav.errors import PerceptionError
from evonav.perception.weights import own_folder

EXTRA_OF = {
    "open_clip": "torch",
    "torch": "torch",
    "torchvision": "torch",
    "transformers": "torch",
    "ultralytics": "yolo",
}
"""The extra that brings a module."""
_PACKAGES = {"open_clip": "open_clip_torch"}


def imported(module: str) -> Any:  # noqa: ANN401 - a module
    """Import a module of an extra.

    Raises:
        PerceptionError: It is not installed, or does not import.
    """
    if module == "ultralytics":
        # It would install what it lacks and look for updates; we fetch weights ourselves.
        for name, value in (("YOLO_OFFLINE", "True"), ("YOLO_AUTOINSTALL", "False"), ("YOLO_VERBOSE", "False")):
            os.environ.setdefault(name, value)
        settings = own_folder() / "ultralytics"
        if "YOLO_CONFIG_DIR" not in os.environ:
            settings.mkdir(parents=True, exist_ok=True)
            os.environ["YOLO_CONFIG_DIR"] = str(settings)
    try:
        return import_module(module)
    except (ImportError, OSError, RuntimeError) as error:  # a library of CUDA's or an operator may be what is missing
        extra = EXTRA_OF[module.partition(".")[0]]
        cause = " ".join(str(error).split())[:200]
        raise PerceptionError(f"predicted perception needs {module}: pip install 'evonav[{extra}]' ({cause})") from None


def versions_of(modules: tuple[str, ...], extra: str) -> dict[str, str]:
    """Return versions by package, without importing any.

    Args:
        modules: Modules of `EXTRA_OF`.

    Raises:
        PerceptionError: One is not installed.
    """
    found = {}
    for module in modules:
        package = _PACKAGES.get(module, module)
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            raise PerceptionError(
                f"predicted perception needs {package}: pip install 'evonav[{extra}]'; `predicted:mini` needs nothing"
            ) from None
    return found


def device_of(word: str) -> str:
    """Return the device that a word names: `cpu`, `cuda`, `cuda:1`; `auto` is the GPU, if there is one.

    Raises:
        PerceptionError: There is no such device.
    """
    torch = imported("torch")
    has_gpu = bool(torch.cuda.is_available())
    if word == "auto":
        return "cuda" if has_gpu else "cpu"
    kind, _, index = word.partition(":")
    if kind not in ("cpu", "cuda") or (index and not index.isdigit()):
        raise PerceptionError(f"device {word!r}: expected auto, cpu, cuda or cuda:N")
    if kind == "cuda" and not (has_gpu and int(index or 0) < torch.cuda.device_count()):
        raise PerceptionError(f"device {word!r}: PyTorch {torch.__version__} finds no such GPU; use auto or cpu")
    return word


def make_repeatable() -> None:
    """Make results reproducible, as far as PyTorch can: no choice of kernels by speed, no rounding to 19 bits."""
    torch = imported("torch")
    torch.backends.cudnn.benchmark = False
    torch.backends.cudnn.deterministic = True
    torch.backends.cudnn.allow_tf32 = False
    torch.backends.cuda.matmul.allow_tf32 = False


@contextmanager
def loading(path: str, kind: str, files: str = "the file") -> Iterator[None]:
    """Load weights in the block; libraries have errors of their own kinds, of pickle, of zip files, of shapes.

    Args:
        kind: Name of the model, for the error.
        files: A noun for what to get again if they cannot be loaded.

    Raises:
        PerceptionError: They cannot be loaded.
    """
    try:
        yield
    except Exception as error:
        reason = " ".join(str(error).split())[:200]
        raise PerceptionError(
            f"{path}: cannot be loaded as {kind} ({type(error).__name__}: {reason}); get {files} again"
        ) from error
