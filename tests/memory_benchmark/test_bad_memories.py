"""Each breach of the contract is one clear sentence, and costs the memory its stream alone."""

from pathlib import Path
from typing import Any

import bad_memories
import numpy as np
import pytest
from bad_memories import GOOD, Answers, Good
from hand_made import HandMade, Shot, body, entry

from evonav.errors import InvalidArgumentError
from evonav.memory_benchmark.answers import MemoryFailedError, read_entries, read_num_bytes, read_places
from evonav.memory_benchmark.protocol import FoundPlace
from evonav.memory_benchmark.run import NO_DETECTIONS, MeasureSettings, measure, measure_all

FILE = Path(bad_memories.__file__)
MUG = (body("mug", 1.0),)
STREAM = HandMade([Shot(MUG, visible={"mug": 50})] * 60)


@pytest.mark.parametrize(
    ("name", "kind", "message", "frame"),
    [
        ("Raises", "raised", "observe() raises KeyError: 'no such voxel' [bad_memories:48 in observe]", 3),
        ("Exits", "raised", "observe() raises SystemExit: 3", 0),
        ("Hangs", "hung", "no answer to `observe` within 1 s", 3),
        ("Dies", "died", "the memory's process died (exit code 7)", 3),
        ("NanBoxes", "answer", "entries()[1].centre_m = (1.0, nan, 0.0): must be finite", 0),
        ("Million", "answer", "entries(): 1000000 entries, must be at most 100000", 0),
        ("LiesAboutBytes", "answer", "num_bytes() = 1: 1 entry alone takes at least 6 bytes", 59),
        ("NegativeBytes", "answer", "num_bytes() = -5: must not be negative", 59),
        ("AnswersNone", "answer", "entries() = None: must be a sequence of MemoryEntry", 0),
        ("Raising", "load", "cannot be made: OSError: no weights", None),
        ("Missing", "load", "`bad_memories` has no `Missing`", None),
    ],
)
def test_failure_is_the_same_in_its_own_process_and_in_this_one(
    name: str, kind: str, message: str, frame: int | None
) -> None:
    result = measure(f"{FILE}:{name}", STREAM, MeasureSettings(timeout_s=1.0, every=1))
    assert result.failure is not None
    assert (result.failure.kind, result.failure.frame) == (kind, frame)
    assert message in result.failure.message
    assert result.update is None
    assert result.speed is None
    assert result.spells == ()
    if kind in ("raised", "answer"):
        assert measure(getattr(bad_memories, name), STREAM, MeasureSettings(every=1)).failure == result.failure


def test_memories_side_by_side_do_not_disturb_each_other() -> None:
    names = ["Good", "Raises", "Hangs", "Good"]
    results = measure_all([f"{FILE}:{name}" for name in names], STREAM, MeasureSettings(timeout_s=1.0))
    assert [result.failure and result.failure.kind for result in results] == [None, "raised", "hung", None]
    alone = measure(Good, STREAM)
    for good in (results[0], results[3]):
        assert (good.digest, good.update, good.num_frames) == (alone.digest, alone.update, alone.num_frames)
    assert results[1].num_frames < alone.num_frames


def test_a_stream_is_rendered_once_and_not_to_its_end_if_all_failed() -> None:
    read: list[int] = []

    class Counted(HandMade):
        def frames(self):
            for frame, truth in super().frames():
                read.append(frame.index)
                yield frame, truth

    stream = Counted(STREAM.shots)
    measure_all([Good, Good], stream)
    assert read == list(range(len(STREAM.shots)))
    read.clear()
    measure_all([bad_memories.Raises, bad_memories.Raises], stream)
    assert read == [0, 1, 2, 3, 4]


def test_good_memory_gives_the_same_wherever_it_runs() -> None:
    here, there = measure(Good, STREAM), measure(f"{FILE}:Good", STREAM, MeasureSettings(runs_twice=True))
    assert there.failure is None, there.failure
    assert (here.hosting, there.hosting) == ("here", "process")
    assert here.update == there.update
    assert here.queries == there.queries
    assert here.digest == there.digest
    assert there.is_deterministic
    assert there.speed is not None
    assert there.speed.observe_cpu is not None
    assert there.speed.observe_cpu.n == 40
    assert there.size is not None
    assert there.size.num_bytes == 1000
    assert there.size.peak_rss_mb is not None


def test_memory_without_entries_keeps_the_contract() -> None:
    result = measure(f"{FILE}:Empty", STREAM)
    assert result.failure is None, result.failure
    assert result.update is not None
    assert (result.update.seen, result.update.seen_remembered) == (1, 0)
    assert result.size is not None
    assert result.size.bytes_per_entry is None


def test_other_bits_in_the_second_run_are_found() -> None:
    assert measure(bad_memories.Forgetful, STREAM, MeasureSettings(runs_twice=True)).is_deterministic is False


