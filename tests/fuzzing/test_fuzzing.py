"""A short run of the fuzzers, always of the same cases; `make fuzz` runs many more."""

from pathlib import Path

import pytest
from fuzz import TARGETS, fuzz, peak_mb

CORPUS = Path(__file__).with_name("corpus")
NUM_CASES = {
    "house_files": 300,
    "houses": 100,
    "messages": 1000,
    "packs": 300,
    "responses": 1000,
    "sweeps": 300,
    "tasks": 100,
}


@pytest.mark.parametrize("name", sorted(TARGETS))
def test_a_fuzzer_finds_nothing(name: str, tmp_path: Path) -> None:
    before_mb = peak_mb()
    ends, failed = fuzz(TARGETS[name](tmp_path), range(NUM_CASES[name]), seed=1, out=tmp_path / "failed")
    assert not failed, [path.read_text()[-2000:] for path in (tmp_path / "failed").glob("*.txt")]
    assert len(ends) > 1, "cases end in different ways, or nothing is tried"
    assert peak_mb() < before_mb + 500


@pytest.mark.parametrize("path", sorted(CORPUS.rglob("*.bin")), ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_what_a_fuzzer_has_found_is_mended(path: Path, tmp_path: Path) -> None:
    assert TARGETS[path.parent.name](tmp_path).run(path.read_bytes()).endswith("Error")
