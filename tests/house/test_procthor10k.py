"""ProcTHOR-10k from a server on this machine that answers as GitHub does."""

import gzip
import hashlib
import json
import pickle
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.errors import HouseError, InvalidArgumentError
from evonav.house import bundled_houses, procthor10k, stream_houses
from evonav.house.procthor10k import (
    PUBLISHED,
    REVISION,
    SPLITS,
    DatasetCorruptError,
    DatasetError,
    HouseSet,
    dataset_folder,
    fetch_procthor10k,
    house_set,
    split_path,
)

NUM_HOUSES = {"train": 3, "val": 2, "test": 1}
COMMIT = "c0ffee" * 6 + "1234"


@dataclass
class Remote:
    """What the server has, and what it was asked for."""

    url: str
    pages: dict[str, bytes]
    files: dict[str, bytes]
    texts: dict[str, list[str]]
    status: int = 404
    """What it answers where it has no page."""
    requests: list[str] = field(default_factory=list)


@pytest.fixture
def remote(tmp_path, monkeypatch) -> Iterator[Remote]:
    """A server in place of GitHub, a fresh home and an empty cache."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("EVONAV_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            made.requests.append(self.path)
            page = made.pages.get(self.path)
            self.send_response(made.status if page is None else 200)
            self.send_header("Content-Length", str(len(page or b"")))
            self.end_headers()
            self.wfile.write(page or b"")

        def log_message(self, *args) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    made = _published(f"http://127.0.0.1:{server.server_port}")
    for name in ("COMMITS", "POINTERS", "FILES"):
        monkeypatch.setattr(procthor10k, name, f"{made.url}/{name.lower()}")
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield made
    server.shutdown()
    server.server_close()
    thread.join()


def _published(url: str) -> Remote:
    houses = iter(sorted(bundled_houses(40), key=lambda house: len(house.to_json())))
    texts = {split: [next(houses).to_json() for _ in range(count)] for split, count in NUM_HOUSES.items()}
    files = {split: gzip.compress("".join(f"{text}\n" for text in texts[split]).encode(), mtime=0) for split in SPLITS}
    pages = {"/commits/main": COMMIT.encode(), "/commits/2022": COMMIT.encode()}
    for split, data in files.items():
        oid = hashlib.sha256(data).hexdigest()
        pointer = f"version https://git-lfs.github.com/spec/v1\noid sha256:{oid}\nsize {len(data)}\n"
        pages[f"/pointers/{COMMIT}/{split}.jsonl.gz"] = pointer.encode()
        pages[f"/files/{COMMIT}/{split}.jsonl.gz"] = data
    return Remote(url, pages, files, texts)


def test_fetch_stores_the_published_bytes_and_a_second_call_only_verifies(remote) -> None:
    fetched = fetch_procthor10k(COMMIT)
    assert fetched.new == SPLITS
    assert fetched.folder == dataset_folder(COMMIT)
    for split in SPLITS:
        assert (fetched.folder / f"{split}.jsonl.gz").read_bytes() == remote.files[split]
    manifest = json.loads((fetched.folder / "manifest.json").read_text())
    assert manifest["revision"] == COMMIT
    assert {name: entry["num_houses"] for name, entry in manifest["splits"].items()} == NUM_HOUSES
    assert manifest["splits"]["val"]["sha256"] == hashlib.sha256(remote.files["val"]).hexdigest()
    assert len(list(fetched.folder.iterdir())) == 4

    remote.requests.clear()
    when = {path: path.stat().st_mtime_ns for path in fetched.folder.iterdir()}
    again = fetch_procthor10k(COMMIT)
    assert again == fetched._replace(new=())
    assert {path: path.stat().st_mtime_ns for path in fetched.folder.iterdir()} == when
    assert remote.requests == []


def test_a_split_is_read_wherever_houses_are(remote, tmp_path) -> None:
    fetch_procthor10k(COMMIT, ["val"])
    name = f"procthor-10k:val@{COMMIT}"
    loaded = list(stream_houses(name))
    assert [house.to_json() for house in loaded] == remote.texts["val"]
    assert loaded[1].name == f"{name}:2"
    listed = CliRunner().invoke(app, ["houses", name, "--limit", "1"])
    assert listed.stdout.splitlines()[1].endswith(f" {name}:1"), listed.output
    made = CliRunner().invoke(
        app, ["tasks", "generate", "--houses", name, "--out", str(tmp_path / "tasks"), "--limit", "1"]
    )
    assert made.exit_code == 0, made.output
    header = next((tmp_path / "tasks").glob("*/task.json"))
    assert json.loads(header.read_text())["dataset"] == "procthor-10k"
    assert json.loads(header.read_text())["split"] == "val"
    with pytest.raises(DatasetError, match="procthor-10k:test is not in"):
        stream_houses(f"procthor-10k:test@{COMMIT}")


def test_splits_fetched_one_after_the_other_add_up(remote) -> None:
    fetch_procthor10k(COMMIT, ["val"])
    assert fetch_procthor10k(COMMIT, ["test", "val"]).new == ("test",)
    assert fetch_procthor10k(COMMIT).new == ("train",)


@pytest.mark.parametrize("revision", ["main", "2022"])
def test_branches_and_tags_are_resolved(remote, revision) -> None:
    fetched = fetch_procthor10k(revision, ["val"])
    assert fetched.manifest.revision == COMMIT
    assert (fetched.folder / "val.jsonl.gz").read_bytes() == remote.files["val"]


@pytest.mark.parametrize("harm", ["truncated", "changed", "removed", "manifest"])
def test_a_broken_file_is_named_and_fetched_again(remote, harm) -> None:
    folder = fetch_procthor10k(COMMIT).folder
    path = folder / ("manifest.json" if harm == "manifest" else "val.jsonl.gz")
    data = path.read_bytes()
    if harm == "removed":
        path.unlink()
    else:
        path.write_bytes(data[: len(data) // 2] if harm != "changed" else data[:-9] + b"?" + data[-8:])
    with pytest.raises(DatasetCorruptError, match=path.name):
        split_path(HouseSet("val", COMMIT))
    told: list[str] = []
    assert "val" in fetch_procthor10k(COMMIT, on_progress=told.append).new
    assert harm == "manifest" or "val.jsonl.gz" in told[0]
    assert split_path(HouseSet("val", COMMIT)).read_bytes() == remote.files["val"]


def test_the_pinned_revision_is_held_to_the_published_checksums(remote) -> None:
    """Other houses under the pinned commit's name, as a tampered mirror would have them, are refused."""
    remote.pages[f"/files/{REVISION}/val.jsonl.gz"] = remote.files["val"]
    with pytest.raises(DatasetCorruptError, match=r"val\.jsonl\.gz: corrupt.*d8085405"):
        fetch_procthor10k(REVISION, ["val"])
    assert list(dataset_folder(REVISION).iterdir()) == []
    assert remote.requests == [f"/files/{REVISION}/val.jsonl.gz"]
    assert {name: entry.num_houses for name, entry in PUBLISHED[REVISION].items()} == {
        "train": 10_000,
        "val": 1_000,
        "test": 1_000,
    }


