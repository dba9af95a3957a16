"""ProcTHOR-10k, through the real `prior` and git, from a repository on this machine laid out like the published one."""

import gzip
import hashlib
import importlib.util
import json
import os
import pickle
import shutil
import stat
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.errors import HouseError, InvalidArgumentError
from evonav.house import bundled_houses, load_houses
from evonav.house.dataset_errors import (
    DatasetAccessError,
    DatasetCorruptError,
    DatasetError,
    DatasetMissingError,
    DatasetNetworkError,
    DatasetQuotaError,
    DatasetToolError,
)
from evonav.house.procthor10k import PUBLISHED, REVISION, SPLITS, HouseSet, dataset_folder, house_set, split_path
from evonav.house.procthor10k_fetch import _failure, fetch_procthor10k

pytestmark = [
    pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed"),
    pytest.mark.skipif(importlib.util.find_spec("prior") is None, reason="prior is not installed (group `thor`)"),
]
NUM_HOUSES = {"train": 3, "val": 2, "test": 1}
MAIN = """
import gzip

import prior
from tqdm import tqdm


def load_dataset():
    print("a word of warning, as the published file prints")
    data = {}
    for split, size in [("train", 3), ("val", 2), ("test", 1)]:
        with gzip.open(f"{split}.jsonl.gz", "r") as f:
            data[split] = prior.LazyJsonDataset([line for line in tqdm(f, total=size)], "procthor-dataset", split)
    return prior.DatasetDict(**data)
"""


class Remote(NamedTuple):
    path: Path
    commit: str
    files: dict[str, bytes]
    texts: dict[str, list[str]]


def git(cwd: Path, *arguments: str) -> str:
    named = ("-c", "user.name=test", "-c", "user.email=test@example.org", "-c", "init.defaultBranch=main")
    return subprocess.run(["git", *named, *arguments], cwd=cwd, check=True, capture_output=True, text=True).stdout


