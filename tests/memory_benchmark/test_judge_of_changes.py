"""Hand-made streams with known answers: removals, moves, additions, forgets, and how long they take."""

from collections.abc import Callable, Sequence

import pytest
from hand_made import HandMade, Scripted, Shot, body, entry

from evonav.memory_benchmark.metrics.counts import ChangeCounts
from evonav.memory_benchmark.metrics.spells import Clocks, Spell
from evonav.memory_benchmark.protocol import MemoryEntry
from evonav.memory_benchmark.records import StreamResult
from evonav.memory_benchmark.run import MeasureSettings, measure
from evonav.memory_benchmark.truth import TrueChange

OLD, NEW, OTHER = body("mug", 1.0), body("mug", 3.0), body("plate", 5.0, "Plate")
BEFORE, GONE, AFTER = (OLD, OTHER), (OTHER,), (NEW, OTHER)
REMOVED = TrueChange("mug", "Mug", "removed", 4, OLD, None)
MOVED = TrueChange("mug", "Mug", "moved", 4, OLD, NEW)
MUG, PLATE = entry(1, 1.0), entry(2, 5.0, "Plate")
BOTH = [MUG, PLATE]
CUP = body("cup", 7.0)
ADDED = TrueChange("cup", "Mug", "added", 4, None, CUP)
FIRST = [Shot(BEFORE, visible={"mug": 100, "plate": 100})] * 4


def judged(
    shots: Sequence[Shot], changes: Sequence[TrueChange], answer: Callable[[int], Sequence[MemoryEntry]], every: int = 1
) -> StreamResult:
    result = measure(lambda: Scripted(answer), HandMade(shots, changes), MeasureSettings(every=every))
    assert result.failure is None, result.failure
    assert result.update is not None
    return result


def removal(evidence_at: int | None, num: int = 8) -> list[Shot]:
    """A second visit of frames 4 to 11, which shows the empty place from a frame on."""
    indices = range(4, 4 + num)
    return [Shot(GONE, 2, {}, {0: 60} if evidence_at is not None and i >= evidence_at else {}) for i in indices]


def test_stale_entry_cleared_at_frame_7() -> None:
    result = judged([*FIRST, *removal(evidence_at=5)], [REMOVED], lambda i: [PLATE] if i >= 7 else BOTH)
    evident = [spell for spell in result.spells if spell.kind == "evident"]
    # Evidence in frames 5, 6 and 7: two frames at 2 Hz and half a metre each lie between the first and the last.
    assert evident == [Spell("evident", 0, Clocks(frames=2, seconds=1.0, metres=1.0, evidence_frames=3), is_over=True)]
    update = result.update
    assert (update.removals, update.removals_done, update.false_forgets) == (1, 1, 0)


def test_stale_entry_never_cleared_is_censored() -> None:
    result = judged([*FIRST, *removal(evidence_at=5)], [REMOVED], lambda i: BOTH)
    spells = {spell.kind: spell for spell in result.spells}
    assert spells["evident"] == Spell("evident", 0, Clocks(6, 3.0, 3.0, 7), is_over=False)
    assert spells["unseen"] == Spell("unseen", 0, Clocks(1, 0.5, 0.5), is_over=False)
    assert (result.update.removals, result.update.removals_done) == (1, 0)


def test_entry_that_comes_back_was_not_cleared() -> None:
    result = judged(
        [*FIRST, *removal(evidence_at=5)],
        [REMOVED],
        lambda i: [PLATE] if i in (6, 9, 10, 11) else BOTH,
    )
    (evident,) = (spell for spell in result.spells if spell.kind == "evident")
    assert (evident.lasted.frames, evident.is_over) == (4, True)


@pytest.mark.parametrize(
    ("late", "moves_done", "duplicates"),
    [
        ([entry(1, 3.0), PLATE], 1, 0),
        ([MUG, entry(3, 3.0), PLATE], 0, 0),  # a move that leaves two entries
        ([entry(1, 3.0), entry(3, 3.05), PLATE], 0, 1),  # two at the new place
        ([PLATE], 0, 0),
    ],
)
def test_move_is_one_entry(late: list[MemoryEntry], moves_done: int, duplicates: int) -> None:
    shots = [*FIRST, *[Shot(AFTER, 2, {"mug": 30}, {0: 30})] * 4]
    result = judged(shots, [MOVED], lambda i: BOTH if i < 6 else late)
    update = result.update
    assert (update.moves, update.moves_done, update.duplicates) == (1, moves_done, duplicates)
    assert update.removals_done == (MUG not in late)


