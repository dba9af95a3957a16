"""Weights that are missing, damaged or out of reach: one error each, at once, that says what to do."""

import hashlib
import socket
import sys
import time
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

from evonav.errors import InvalidArgumentError, PerceptionError
from evonav.perception import weights
from evonav.perception.models import libraries
from evonav.perception.predicted import STACKS, StackConfig, modules_of, predicted_perception, weights_of
from evonav.perception.weights import CATALOGUE, LOCK_NAME, WeightFile, Weights, fingerprint, known, located

SAM = known("mobile_sam.pt")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mobile_sam.pt").write_bytes(b"weights")
    return tmp_path


def test_a_file_is_found_in_the_folder_and_its_hash_is_kept(folder: Path) -> None:
    assert located(SAM, folder) == folder / "mobile_sam.pt"
    digest = hashlib.sha256(b"weights").hexdigest()
    assert fingerprint(SAM, folder) == {"mobile_sam.pt": digest}
    assert digest in (folder / LOCK_NAME).read_text(encoding="utf-8")
    assert fingerprint(SAM, folder) == {"mobile_sam.pt": digest}


def test_a_file_is_hashed_again_only_when_it_has_changed(folder: Path, monkeypatch) -> None:
    fingerprint(SAM, folder)
    monkeypatch.setattr(weights, "sha256_of_file", lambda path: pytest.fail("hashed again"))
    fingerprint(SAM, folder)


def test_another_file_of_the_same_name_is_refused(folder: Path) -> None:
    fingerprint(SAM, folder)
    (folder / "mobile_sam.pt").write_bytes(b"other weights")
    with pytest.raises(PerceptionError, match=r"when it was first used: get https://github\.com.*mobile_sam\.pt again"):
        fingerprint(SAM, folder)
    (folder / LOCK_NAME).unlink()
    fingerprint(SAM, folder)


def test_a_published_hash_is_held(folder: Path) -> None:
    name = "maskrcnn_resnet50_fpn_coco-bf2d0c1e.pth"
    (folder / name).write_bytes(b"damaged")
    with pytest.raises(PerceptionError, match="published is bf2d0c1e: it is damaged or another file"):
        fingerprint(known(name), folder)
    right = Weights("x", (WeightFile(name, "", sha256=hashlib.sha256(b"damaged").hexdigest()[:8]),))
    assert len(fingerprint(right, folder)) == 1


def test_a_missing_file_of_a_repository_is_named(folder: Path) -> None:
    model = folder / "facebook/sam-vit-huge"
    model.mkdir(parents=True)
    (model / "config.json").write_text("{}", encoding="utf-8")
    with pytest.raises(
        PerceptionError,
        match=r"facebook/sam-vit-huge/preprocessor_config\.json is missing: put https://huggingface\.co/facebook/"
        r"sam-vit-huge/resolve/main/preprocessor_config\.json there",
    ):
        located(known("facebook/sam-vit-huge"), folder)


def test_a_damaged_lock_file_says_what_to_do(folder: Path) -> None:
    (folder / LOCK_NAME).write_text("[1]", encoding="utf-8")
    with pytest.raises(PerceptionError, match="delete it, hashes are then taken again"):
        fingerprint(SAM, folder)


def test_a_folder_that_cannot_be_written_to_is_read(folder: Path, monkeypatch) -> None:
    def refuse(path, data):
        raise OSError("read-only")

    monkeypatch.setattr(weights, "write_atomically", refuse)
    assert fingerprint(SAM, folder) == fingerprint(SAM, folder)


def test_without_a_network_the_error_comes_at_once(tmp_path: Path, monkeypatch) -> None:
    def refuse(address, timeout):
        assert timeout <= 5.0
        raise OSError("no route")

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("HF_HOME", str(tmp_path))
    monkeypatch.delenv("HF_HUB_OFFLINE", raising=False)
    monkeypatch.setattr(socket, "create_connection", refuse)
    began_s = time.monotonic()
    for name, host in (("sam_l.pt", "github.com"), ("facebook/sam-vit-huge", "huggingface.co")):
        with pytest.raises(
            PerceptionError, match=rf"{host} cannot be reached \(no route\): .* --set perception.models=DIR"
        ):
            located(known(name), None)
    assert time.monotonic() - began_s < 5.0
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    with pytest.raises(PerceptionError, match="HF_HUB_OFFLINE is set"):
        located(known("facebook/sam-vit-huge"), None)


