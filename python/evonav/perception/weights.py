"""Locate, download and verify the files of models' weights.

A file is looked for in the folder `perception.models` (or `EVONAV_MODELS`), under the hub's own name. Without a folder
it is looked for where its library keeps such files, and fetched from the library's hub if it is not there. Either way
its SHA-256 is compared with the published one, or, where none is published, with the one of its first use, which a lock
file beside the files keeps.
"""

import json
import os
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from urllib.parse import urlsplit

from evonav.downloads import download
from evonav.errors import PerceptionError, StoreError
from evonav.parallel.folders import sha256_of_file, write_atomically

MODELS_VARIABLE = "EVONAV_MODELS"
LOCK_NAME = "evonav-models.json"
PROBE_S = 3.0
"""A hub that does not answer in this time is not reached; its own client would try for half a minute."""
_HUGGING_FACE = "https://huggingface.co"
_ULTRALYTICS = "https://github.com/ultralytics/assets/releases/download/v8.4.0"
_TRANSFORMERS = ("config.json", "preprocessor_config.json", "model.safetensors")


@dataclass(frozen=True, slots=True)
class WeightFile:
    """A file of a hub."""

    name: str
    """Path in a folder of models: of a release, the file; of Hugging Face, ORGANISATION/REPOSITORY/FILE."""
    licence: str
    size_mb: int = 0
    """Approximate size; 0 for a text file."""
    sha256: str = ""
    """Published digest, or its published beginning; empty: unknown until the first use."""
    url: str = ""
    """Address of a release's file; empty: on Hugging Face."""

    @property
    def source(self) -> str:
        """The address to fetch the file from."""
        if self.url:
            return self.url
        repository, _, file = self.name.rpartition("/")
        return f"{_HUGGING_FACE}/{repository}/resolve/main/{file}"


@dataclass(frozen=True, slots=True)
class Weights:
    """Weights of one model: a file, or the files of a repository."""

    name: str
    """Name in options."""
    files: tuple[WeightFile, ...] = field(repr=False)


def _release(name: str, size_mb: int) -> Weights:
    return Weights(name, (WeightFile(name, "AGPL-3.0", size_mb, url=f"{_ULTRALYTICS}/{name}"),))


def _repository(name: str, size_mb: int, licence: str, *more: str) -> Weights:
    files = tuple(
        WeightFile(f"{name}/{file}", licence, size_mb if file.endswith(".safetensors") else 0)
        for file in (*_TRANSFORMERS, *more)
    )
    return Weights(name, files)


_TOKENIZER = ("tokenizer.json", "tokenizer_config.json")
_OPENAI, _LAION = "timm/vit_base_patch32_clip_224.openai", "laion/CLIP-ViT-B-32-laion2B-s34B-b79K"
_MASK_RCNN = "maskrcnn_resnet50_fpn_coco-bf2d0c1e.pth"

_CATALOGUE = (
    _release("yolov8x-world.pt", 147),
    _release("yolov8x-worldv2.pt", 146),
    _release("yolov8l-worldv2.pt", 94),
    _release("yolov8m-worldv2.pt", 57),
    _release("yolov8s-worldv2.pt", 26),
    *(
        Weights(name, (WeightFile(name, "Apache-2.0", size_mb, url=f"{_ULTRALYTICS}/{name}"),))
        for name, size_mb in (("sam_l.pt", 1250), ("sam_b.pt", 375), ("mobile_sam.pt", 41))
    ),
    Weights(_OPENAI, (WeightFile(f"{_OPENAI}/open_clip_model.safetensors", "MIT", 605),)),
    Weights(_LAION, (WeightFile(f"{_LAION}/open_clip_model.safetensors", "MIT", 605),)),
    Weights(
        _MASK_RCNN,
        (WeightFile(_MASK_RCNN, "BSD-3-Clause", 178, "bf2d0c1e", f"https://download.pytorch.org/models/{_MASK_RCNN}"),),
    ),
    _repository("IDEA-Research/grounding-dino-tiny", 689, "Apache-2.0", *_TOKENIZER),
    _repository("facebook/sam-vit-huge", 2564, "Apache-2.0"),
    _repository("facebook/sam-vit-large", 1250, "Apache-2.0"),
    _repository("facebook/sam-vit-base", 375, "Apache-2.0"),
    _repository(
        "google/owlv2-base-patch16-ensemble", 620, "Apache-2.0", "vocab.json", "merges.txt", "tokenizer_config.json"
    ),
    replace(_repository(_LAION, 605, "MIT", *_TOKENIZER), name=f"{_LAION} for transformers"),
)
CATALOGUE: dict[str, Weights] = {weights.name: weights for weights in _CATALOGUE}
"""Weights by name. Sizes are to the nearest few MB and are never compared."""


