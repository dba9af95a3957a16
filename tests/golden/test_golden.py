"""The small run of everything gives the committed digests."""

from pathlib import Path

import pytest
from small_run import differences, small_run


@pytest.mark.slow
def test_small_run_gives_the_committed_digests(tmp_path: Path) -> None:
    changed = differences(small_run(tmp_path))
    assert not changed, "numbers changed; if they should: python tests/golden/small_run.py --write"