@pytest.fixture(params=["git-lfs", "stand-in"])
def remote(request, tmp_path, monkeypatch) -> Remote:
    """A bare repository in place of `https://github.com/allenai/procthor-10k.git`, a fresh home and an empty cache."""
    tools = tmp_path / "bin"
    tools.mkdir()
    if request.param == "git-lfs":
        if shutil.which("git-lfs") is None:
            pytest.skip("git-lfs is not installed")
    else:
        program = tools / "git-lfs"
        stand_in = Path(__file__).with_name("git_lfs_stand_in.py")
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{stand_in}" "$@"\n')
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    host = tmp_path / "host"
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    monkeypatch.setenv("EVONAV_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("GIT_CONFIG_COUNT", "1")
    monkeypatch.setenv("GIT_CONFIG_KEY_0", f"url.file://{host}/.insteadOf")
    monkeypatch.setenv("GIT_CONFIG_VALUE_0", "https://github.com/allenai/")
    return _published(host / "procthor-10k.git", tmp_path / "work")


def _published(bare: Path, work: Path) -> Remote:
    bare.mkdir(parents=True)
    work.mkdir()
    git(bare, "init", "--bare", "--quiet")
    git(work, "init", "--quiet")
    houses = iter(sorted(bundled_houses(40), key=lambda house: len(house.to_json())))
    texts = {split: [next(houses).to_json() for _ in range(count)] for split, count in NUM_HOUSES.items()}
    files = {split: gzip.compress("".join(f"{text}\n" for text in texts[split]).encode(), mtime=0) for split in SPLITS}
    for split, data in files.items():
        oid = hashlib.sha256(data).hexdigest()
        pointer = f"version https://git-lfs.github.com/spec/v1\noid sha256:{oid}\nsize {len(data)}\n"
        (work / f"{split}.jsonl.gz").write_text(pointer)
        kept = bare / "lfs/objects" / oid[:2] / oid[2:4] / oid
        kept.parent.mkdir(parents=True)
        kept.write_bytes(data)
    (work / "main.py").write_text(MAIN)
    git(work, "add", ".")
    (work / ".gitattributes").write_text("*.gz filter=lfs diff=lfs merge=lfs -text\n")
    git(work, "add", ".gitattributes")
    git(work, "commit", "--quiet", "-m", "houses")
    commit = git(work, "rev-parse", "HEAD").strip()
    git(work, "tag", "-a", "2022", "-m", "a tag with a text")
    (work / "README.md").write_text("later\n")
    git(work, "add", "README.md")
    git(work, "commit", "--quiet", "-m", "later")
    git(work, "push", "--quiet", "--tags", str(bare), "main")
    return Remote(bare, commit, files, texts)


def test_fetch_keeps_the_published_bytes_and_a_second_call_only_looks(remote) -> None:
    before = Path.cwd()
    fetched = fetch_procthor10k(remote.commit)
    assert Path.cwd() == before
    assert fetched.new == SPLITS
    assert fetched.folder == dataset_folder(remote.commit)
    for split in SPLITS:
        assert (fetched.folder / f"{split}.jsonl.gz").read_bytes() == remote.files[split]
    manifest = json.loads((fetched.folder / "manifest.json").read_text())
    assert manifest["revision"] == remote.commit
    assert {name: entry["num_houses"] for name, entry in manifest["splits"].items()} == NUM_HOUSES
    assert manifest["splits"]["val"]["sha256"] == hashlib.sha256(remote.files["val"]).hexdigest()
    assert list(fetched.folder.glob("*.part-*")) == []

    shutil.rmtree(remote.path)  # nothing is asked of the host again
    shutil.rmtree(Path(os.environ["HOME"]) / ".prior")
    when = {path: path.stat().st_mtime_ns for path in fetched.folder.iterdir()}
    again = fetch_procthor10k(remote.commit)
    assert again == fetched._replace(new=())
    assert {path: path.stat().st_mtime_ns for path in fetched.folder.iterdir()} == when


def test_a_split_is_read_wherever_houses_are(remote, tmp_path) -> None:
    fetch_procthor10k(remote.commit, ["val"])
    name = f"procthor-10k:val@{remote.commit}"
    loaded = list(load_houses(name))
    assert [house.to_json() for house in loaded] == remote.texts["val"]
    assert loaded[1].name == f"{name}:2"
    listed = CliRunner().invoke(app, ["houses", name, "--limit", "1"])
    assert listed.stdout.startswith(f"{name}:1\t"), listed.output
    made = CliRunner().invoke(app, ["generate", "--houses", name, "--out", str(tmp_path / "tasks"), "--limit", "1"])
    assert made.exit_code == 0, made.output
    header = next((tmp_path / "tasks").glob("*/task.json"))
    assert json.loads(header.read_text())["dataset"] == "procthor-10k"
    assert json.loads(header.read_text())["split"] == "val"
    with pytest.raises(DatasetMissingError, match="procthor-10k:test is not in"):
        load_houses(f"procthor-10k:test@{remote.commit}")


def test_splits_fetched_one_after_the_other_add_up(remote) -> None:
    fetch_procthor10k(remote.commit, ["val"])
    assert fetch_procthor10k(remote.commit, ["test", "val"]).new == ("test",)
    assert fetch_procthor10k(remote.commit).new == ("train",)


@pytest.mark.parametrize("revision", ["main", "2022"])
def test_branches_and_tags_are_resolved(remote, revision) -> None:
    fetched = fetch_procthor10k(revision)
    head = git(remote.path, "rev-parse", "main").strip()
    assert fetched.manifest.revision == {"main": head, "2022": remote.commit}[revision]
    assert (fetched.folder / "val.jsonl.gz").read_bytes() == remote.files["val"]


@pytest.mark.parametrize("harm", ["truncated", "changed", "removed", "manifest"])
def test_a_broken_file_is_named_and_fetched_again(remote, harm) -> None:
    folder = fetch_procthor10k(remote.commit).folder
    path = folder / ("manifest.json" if harm == "manifest" else "val.jsonl.gz")
    data = path.read_bytes()
    if harm == "removed":
        path.unlink()
    else:
        path.write_bytes(data[: len(data) // 2] if harm != "changed" else data[:-9] + b"?" + data[-8:])
    with pytest.raises(DatasetCorruptError, match=path.name):
        split_path(HouseSet("val", remote.commit))
    told: list[str] = []
    assert "val" in fetch_procthor10k(remote.commit, on_progress=told.append).new
    assert harm == "manifest" or "val.jsonl.gz" in told[0]
    assert split_path(HouseSet("val", remote.commit)).read_bytes() == remote.files["val"]


def test_the_pinned_revision_is_held_to_the_published_checksums(remote) -> None:
    """Other houses under the pinned commit's name, as a tampered mirror or cache would have them, are refused."""
    clone = Path(os.environ["HOME"]) / ".prior/datasets/allenai/procthor-10k" / REVISION
    git(remote.path.parent, "clone", "--quiet", str(remote.path), str(clone))
    git(clone, "-c", "advice.detachedHead=false", "checkout", "--quiet", remote.commit)
    for split, data in remote.files.items():
        (clone / f"{split}.jsonl.gz").write_bytes(data)
    with pytest.raises(DatasetCorruptError, match=r"val\.jsonl\.gz: corrupt.* expected d8085405"):
        fetch_procthor10k(REVISION, ["val"])
    assert {name: entry.num_houses for name, entry in PUBLISHED[REVISION].items()} == {
        "train": 10_000,
        "val": 1_000,
        "test": 1_000,
    }


def test_a_pointer_is_no_house(remote, monkeypatch) -> None:
    """A git-lfs that succeeds and brings nothing."""
    program = Path(os.environ["HOME"]).parent / "bin/git-lfs"
    program.write_text("#!/bin/sh\nexit 0\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")
    with pytest.raises(DatasetCorruptError, match=r"train\.jsonl\.gz: holds a git-lfs pointer"):
        fetch_procthor10k(remote.commit)


@pytest.mark.parametrize(
    ("revision", "kind"),
    [("0" * 40, DatasetAccessError), ("no-such-branch", DatasetAccessError), ("--upload-pack=x", DatasetAccessError)],
)
def test_unknown_revisions(remote, revision, kind) -> None:
    with pytest.raises(kind, match="--houses"):
        fetch_procthor10k(revision)
    assert not list(Path(os.environ["HOME"]).glob(".prior/datasets/allenai/procthor-10k/*"))


def test_what_prior_already_has_needs_no_network(remote) -> None:
    first = fetch_procthor10k(remote.commit)
    shutil.rmtree(os.environ["EVONAV_CACHE"])
    shutil.rmtree(remote.path)
    assert fetch_procthor10k(remote.commit) == first


def test_a_clone_cut_short_is_made_again(remote) -> None:
    clone = Path(os.environ["HOME"]) / ".prior/datasets/allenai/procthor-10k" / remote.commit
    clone.mkdir(parents=True)
    (clone / "half").write_text("of a clone")
    assert fetch_procthor10k(remote.commit).new == SPLITS


def test_no_repository_no_network_no_git(remote, monkeypatch, tmp_path) -> None:
    shutil.rmtree(remote.path)
    with pytest.raises(DatasetAccessError, match="no such repository"):
        fetch_procthor10k(remote.commit)
    monkeypatch.setenv("GIT_CONFIG_KEY_0", "http.proxy")
    monkeypatch.setenv("GIT_CONFIG_VALUE_0", "http://127.0.0.1:9")  # the port that discards: nobody listens
    with pytest.raises(DatasetNetworkError, match=r"cannot be reached.*--houses"):
        fetch_procthor10k()
    refused = CliRunner().invoke(app, ["houses", "fetch", "procthor-10k"])
    assert isinstance(refused.exception, DatasetNetworkError)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(DatasetToolError, match="`git` is not installed"):
        fetch_procthor10k()


def test_without_prior_the_extra_is_named(remote, tmp_path) -> None:
    code = (
        "import sys; sys.modules['prior'] = None\n"
        "from evonav.house.procthor10k_fetch import fetch_procthor10k\n"
        "try: fetch_procthor10k()\n"
        "except Exception as error: print(type(error).__name__, error)\n"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.startswith("DatasetToolError")
    assert "evonav[thor]" in said


@pytest.mark.parametrize(
    ("said", "kind"),
    [
        ("fatal: unable to access 'https://x/': The requested URL returned error: 429", DatasetQuotaError),
        ("batch response: This repository is over its data quota.", DatasetQuotaError),
        ("fatal: could not read Username for 'https://github.com': terminal prompts disabled", DatasetAccessError),
        ("fatal: unable to access 'https://x/': Could not resolve host: github.com", DatasetNetworkError),
        ("batch request: dial tcp 140.82.121.3:443: i/o timeout", DatasetNetworkError),
        ("something new", DatasetError),
    ],
)
def test_what_git_says_is_told_by_cause(said, kind) -> None:
    error = _failure(said)
    assert type(error) is kind
    assert isinstance(error, HouseError)
    assert said in str(error)
    assert "--houses" in str(error)
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_names_of_splits(tmp_path, monkeypatch) -> None:
    assert house_set("procthor-10k:val") == HouseSet("val", REVISION)
    assert house_set(Path("procthor-10k:train@main")) == HouseSet("train", "main")
    assert house_set("houses.jsonl.gz") is None
    for wrong in ("procthor-10k", "procthor-10k:valid", "procthor-10k:"):
        with pytest.raises(InvalidArgumentError, match="train, val, test"):
            house_set(wrong)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "procthor-10k").mkdir()
    (tmp_path / "procthor-10k/a.json").write_text(next(bundled_houses(1)).to_json())
    assert len(list(load_houses("procthor-10k"))) == 1


def test_where_the_cache_is(monkeypatch) -> None:
    monkeypatch.delenv("EVONAV_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "/var/xdg")
    assert dataset_folder("r") == Path("/var/xdg/evonav/houses/procthor-10k/r")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", "/home/someone")
    assert dataset_folder("r") == Path("/home/someone/.cache/evonav/houses/procthor-10k/r")
    monkeypatch.setenv("EVONAV_CACHE", "/data/evonav")
    assert dataset_folder("r") == Path("/data/evonav/houses/procthor-10k/r")
