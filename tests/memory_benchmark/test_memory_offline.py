"""Answers in a file are judged as those of a memory in this process, and a wrong line is named."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from hand_made import HandMade, Scripted, Shot, body, entry

from evonav.errors import StoreError
from evonav.memory_benchmark.offline import score
from evonav.memory_benchmark.protocol import MemoryEntry
from evonav.memory_benchmark.run import measure
from evonav.memory_benchmark.truth import TrueChange

OLD = body("mug", 1.0)
SHOTS = [Shot((OLD,), visible={"mug": 100})] * 4 + [Shot((), 2, {}, {0: 60})] * 26
STREAM = HandMade(SHOTS, [TrueChange("mug", "Mug", "removed", 4, OLD, None)])


def answer(index: int) -> list[MemoryEntry]:
    return [entry(1, 1.0)] if index < 9 else []


def write(path: Path, lines: list[dict[str, Any]]) -> Path:
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def lines(**more: Any) -> list[dict[str, Any]]:
    return [{"frame": i, "entries": [asdict(one) for one in answer(i)], **more} for i in range(len(SHOTS))]


def test_file_is_judged_as_a_memory_is(tmp_path: Path) -> None:
    here = measure(lambda: Scripted(answer), STREAM)
    offline = score(STREAM, write(tmp_path / "entries.jsonl", lines(seconds=0.02, num_bytes=100)))
    assert offline.failure is None
    assert offline.hosting == "offline"
    assert (offline.update, offline.spells, offline.digest) == (here.update, here.spells, here.digest)
    assert offline.speed is not None
    assert offline.speed.observe_cpu is None
    assert offline.speed.observe_wall.n == 10
    assert offline.speed.observe_wall.p95_ms == pytest.approx(20.0)
    assert offline.speed.real_time_factor == pytest.approx(25.0)
    assert offline.size is not None
    assert offline.size.num_bytes == 100


def test_frames_without_a_line_keep_the_entries(tmp_path: Path) -> None:
    here = measure(lambda: Scripted(answer), STREAM)
    few = [line for line in lines() if line["frame"] in (0, 9)]
    offline = score(STREAM, write(tmp_path / "entries.jsonl", few))
    assert (offline.update, offline.spells) == (here.update, here.spells)
    assert offline.speed is None


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ({"frame": 1}, 'line 2: missing "entries"'),
        ({"frame": -1, "entries": []}, "line 2: frame = -1"),
        ({"frame": "1", "entries": []}, "line 2: frame = '1'"),
        ({"frame": 0, "entries": []}, "line 2: frame = 0: must be later than before"),
        ({"frame": 40, "entries": []}, "line 2: frame = 40: the last frame is 29"),
        ({"frame": 1, "entries": [], "cost": 3}, "line 2: cost = 3"),
        ({"frame": 1, "entries": [], "seconds": -3.0}, "line 2: seconds = -3.0"),
        ({"frame": 1, "entries": [{"entry_id": 1}]}, 'line 2: missing "entries.0.label"'),
        ({"frame": 1, "entries": [{**asdict(entry(1, 1.0)), "label": 3}]}, "line 2: entries.0.label = 3"),
        ({"frame": 1, "entries": [{**asdict(entry(1, 1.0)), "box": 3}]}, "line 2: entries.0.box = 3"),
        (
            {"frame": 1, "entries": [{**asdict(entry(1, 1.0)), "size_m": [1, -1, 1]}]},
            r"line 2: entries\[0\].size_m = \(1.0, -1.0, 1.0\): must be finite and not negative",
        ),
        (
            {"frame": 1, "entries": [{**asdict(entry(1, 1.0)), "centre_m": [1, float("nan"), 1]}]},
            "line 2: entries.0.centre_m.1 = nan",
        ),
    ],
)
def test_wrong_line_is_named(tmp_path: Path, line: dict[str, Any], message: str) -> None:
    path = write(tmp_path / "entries.jsonl", [{"frame": 0, "entries": []}, line])
    with pytest.raises(StoreError, match=message) as caught:
        score(STREAM, path)
    assert str(caught.value).startswith(str(path))


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="cannot be read: No such file"):
        score(STREAM, tmp_path / "missing.jsonl")
    (tmp_path / "empty.jsonl").write_text("\n")
    with pytest.raises(StoreError, match="has no line"):
        score(STREAM, tmp_path / "empty.jsonl")
    (tmp_path / "text.jsonl").write_text("hello\n")
    with pytest.raises(StoreError, match=r"line 1: .*Invalid JSON"):
        score(STREAM, tmp_path / "text.jsonl")
