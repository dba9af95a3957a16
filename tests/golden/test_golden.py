"""The small run of everything gives the committed digests."""

from pathlib import Path

import pytest
from small_run import PARTS, differences, digests_of


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_small_run_gives_the_committed_digests(part: str, tmp_path: Path) -> None:
    changed = differences(part, digests_of(part, tmp_path))
    assert not changed, "numbers changed; if they should: python tests/golden/small_run.py --write"