@pytest.fixture
def release(tmp_path: Path, monkeypatch) -> Iterator[str]:
    """The address of a file of a release, on a server of this machine; the cache is empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setattr(weights, "_probe", lambda file, about: None)
    (tmp_path / "served").mkdir()
    (tmp_path / "served" / "net.pt").write_bytes(b"weights")
    handler = partial(QuietHandler, directory=str(tmp_path / "served"))
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/net.pt"
    server.shutdown()
    server.server_close()


class QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *args) -> None:
        pass


def test_a_file_of_a_release_is_downloaded_once(release: str, tmp_path: Path) -> None:
    digest = hashlib.sha256(b"weights").hexdigest()
    net = Weights("net.pt", (WeightFile("net.pt", "MIT", sha256=digest[:8], url=release),))
    path = located(net, None)
    assert path == tmp_path / "cache/evonav/models/net.pt"
    assert fingerprint(net, None) == {"net.pt": digest}
    (tmp_path / "served" / "net.pt").unlink()
    assert located(net, None) == path


def test_a_download_that_is_not_what_was_published_does_not_stay(release: str, tmp_path: Path) -> None:
    net = Weights("net.pt", (WeightFile("net.pt", "MIT", sha256="bf2d0c1e", url=release),))
    with pytest.raises(PerceptionError, match=rf"net\.pt could not be fetched from {release}.*published is bf2d0c1e"):
        located(net, None)
    assert list((tmp_path / "cache/evonav/models").iterdir()) == []
    gone = Weights("gone.pt", (WeightFile("gone.pt", "MIT", url=release.replace("net", "gone")),))
    with pytest.raises(PerceptionError, match=r"gone\.pt could not be fetched .*404"):
        located(gone, None)


def test_the_folder_is_named_by_option_or_variable(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.delenv(weights.MODELS_VARIABLE, raising=False)
    assert weights.models_folder(None) is None
    assert weights.models_folder(str(tmp_path)) == tmp_path
    monkeypatch.setenv(weights.MODELS_VARIABLE, str(tmp_path / "gone"))
    assert weights.models_folder(str(tmp_path)) == tmp_path
    with pytest.raises(PerceptionError, match=r"EVONAV_MODELS: .*gone is no folder"):
        weights.models_folder(None)


def test_a_missing_library_names_its_extra(monkeypatch) -> None:
    for module, extra in (("ultralytics", "yolo"), ("transformers", "torch"), ("torchvision.ops", "torch")):
        monkeypatch.setitem(sys.modules, module.partition(".")[0], None)
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(PerceptionError, match=rf"needs {module}: pip install 'evonav\[{extra}\]'"):
            libraries.imported(module)
    monkeypatch.setattr(libraries, "_PACKAGES", {"ultralytics": "no-such-package-of-anyone"})
    with pytest.raises(PerceptionError, match=r"pip install 'evonav\[yolo\]'; `predicted:mini` needs nothing"):
        libraries.versions_of(("ultralytics",), "yolo")


def test_all_that_is_missing_is_told_before_anything_runs(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(libraries, "versions_of", lambda modules, extra: dict.fromkeys(modules, "1"))
    (tmp_path / "sam_l.pt").write_bytes(b"here")
    with pytest.raises(PerceptionError, match=r"lacks 3 of the models' files \(about 1357 MB\)") as caught:
        predicted_perception(models=str(tmp_path)).check(["fu"])
    assert "yolov8x-world.pt from https://github.com/" in str(caught.value)
    assert "sam_l" not in str(caught.value)
    with pytest.raises(PerceptionError, match=r"maskrcnn_resnet50_fpn_coco-bf2d0c1e\.pth from https://download"):
        predicted_perception(models=str(tmp_path)).check(["unigoal"])
    with pytest.raises(InvalidArgumentError, match="no vocabulary"):
        predicted_perception("3d-mem", vocabulary="scannet", models=str(tmp_path)).check(["fu"])


def test_every_stack_has_weights_with_licences_and_libraries_with_extras() -> None:
    for stack in STACKS:
        for part in weights_of(stack, StackConfig()).values():
            assert all(file.licence and file.source.startswith("https://") for file in part.files)
            assert sum(file.size_mb for file in part.files) > 10
        assert set(modules_of(stack)) <= set(libraries.EXTRA_OF)
    assert all(weights.name == name for name, weights in CATALOGUE.items())