def models_folder(models: str | None) -> Path | None:
    """Return the folder that an option or a variable names.

    Raises:
        PerceptionError: It is no folder.
    """
    named = models or os.environ.get(MODELS_VARIABLE) or None
    if named is None:
        return None
    folder = Path(named).expanduser()
    if not folder.is_dir():
        by = "--set perception.models" if models else MODELS_VARIABLE
        raise PerceptionError(f"{by}: {folder} is no folder; name the folder that holds the models' files")
    return folder.absolute()


def known(name: str) -> Weights:
    """Return the weights with a name.

    Raises:
        PerceptionError: There are none of this name.
    """
    if name not in CATALOGUE:
        raise PerceptionError(f"no weights {name!r} are known; there are {', '.join(sorted(CATALOGUE))}")
    return CATALOGUE[name]


def located(weights: Weights, folder: Path | None) -> Path:
    """Locate weights; missing ones are fetched if no folder was named.

    Args:
        folder: See `models_folder`.

    Returns:
        The file, or the folder of the repository's files.

    Raises:
        PerceptionError: A file is missing, and cannot be fetched.
    """
    paths = [_located(file, folder) for file in weights.files]
    return paths[0] if len(paths) == 1 else paths[0].parent


def fingerprint(weights: Weights, folder: Path | None) -> dict[str, str]:
    """Return the checked SHA-256 of each file.

    Args:
        folder: See `models_folder`.

    Raises:
        PerceptionError: A file is missing, or is not what was published, or not what it was.
    """
    return {file.name: _checked(file, _located(file, folder), folder) for file in weights.files}


def check_folder(weights: Sequence[Weights], folder: Path) -> None:
    """Check all files at once, so that the missing ones can be fetched at once.

    Args:
        weights: Weights of the models of a stack.
        folder: Folder that was named.

    Raises:
        PerceptionError: Some are missing; each is named with its source.
    """
    lacking = [file for one in weights for file, path in places(one, folder) if not path.is_file()]
    if lacking:
        missing = "; ".join(f"{file.name} from {file.source}" for file in lacking)
        size_mb = sum(file.size_mb for file in lacking)
        raise PerceptionError(
            f"{folder} lacks {len(lacking)} of the models' files (about {size_mb} MB): put them there by these names, "
            f"or leave perception.models and {MODELS_VARIABLE} out to have them fetched: {missing}"
        )


def places(weights: Weights, folder: Path | None) -> list[tuple[WeightFile, Path]]:
    """Return the place of each file, whether it exists or not; nothing is fetched.

    Args:
        folder: See `models_folder`.
    """
    return [(file, _path_of(file, folder)) for file in weights.files]


def _path_of(file: WeightFile, folder: Path | None) -> Path:
    """Return the place of a file, whether it exists or not."""
    if folder is not None:
        return folder / file.name
    if file.url:
        return own_folder() / file.name
    try:
        from huggingface_hub import try_to_load_from_cache
    except ImportError:
        return own_folder() / file.name
    repository, _, name = file.name.rpartition("/")
    cached = try_to_load_from_cache(repository, name)
    return Path(cached) if isinstance(cached, str) else own_folder() / file.name