def test_an_interrupted_download_leaves_nothing_and_is_repeated(remote) -> None:
    name, data = f"/files/{COMMIT}/val.jsonl.gz", remote.files["val"]
    remote.pages[name] = data[: len(data) // 2]
    with pytest.raises(DatasetCorruptError, match=r"val\.jsonl\.gz"):
        fetch_procthor10k(COMMIT)
    assert [path.name for path in dataset_folder(COMMIT).iterdir()] == ["train.jsonl.gz"]
    remote.pages[name] = data
    remote.requests.clear()
    fetch_procthor10k(COMMIT)
    assert f"/files/{COMMIT}/train.jsonl.gz" not in remote.requests
    assert split_path(HouseSet("val", COMMIT)).read_bytes() == data


def test_a_file_without_a_pointer_is_refused(remote) -> None:
    remote.pages[f"/pointers/{COMMIT}/val.jsonl.gz"] = remote.files["val"]
    with pytest.raises(DatasetCorruptError, match=r"val\.jsonl\.gz: no git-lfs pointer"):
        fetch_procthor10k(COMMIT, ["val"])


@pytest.mark.parametrize("revision", ["0" * 40, "no-such-branch", "--upload-pack=x", "../../main"])
def test_unknown_revisions(remote, revision) -> None:
    with pytest.raises(DatasetError, match="--houses"):
        fetch_procthor10k(revision)
    assert not dataset_folder("x").parent.exists()


def test_files_of_prior_need_no_network(remote, tmp_path, monkeypatch) -> None:
    stored = tmp_path / "home/.prior/datasets/allenai/procthor-10k" / REVISION / "val.jsonl.gz"
    stored.parent.mkdir(parents=True)
    stored.write_bytes(remote.files["val"])
    published = fetch_procthor10k(COMMIT, ["val"]).manifest.splits["val"]
    monkeypatch.setattr(procthor10k, "PUBLISHED", {REVISION: {"val": published}})
    remote.requests.clear()
    fetched = fetch_procthor10k(REVISION, ["val"])
    assert fetched.new == ("val",)
    assert (fetched.folder / "val.jsonl.gz").read_bytes() == remote.files["val"]
    assert remote.requests == []


@pytest.mark.parametrize(
    ("status", "cause"),
    [(403, "wait an hour"), (429, "wait an hour"), (401, "no such"), (404, "no such"), (502, "try again later")],
)
def test_causes_of_a_refusal_are_distinguished(remote, status, cause) -> None:
    remote.status = status
    remote.pages.clear()
    for revision in ("main", COMMIT, REVISION):
        with pytest.raises(DatasetError, match=rf"http://127.*status {status}.*--houses") as caught:
            fetch_procthor10k(revision, ["val"])
        assert cause in str(caught.value)
        assert isinstance(caught.value, HouseError)
        assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_no_network_and_no_room(remote, monkeypatch, tmp_path) -> None:
    nowhere = "http://127.0.0.1:9"  # the port that discards: nobody listens
    monkeypatch.setattr(procthor10k, "FILES", nowhere)
    with pytest.raises(DatasetError, match=r"cannot be reached.*--houses"):
        fetch_procthor10k()
    refused = CliRunner().invoke(app, ["houses", "fetch", "procthor-10k"])
    assert isinstance(refused.exception, DatasetError)
    monkeypatch.setattr(procthor10k, "FILES", f"{remote.url}/files")
    (tmp_path / "file").write_text("")
    with pytest.raises(DatasetError, match=r"val\.jsonl\.gz: .*[Nn]ot a directory"):
        fetch_procthor10k(COMMIT, ["val"], cache=tmp_path / "file")


def test_names_of_splits(tmp_path, monkeypatch) -> None:
    assert house_set("procthor-10k:val") == HouseSet("val", REVISION)
    assert house_set(Path("procthor-10k:train@main")) == HouseSet("train", "main")
    for wrong in ("procthor-10k", "procthor-10k:valid", "procthor-10k:"):
        with pytest.raises(InvalidArgumentError, match="train, val, test"):
            house_set(wrong)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "procthor-10k").mkdir()
    (tmp_path / "procthor-10k/a.json").write_text(next(bundled_houses(1)).to_json())
    assert len(list(stream_houses("procthor-10k"))) == 1


def test_where_the_cache_is(monkeypatch) -> None:
    monkeypatch.delenv("EVONAV_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "/var/xdg")
    assert dataset_folder("r") == Path("/var/xdg/evonav/houses/procthor-10k/r")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", "/home/someone")
    assert dataset_folder("r") == Path("/home/someone/.cache/evonav/houses/procthor-10k/r")
    monkeypatch.setenv("EVONAV_CACHE", "/data/evonav")
    assert dataset_folder("r") == Path("/data/evonav/houses/procthor-10k/r")
