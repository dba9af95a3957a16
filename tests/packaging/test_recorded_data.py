"""Tests on data that is not in the repository say what to set; no text names a folder of somebody's machine."""

import re
import subprocess
from pathlib import Path

import pytest
import recorded_data
from recorded_data import VARIABLE, data_folder, data_path, why_skipped

ROOT = Path(__file__).parents[2]
PRIVATE = re.compile(r"\.\./shared|EVONAV_SHARED")


def test_the_folder_of_data_sets_is_the_variables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    (tmp_path / "ram81-procthor-1k").mkdir()
    assert data_path("ram81-procthor-1k") == tmp_path / "ram81-procthor-1k"
    assert why_skipped("ram81-procthor-1k") is None
    reason = why_skipped("ram81-procthor-1k", "ram81-procthor-1k/val.jsonl.gz", "procthor-databases")
    assert reason is not None
    assert reason.startswith("ram81-procthor-1k/val.jsonl.gz, procthor-databases not found: set EVONAV_DATA")


def test_without_the_variable_it_is_beside_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert data_folder() == recorded_data.BESIDE_THE_CHECKOUT


def test_a_variable_that_names_no_folder_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "nowhere"))
    with pytest.raises(NotADirectoryError, match=r"EVONAV_DATA is .*nowhere.*, which is not a folder"):
        data_folder()


def test_every_data_set_is_documented() -> None:
    page = (ROOT / "docs/data-sets.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `([\w-]+)` \|", page, re.MULTILINE)) == recorded_data.DATA_SETS
    with pytest.raises(AssertionError, match="no-such-set"):
        data_path("no-such-set/houses.json")


def test_nothing_names_a_folder_of_a_private_checkout() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not a git checkout")
    suffixes = {".md", ".py", ".pyi", ".rs", ".toml", ".yml", ".svg", ""}
    found = [
        name
        for name in listed.stdout.splitlines()
        if Path(name).suffix in suffixes
        and (ROOT / name) != Path(__file__)
        and (ROOT / name).is_file()
        and PRIVATE.search((ROOT / name).read_text(encoding="utf-8"))
    ]
    assert found == []
