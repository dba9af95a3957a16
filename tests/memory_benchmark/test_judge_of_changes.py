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


def test_too_few_pixels_are_no_evidence() -> None:
    shots = [*FIRST, *[Shot(GONE, 2, {}, {0: 24})] * 4]
    result = judged(shots, [REMOVED], lambda i: BOTH)
    assert [spell.kind for spell in result.spells] == ["unseen"]
    assert result.update.removals == 0


def test_cleared_without_evidence_counts_as_unseen() -> None:
    result = judged([*FIRST, *removal(evidence_at=8)], [REMOVED], lambda i: BOTH if i < 6 else [PLATE])
    assert result.spells == (Spell("unseen", 0, Clocks(2, 1.0, 1.0), is_over=True),)
    assert (result.update.removals, result.update.removals_done) == (1, 1)


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


def test_move_without_a_look_at_the_old_place_is_not_judged() -> None:
    shots = [*FIRST, *[Shot(AFTER, 2, {"mug": 30})] * 4]
    result = judged(shots, [MOVED], lambda i: BOTH)
    assert (result.update.moves, result.update.removals) == (0, 0)
    assert {(spell.kind, spell.is_over) for spell in result.spells} == {("unseen", False), ("appeared", False)}


def test_addition_seen_late() -> None:
    objects = (*BEFORE, CUP)
    shots = [*FIRST, *[Shot(objects, 2)] * 3, *[Shot(objects, 2, {"cup": 25})] * 3, *[Shot(objects, 3)] * 2]
    in_time = judged(shots, [ADDED], lambda i: [*BOTH, entry(9, 7.1)] if i >= 9 else BOTH)
    assert (in_time.update.additions, in_time.update.additions_done) == (1, 1)
    assert in_time.spells == (Spell("appeared", 0, Clocks(2, 1.0, 1.0, 3), is_over=True),)
    too_late = judged(shots, [ADDED], lambda i: [*BOTH, entry(9, 7.1)] if i >= 10 else BOTH)
    assert (too_late.update.additions, too_late.update.additions_done) == (1, 0)
    assert too_late.spells[0].is_over


def test_object_that_perception_missed_was_not_seen() -> None:
    shots = [*FIRST, *[Shot((*BEFORE, CUP), 2, {"cup": 60}, detected=())] * 6]
    result = judged(shots, [ADDED], lambda i: BOTH)
    assert result.spells == ()
    assert (result.update.additions, result.update.seen) == (0, 4)


def test_added_object_that_is_forgotten_later_was_found() -> None:
    shots = [*FIRST, *[Shot((*BEFORE, CUP), 2, {"cup": 25})] * 6]
    result = judged(shots, [ADDED], lambda i: [*BOTH, entry(9, 7.1)] if i in (6, 7) else BOTH)
    assert result.spells == (Spell("appeared", 0, Clocks(2, 1.0, 1.0, 3), is_over=True),)
    assert (result.update.additions_done, result.update.false_forgets) == (0, 1)


def test_false_forget() -> None:
    shots = [*FIRST, *[Shot(BEFORE, 2)] * 4]
    update = judged(shots, [], lambda i: [PLATE] if i == 5 else BOTH).update
    assert (update.standing, update.false_forgets, update.false_forgets_at_end) == (4, 1, 0)
    update = judged(shots, [], lambda i: [PLATE] if i >= 5 else BOTH).update
    assert (update.standing, update.false_forgets, update.false_forgets_at_end) == (4, 1, 1)


def test_forgetting_at_the_start_of_a_visit_is_forgetting() -> None:
    shots = [*FIRST, *[Shot(BEFORE, 2)] * 4]
    update = judged(shots, [], lambda i: [] if i == 4 else BOTH).update
    assert (update.standing, update.false_forgets, update.false_forgets_at_end) == (4, 2, 0)


def test_memory_that_forgets_everything_has_no_recall() -> None:
    update = judged([*FIRST, *removal(evidence_at=5)], [REMOVED], lambda i: []).update
    assert (update.seen, update.seen_remembered, update.standing, update.removals) == (3, 0, 0, 0)
    assert (update.gone, update.come) == (ChangeCounts(), ChangeCounts())


def test_moved_object_is_no_false_forget() -> None:
    shots = [*FIRST, *[Shot(AFTER, 1, {"mug": 30}, {0: 30})] * 4]  # it moves during the visit
    update = judged(shots, [MOVED], lambda i: [entry(1, 1.0 if i < 4 else 3.0), PLATE]).update
    assert (update.standing, update.false_forgets) == (3, 0)
    assert (update.moves, update.moves_done) == (1, 1)
    assert (update.gone, update.come) == (ChangeCounts(hits=1), ChangeCounts(hits=1))


def test_object_put_back_ends_the_spell() -> None:
    back = TrueChange("mug", "Mug", "moved", 8, NEW, OLD)
    shots = [*FIRST, *[Shot(AFTER, 2, {}, {0: 30})] * 4, *[Shot(BEFORE, 3, {"mug": 50})] * 4]
    result = judged(shots, [MOVED, back], lambda i: BOTH)
    assert Spell("evident", 0, Clocks(3, 1.5, 1.5, 4), is_over=False) in result.spells
    assert Spell("appeared", 1, Clocks(0, 0.0, 0.0, 1), is_over=True) in result.spells
    assert result.update.right_entries == 5  # two, then the plate alone, then two


def test_small_move_is_no_change_for_a_memory() -> None:
    near = body("mug", 1.2)
    shots = [*FIRST, *[Shot((near, OTHER), 2, {"mug": 30}, {0: 30})] * 4]
    result = judged(shots, [TrueChange("mug", "Mug", "moved", 4, OLD, near)], lambda i: BOTH)
    assert result.spells == ()
    assert (result.update.moves, result.update.removals) == (0, 0)


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


def test_change_f1_over_two_visits() -> None:
    shots = [*FIRST, *removal(evidence_at=5)]
    told = judged(shots, [REMOVED], lambda i: BOTH if i < 7 else [PLATE]).update
    assert (told.gone, told.come) == (ChangeCounts(hits=1), ChangeCounts())
    silent = judged(shots, [REMOVED], lambda i: BOTH).update
    assert (silent.gone, silent.come) == (ChangeCounts(misses=1), ChangeCounts())
    wrong = judged(shots, [REMOVED], lambda i: BOTH if i < 7 else [MUG]).update
    assert wrong.gone == ChangeCounts(false_alarms=1, misses=1)


def test_entries_asked_for_less_often() -> None:
    shots = [*FIRST, *removal(evidence_at=5)]
    result = judged(shots, [REMOVED], lambda i: [PLATE] if i >= 7 else BOTH, every=3)
    (evident,) = (spell for spell in result.spells if spell.kind == "evident")
    assert (evident.lasted.frames, evident.is_over) == (3, True)  # asked after frames 5 and 8


def test_entry_that_is_nearer_to_another_object_is_not_forgotten() -> None:
    near = body("cup", 1.12)  # it comes next to the mug, and nearer to the mug's entry
    shots = [*FIRST, *[Shot((*BEFORE, near), 2, {"cup": 30})] * 4]
    update = judged(shots, [TrueChange("cup", "Mug", "added", 4, None, near)], lambda i: [entry(1, 1.25), PLATE]).update
    assert (update.standing, update.false_forgets) == (5, 0)


def test_doors_and_windows_do_not_count() -> None:
    update = judged(FIRST, [], lambda i: [entry(1, 1.0), PLATE, entry(3, 8.0, "Doorway", p=0.9)]).update
    assert (update.entries, update.right_entries) == (2, 2)