def test_object_put_back_ends_the_spell() -> None:
    back = TrueChange("mug", "Mug", "moved", 8, NEW, OLD)
    shots = [*FIRST, *[Shot(AFTER, 2, {}, {0: 30})] * 4, *[Shot(BEFORE, 3, {"mug": 50})] * 4]
    result = judged(shots, [MOVED, back], lambda i: BOTH)
    assert Spell("evident", 0, Clocks(3, 1.5, 1.5, 4), is_over=False) in result.spells
    assert Spell("appeared", 1, Clocks(0, 0.0, 0.0, 1), is_over=True) in result.spells
    assert result.update.right_entries == 5  # two, then the plate alone, then two


def test_entry_with_a_small_probability_is_not_believed() -> None:
    result = judged(
        [*FIRST, *removal(evidence_at=5)],
        [REMOVED],
        lambda i: [entry(1, 1.0, p=0.9 if i < 7 else 0.2), entry(2, 5.0, "Plate", p=0.9)],
    )
    (evident,) = (spell for spell in result.spells if spell.kind == "evident")
    assert (evident.lasted.frames, evident.is_over) == (2, True)
    # First and last answers of both visits: five of nine tenths that are right, one that is not, one of a fifth.
    belief = result.belief
    assert belief.n == 8
    assert belief.squared_error == pytest.approx(6 * 0.01 + 0.81 + 0.04)


def test_entries_asked_for_less_often() -> None:
    shots = [*FIRST, *removal(evidence_at=5)]
    result = judged(shots, [REMOVED], lambda i: [PLATE] if i >= 7 else BOTH, every=3)
    (evident,) = (spell for spell in result.spells if spell.kind == "evident")
    assert (evident.lasted.frames, evident.is_over) == (3, True)  # asked after frames 5 and 8