def own_folder() -> Path:
    """Return the folder of releases' files, and of the lock file for all that is not in a folder of the user's."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "evonav" / "models"


def _located(file: WeightFile, folder: Path | None) -> Path:
    path = _path_of(file, folder)
    if path.is_file():
        return path
    about = f" (about {file.size_mb} MB)" if file.size_mb else ""
    if folder is not None:
        raise PerceptionError(
            f"{path} is missing{about}: put {file.source} there, or leave perception.models and {MODELS_VARIABLE} out"
        )
    _probe(file, about)
    return _fetched(file, path)


def _probe(file: WeightFile, about: str) -> None:
    """Raise at once if the hub cannot be reached; its own client would retry for half a minute."""
    host = urlsplit(file.source).hostname or ""
    is_off = os.environ.get("HF_HUB_OFFLINE", "").lower() in ("1", "true", "yes", "on")
    try:
        if is_off:
            raise OSError("HF_HUB_OFFLINE is set")
        socket.create_connection((host, 443), timeout=PROBE_S).close()
    except OSError as error:
        raise PerceptionError(
            f"{file.name}{about} is not on this machine and {host} cannot be reached ({error}): get {file.source} "
            f"where there is a network and name its folder with --set perception.models=DIR, as DIR/{file.name}"
        ) from None


def _fetched(file: WeightFile, path: Path) -> Path:
    try:
        if not file.url:
            from huggingface_hub import hf_hub_download

            repository, _, name = file.name.rpartition("/")
            return Path(hf_hub_download(repository, name))
        download(file.url, path)
        if not (digest := sha256_of_file(path)).startswith(file.sha256):
            path.unlink()
            raise ValueError(f"its SHA-256 is {digest}, published is {file.sha256}")
    except ImportError as error:
        raise PerceptionError(f"{file.name} cannot be fetched: pip install 'evonav[torch]' ({error})") from None
    except Exception as error:  # of several clients, each with errors of its own
        cause = " ".join(str(error).split())[:300]
        raise PerceptionError(
            f"{file.name} could not be fetched from {file.source} ({type(error).__name__}: {cause}): try again, or put "
            "it in a folder and name that with --set perception.models"
        ) from error
    return path


def _checked(file: WeightFile, path: Path, folder: Path | None) -> str:
    """Return the checked SHA-256 of a file; it is computed again only when the file has changed."""
    lock = (folder or own_folder()) / LOCK_NAME
    entries = _read_lock(lock)
    entry = entries.get(file.name, {})
    try:
        stat = path.stat()
        stamp = [stat.st_size, stat.st_mtime_ns]
        digest = str(entry["sha256"]) if entry.get("stamp") == stamp else sha256_of_file(path)
    except OSError as error:
        raise PerceptionError(f"{path} cannot be read: {error.strerror}") from error
    if not digest.startswith(file.sha256):
        raise PerceptionError(
            f"{path}: its SHA-256 is {digest}, published is {file.sha256}: it is damaged or another file; get "
            f"{file.source} again"
        )
    if entry and entry.get("sha256") != digest:
        raise PerceptionError(
            f"{path}: its SHA-256 is {digest} and was {entry.get('sha256')} when it was first used: get "
            f"{file.source} again, or take {file.name!r} out of {lock} if it was changed on purpose"
        )
    if entry.get("stamp") != stamp:
        _write_lock(lock, {**entries, file.name: {"sha256": digest, "stamp": stamp}})
    return digest


def _read_lock(lock: Path) -> dict[str, dict[str, object]]:
    try:
        entries = json.loads(lock.read_text(encoding="utf-8")) if lock.is_file() else {}
        if not isinstance(entries, dict) or not all(isinstance(entry, dict) for entry in entries.values()):
            raise ValueError("not an object of objects")
    except (OSError, ValueError) as error:
        raise PerceptionError(f"{lock} cannot be read ({error}): delete it, hashes are then taken again") from error
    return entries


def _write_lock(lock: Path, entries: dict[str, dict[str, object]]) -> None:
    """Write the lock file; in a folder that is not writable, hashes are computed each time and never compared."""
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(lock, json.dumps(entries, indent=1, sort_keys=True) + "\n")
    except (OSError, StoreError):
        return
