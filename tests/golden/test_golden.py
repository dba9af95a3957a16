"""The small run of everything gives the committed digests."""

import subprocess
import sys
from pathlib import Path

import pytest
from small_run import PARTS, differences, digests_of

from evonav import _core


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_small_run_gives_the_committed_digests(part: str, tmp_path: Path) -> None:
    changed = differences(part, digests_of(part, tmp_path))
    assert not changed, "numbers changed; if they should: python tests/golden/small_run.py --write"


# Reference images of houses in the style `default`, and runs on depth and instances.
@pytest.mark.slow
@pytest.mark.skipif(not _core.has_wide_vectors(), reason="this processor has no wide vectors")
@pytest.mark.parametrize("part", ["generation", "six-agents"])
def test_narrow_vectors_give_the_same_digests(part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EVONAV_NARROW_VECTORS", "1")
    asked = [sys.executable, "-c", "from evonav import _core; print(_core.has_wide_vectors())"]
    assert subprocess.run(asked, capture_output=True, check=True, text=True).stdout == "False\n"
    changed = differences(part, digests_of(part, tmp_path))
    assert not changed, "pictures or records depend on the vectors of the processor"