ONE, NONE = ChangeCounts(hits=1), ChangeCounts()
STATIC = [*FIRST, *[Shot(BEFORE, 2)] * 4]
LATE = [*FIRST, *[Shot((*BEFORE, CUP), 2)] * 3, *[Shot((*BEFORE, CUP), 2, {"cup": 25})] * 3]
LATE += [Shot((*BEFORE, CUP), 3)] * 2
NEAR, NEXT_TO = body("mug", 1.2), body("cup", 1.12)
FOUND = [*BOTH, entry(9, 7.1)]
CASES = {
    "too few pixels are no evidence": (
        [*FIRST, *[Shot(GONE, 2, {}, {0: 24})] * 4], [REMOVED], lambda i: BOTH,
        (Spell("unseen", 0, Clocks(3, 1.5, 1.5), is_over=False),), {"removals": 0},
    ),
    "cleared without evidence counts as unseen": (
        [*FIRST, *removal(evidence_at=8)], [REMOVED], lambda i: BOTH if i < 6 else [PLATE],
        (Spell("unseen", 0, Clocks(2, 1.0, 1.0), is_over=True),), {"removals": 1, "removals_done": 1},
    ),
    "a move without a look at the old place is not judged": (
        [*FIRST, *[Shot(AFTER, 2, {"mug": 30})] * 4], [MOVED], lambda i: BOTH,
        (
            Spell("unseen", 0, Clocks(3, 1.5, 1.5), is_over=False),
            Spell("appeared", 0, Clocks(3, 1.5, 1.5, 4), is_over=False),
        ),
        {"moves": 0, "removals": 0},
    ),
    "an addition that is found in time": (
        LATE, [ADDED], lambda i: FOUND if i >= 9 else BOTH,
        (Spell("appeared", 0, Clocks(2, 1.0, 1.0, 3), is_over=True),), {"additions": 1, "additions_done": 1},
    ),
    "an addition that is found too late": (
        LATE, [ADDED], lambda i: FOUND if i >= 10 else BOTH,
        (Spell("appeared", 0, Clocks(3, 1.5, 1.0, 3), is_over=True),), {"additions": 1, "additions_done": 0},
    ),
    "an object that perception missed was not seen": (
        [*FIRST, *[Shot((*BEFORE, CUP), 2, {"cup": 60}, detected=())] * 6], [ADDED], lambda i: BOTH,
        (), {"additions": 0, "seen": 4},
    ),
    "an added object that is forgotten later was found": (
        [*FIRST, *[Shot((*BEFORE, CUP), 2, {"cup": 25})] * 6], [ADDED], lambda i: FOUND if i in (6, 7) else BOTH,
        (Spell("appeared", 0, Clocks(2, 1.0, 1.0, 3), is_over=True),), {"additions_done": 0, "false_forgets": 1},
    ),
    "forgotten and found again": (
        STATIC, [], lambda i: [PLATE] if i == 5 else BOTH,
        (), {"standing": 4, "false_forgets": 1, "false_forgets_at_end": 0},
    ),
    "forgotten": (
        STATIC, [], lambda i: [PLATE] if i >= 5 else BOTH,
        (), {"standing": 4, "false_forgets": 1, "false_forgets_at_end": 1},
    ),
    "forgetting at the start of a visit is forgetting": (
        STATIC, [], lambda i: [] if i == 4 else BOTH,
        (), {"standing": 4, "false_forgets": 2, "false_forgets_at_end": 0},
    ),
    "a memory that forgets everything has no recall": (
        [*FIRST, *removal(evidence_at=5)], [REMOVED], lambda i: [],
        (), {"seen": 3, "seen_remembered": 0, "standing": 0, "removals": 0, "gone": NONE, "come": NONE},
    ),
    "an object that moves during the visit is no false forget": (
        [*FIRST, *[Shot(AFTER, 1, {"mug": 30}, {0: 30})] * 4], [MOVED],
        lambda i: [entry(1, 1.0 if i < 4 else 3.0), PLATE], None,
        {"standing": 3, "false_forgets": 0, "moves": 1, "moves_done": 1, "gone": ONE, "come": ONE},
    ),
    "a small move is no change for a memory": (
        [*FIRST, *[Shot((NEAR, OTHER), 2, {"mug": 30}, {0: 30})] * 4],
        [TrueChange("mug", "Mug", "moved", 4, OLD, NEAR)], lambda i: BOTH, (), {"moves": 0, "removals": 0},
    ),
    "a claim that is true": (
        [*FIRST, *removal(evidence_at=5)], [REMOVED], lambda i: BOTH if i < 7 else [PLATE],
        None, {"gone": ONE, "come": NONE},
    ),
    "no claim": (
        [*FIRST, *removal(evidence_at=5)], [REMOVED], lambda i: BOTH,
        None, {"gone": ChangeCounts(misses=1), "come": NONE},
    ),
    "a claim that is false": (
        [*FIRST, *removal(evidence_at=5)], [REMOVED], lambda i: BOTH if i < 7 else [MUG],
        None, {"gone": ChangeCounts(false_alarms=1, misses=1)},
    ),
    "an entry that is nearer to a new object is not forgotten": (
        [*FIRST, *[Shot((*BEFORE, NEXT_TO), 2, {"cup": 30})] * 4],
        [TrueChange("cup", "Mug", "added", 4, None, NEXT_TO)], lambda i: [entry(1, 1.25), PLATE],
        None, {"standing": 5, "false_forgets": 0},
    ),
    "doors and windows do not count": (
        FIRST, [], lambda i: [*BOTH, entry(3, 8.0, "Doorway", p=0.9)], (), {"entries": 2, "right_entries": 2},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("shots", "changes", "answer", "spells", "counts"), CASES.values(), ids=CASES)
def test_a_case_with_known_counts(shots, changes, answer, spells, counts) -> None:
    result = judged(shots, changes, answer)
    assert spells is None or result.spells == spells
    assert {name: getattr(result.update, name) for name in counts} == counts