def test_leak_is_measured_and_noted() -> None:
    result = measure(f"{FILE}:Leaks", STREAM)
    assert result.failure is None, result.failure
    assert result.size is not None
    assert result.size.rss_growth_mb_per_minute == pytest.approx(240.0, rel=0.2)  # 2 MB a frame, 120 frames a minute
    assert result.notes == (f"num_bytes() says 0.0 MB, and its process grew by {result.size.rss_growth_mb:.1f} MB",)


def test_function_has_no_process_of_its_own() -> None:
    with pytest.raises(InvalidArgumentError, match="own_process: a function cannot be sent"):
        measure(Good, STREAM, MeasureSettings(own_process=True))


def test_settings_are_checked() -> None:
    with pytest.raises(InvalidArgumentError, match="every = 0"):
        MeasureSettings(every=0)
    with pytest.raises(InvalidArgumentError, match="timeout_s = 0"):
        MeasureSettings(timeout_s=0.0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"size_m": (0.1, -0.1, 0.1)}, r"\[1\].size_m = \(0.1, -0.1, 0.1\): must be finite and not negative"),
        ({"centre_m": (0.1, float("inf"), 0.1)}, r"\[1\].centre_m = .*: must be finite"),
        ({"centre_m": (0.1, 0.2)}, r"\[1\].centre_m = \(0.1, 0.2\): must be three numbers"),
        ({"centre_m": ("1", "2", "3")}, r"\[1\].centre_m = .*: must be three numbers"),
        ({"p_present": 1.5}, r"\[1\].p_present = 1.5: must be from 0 to 1"),
        ({"confidence": -0.1}, r"\[1\].confidence = -0.1: must be from 0 to 1"),
        ({"confidence": None}, r"\[1\].confidence = None: must be a number"),
        ({"last_seen_s": float("inf")}, r"\[1\].last_seen_s = inf: must be finite or None"),
        ({"label": 7}, r"\[1\].label = 7: must be text"),
        ({"entry_id": 1.5}, r"\[1\].entry_id = 1.5: must be a whole number"),
        ({"entry_id": 1}, r"entry_id = 1: must be of one entry only"),
        ({"entry_id": 2**70}, r"\[1\].entry_id = .*: must be a whole number"),
    ],
)
def test_wrong_entries(fields: dict[str, Any], message: str) -> None:
    answer = Answers(**{"entry_id": 2, **fields}).entries()
    with pytest.raises(MemoryFailedError, match=message) as caught:
        read_entries(answer)
    assert caught.value.kind == "answer"


def test_entries_of_numpy_numbers_are_right() -> None:
    other = Answers(entry_id=np.int64(2), centre_m=np.array([1.0, 2.0, 3.0]), confidence=np.float32(0.5)).entries()
    table = read_entries(other)
    assert table.ids.tolist() == [1, 2]
    assert table.centres_m.tolist() == [[1.0, 1.0, 0.0], [1.0, 2.0, 3.0]]
    assert np.isnan(table.p_present).all()
    assert len(read_entries([])) == 0


@pytest.mark.parametrize("answer", ["entries", [GOOD, 3], [None], 7])
def test_answers_that_are_no_entries(answer: object) -> None:
    with pytest.raises(MemoryFailedError, match="must be a"):
        read_entries(answer)


def test_places_and_sizes_are_checked() -> None:
    place = FoundPlace((1.0, 2.0, 3.0), 0.5)
    assert read_places([place], 1) == [place]
    best = FoundPlace((0.0, 0.0, 0.0), 0.9)
    assert read_places([place, best], 2) == [best, place]
    for answer, message in [
        ([place, place], "2 places, must be at most 1"),
        ([3], "must be a FoundPlace"),
        ([FoundPlace((1.0, float("nan"), 0.0), 1.0)], "must be finite"),
        (None, "must be a sequence of FoundPlace"),
    ]:
        with pytest.raises(MemoryFailedError, match=message):
            read_places(answer, 1)
    for size in (1.5, True, None):
        with pytest.raises(MemoryFailedError, match="must be a whole number"):
            read_num_bytes(size, 0)
    assert read_num_bytes(np.int64(6), 1) == 6
    assert entry(1, 1.0) == GOOD


def test_a_memory_without_truth_is_timed_and_not_judged() -> None:
    result = measure(Good, HandMade([Shot(MUG, detected=("mug",))] * 60, has_truth=False))
    assert result.failure is None, result.failure
    assert (result.update, result.spells, result.belief, result.queries) == (None, (), None, None)
    assert result.speed is not None
    assert result.speed.observe_wall.n == 40
    assert result.size is not None
    assert result.size.bytes_per_entry == 1000.0
    assert result.digest == measure(Good, STREAM, MeasureSettings(every=10)).digest
    assert result.notes == (NO_DETECTIONS,)
