"""What agents answer, as JSON: what is written is read back, and whatever is wrong is named with field and value."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evonav.agents.agent import EntryBelief, Move, NavigateTo, SensorConfig, Stop, ViewSchedule
from evonav.agents.explanation import RoundDiagnostics
from evonav.agents.hosting import wire
from evonav.errors import InvalidArgumentError
from evonav.points import MAX_M
from evonav.world.simulator import Action

COORDINATES = st.floats(-MAX_M, MAX_M)
SIZES = st.floats(0.0, MAX_M)
POINTS = st.tuples(COORDINATES, COORDINATES)
TEXTS = st.text(st.characters(exclude_categories=("Cs",)), max_size=20)
ENTRIES = st.builds(
    EntryBelief,
    st.integers(-(2**63), 2**63 - 1),
    TEXTS,
    st.tuples(COORDINATES, COORDINATES, COORDINATES),
    st.tuples(SIZES, SIZES, SIZES),
    st.integers(0, wire.MAX_COUNT),
)
ANY_NUMBERS = st.floats() | st.integers()
ANY_ENTRIES = st.builds(
    EntryBelief,
    st.integers(),
    st.text(max_size=20) | st.just("x" * 1001),
    st.tuples(ANY_NUMBERS, ANY_NUMBERS, ANY_NUMBERS),
    st.tuples(ANY_NUMBERS, ANY_NUMBERS, ANY_NUMBERS),
    st.integers(),
)
ACTIONS = st.one_of(
    st.builds(Move, st.sampled_from([action for action in Action if action is not Action.STOP])),
    st.builds(NavigateTo, POINTS, st.none() | POINTS),
    st.builds(Stop, TEXTS),
)


@given(ACTIONS)
def test_actions_are_read_as_written(action) -> None:
    assert wire.read_action(wire.write_action(action)) == action


@given(st.lists(ENTRIES, max_size=3), st.dictionaries(TEXTS, st.integers() | TEXTS | st.lists(COORDINATES), max_size=3))
def test_beliefs_are_read_as_written(entries, details) -> None:
    assert wire.ENTRIES.read(wire.ENTRIES.write(entries)) == entries
    told = RoundDiagnostics("object 1", next(iter(entries), None), 3, 4, {"conflicts": 2}, details)
    assert wire.DIAGNOSTICS.read(wire.DIAGNOSTICS.write(told)) == told


@given(ANY_ENTRIES, st.integers(), st.integers())
def test_beliefs_are_refused_or_within_their_limits(entry, num_entries, count) -> None:
    told = RoundDiagnostics("", entry, num_entries, 0, {"conflicts": count})
    try:
        (read,) = wire.ENTRIES.read(wire.ENTRIES.write([entry]))
        found = wire.DIAGNOSTICS.read(wire.DIAGNOSTICS.write(told))
    except InvalidArgumentError:
        return
    assert found.chosen_entry == read
    assert all(abs(value) <= MAX_M for value in read.centre_m)
    assert all(0.0 <= value <= MAX_M for value in read.size_m)
    assert abs(read.entry_id) <= 2**63
    assert 0 <= found.num_entries <= wire.MAX_COUNT
    assert abs(found.counters["conflicts"]) <= wire.MAX_COUNT


def test_numbers_of_numpy_and_halves_of_pairs_are_written() -> None:
    action = NavigateTo(np.array([1.0, 2.0], np.float32), (np.int64(3), 4))
    assert wire.read_action(wire.write_action(action)) == NavigateTo((1.0, 2.0), (3.0, 4.0))
    assert wire.read_action(wire.write_action(Move(Action.STOP))) == Stop()
    assert wire.read_action(wire.write_action(Stop("half: \ud800"))) == Stop("half: ?")
    assert wire.read_action(wire.write_action(Stop("x" * 5000))).reason == "x" * 2000
    details = {"nan": math.nan, "large": 10**30, 3: (1, 2), "half": "\udfff", "lines": "a\nb"}
    text = wire.DIAGNOSTICS.write(RoundDiagnostics(details=details))
    assert b"\n" not in text
    found = wire.DIAGNOSTICS.read(text).details
    assert math.isnan(found.pop("nan"))
    assert found == {"large": 10**30, "3": [1, 2], "half": "?", "lines": "a\nb"}


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ("forward", "'forward' is no action: answer Move"),
        (NavigateTo((math.nan, 0.0)), r"action\.navigate_to\.position_m\.0 = nan: .*finite"),
        (NavigateTo((1.0, 2.0), (math.inf, 0.0)), r"face_m\.0 = inf: .*finite"),
        (NavigateTo((1.0, 2.0, 3.0)), r"action\.navigate_to\.position_m = \[1\.0, 2\.0, 3\.0\]"),
        (NavigateTo("ab"), r"action\.navigate_to\.position_m = 'ab'"),
        (Move("MoveAhead!"), r"action\.move\.action = 'MoveAhead!'"),
        (Stop(object()), "action: not JSON-ready: .*object is no JSON"),
    ],
)
def test_what_is_no_action_is_named(action, message) -> None:
    with pytest.raises(InvalidArgumentError, match=message):
        wire.read_action(wire.write_action(action))


def test_actions_of_another_kind_are_refused() -> None:
    for text in (b'{"kind": "fly"}', b"{}", b"null", b"[1]"):
        with pytest.raises(InvalidArgumentError, match=r"^action"):
            wire.read_action(text)


@pytest.mark.parametrize(
    ("part", "value", "message"),
    [
        (wire.SENSORS, None, "sensors = None"),
        (wire.SENSORS, SensorConfig(first_round=ViewSchedule(2.5, 1.0)), r"sensors\.first_round\.count = 2\.5"),
        (wire.SENSORS, SensorConfig(motion="flight"), r"sensors\.motion = 'flight'"),
        (wire.SENSORS, SensorConfig(needs_rgb=1), r"sensors\.needs_rgb = 1"),
        (wire.DIAGNOSTICS, RoundDiagnostics(num_entries=True), r"diagnostics\.num_entries = True"),
        (wire.DIAGNOSTICS, RoundDiagnostics(counters={"a": 0.5}), r"diagnostics\.counters\.a = 0\.5"),
        (wire.ENTRIES, [EntryBelief(1, "Mug", (0.0, 0.0), (1.0, 1.0, 1.0), 1)], r'missing "entries\.0\.centre_m\.2"'),
        (wire.ENTRIES, [EntryBelief("1", "Mug", (0.0,) * 3, (1.0,) * 3, 1)], r"entries\.0\.entry_id = '1'"),
    ],
)
def test_malformed_parts_are_named(part, value, message) -> None:
    with pytest.raises(InvalidArgumentError, match=message):
        part.read(part.write(value))


def test_large_and_deep_diagnostics_are_refused() -> None:
    with pytest.raises(InvalidArgumentError, match="diagnostics: 1000109 bytes of JSON: must be at most 1000000"):
        wire.DIAGNOSTICS.write(RoundDiagnostics(details={"a": "x" * 999_995}))
    nested: list[object] = []
    for depth in range(1, 2000):
        told = RoundDiagnostics(details={"a": nested})
        if depth < 31:
            wire.DIAGNOSTICS.read(wire.DIAGNOSTICS.write(told))
        nested = [nested]
    for depth in (40, 150, 300, 100_000):
        text = b'{"details": {"a": ' + b"[" * depth + b"]" * depth + b"}}"
        with pytest.raises(InvalidArgumentError, match=r"deeper than 32|recursion limit"):
            wire.DIAGNOSTICS.read(text)
    with pytest.raises(InvalidArgumentError, match=r"not JSON-ready: .*depth"):
        wire.DIAGNOSTICS.write(RoundDiagnostics(details={"a": nested}))


@given(
    st.integers(0),
    st.floats(0, 1e9),
    st.integers(0, 2),
    st.dictionaries(TEXTS, TEXTS.map(lambda text: json.dumps(text).encode())),
)
def test_answers_are_read_as_written(number, cpu_s, slot, parts) -> None:
    head, read = wire.read_answer(wire.write_answer(number, cpu_s, slot, parts), number)
    assert (head.number, head.cpu_s, head.free_slot, read) == (number, cpu_s, slot, parts)


@pytest.mark.parametrize(
    ("message", "error"),
    [
        (b'{"number": 1, "parts": []}', 'missing "cpu_s"'),
        (b'{"number": 1, "cpu_s": "2", "parts": []}', "cpu_s = '2'"),
        (b'{"number": 1, "cpu_s": NaN, "parts": []}', "cpu_s = nan"),
        (b'{"number": 1, "cpu_s": 0.5, "parts": []}', 'missing "free_slot"'),
        (b'{"number": 1, "cpu_s": 0.5, "free_slot": 3, "parts": []}', "free_slot = 3: Input should be less than 3"),
        (b'{"number": 1, "cpu_s": 0.5, "free_slot": -1, "parts": []}', "free_slot = -1: Input should be greater"),
        (b'{"number": 2, "cpu_s": 0.5, "free_slot": 0, "parts": []}', "number = 2: expected 1"),
        (b'{"number": 1, "cpu_s": 0.5, "free_slot": 0, "parts": ["action"]}', r"parts = \('action',\): 0 follow"),
        (b'{"number": 1, "cpu_s": 0.5, "free_slot": 0, "parts": []}\n{}', r"parts = \(\): 1 follow"),
        (b"cos\nsystem\n(S'true'\nt", "Invalid JSON: expected value"),
        (b"", "Invalid JSON"),
    ],
)
def test_what_is_no_answer_is_named(message, error) -> None:
    with pytest.raises(InvalidArgumentError, match=error):
        wire.read_answer(message, 1)


@given(st.lists(st.lists(ENTRIES, max_size=4), max_size=4))
def test_a_memory_is_read_as_written_again_and_again(memories) -> None:
    written, read = wire.Entries(), wire.Entries()
    for memory in (*memories, *memories[::-1]):
        text = written.write(memory)
        assert json.loads(text) == json.loads(wire.ENTRIES.write(memory))
        assert read.read(text) == read.read(wire.ENTRIES.write(memory)) == memory


def test_entries_that_have_not_changed_are_the_same_objects() -> None:
    first, second, third = (EntryBelief(k, "Mug\t", (0.0, k, 0.0), (1.0, 1.0, 1.0), 1) for k in range(3))
    written, read = wire.Entries(), wire.Entries()
    before = read.read(written.write([first, second]))
    after = read.read(written.write([third, second]))
    assert after == [third, second]
    assert after[1] is before[1]


def test_an_entry_that_can_change_is_written_anew() -> None:
    size_m = [1.0, 1.0, 1.0]
    entry, written = EntryBelief(1, "Mug", (0.0, 0.0, 0.0), size_m, 1), wire.Entries()
    assert wire.Entries().read(written.write([entry]))[0].size_m == (1.0, 1.0, 1.0)
    size_m[0] = 2.0
    assert wire.Entries().read(written.write([entry]))[0].size_m == (2.0, 1.0, 1.0)


@pytest.mark.parametrize("text", [b"", b"{}", b"[1]", b"[,\t]", b"null", b'[{"entry_id":1},\t{}'])
def test_a_malformed_memory_is_refused_as_a_whole(text) -> None:
    with pytest.raises(InvalidArgumentError) as whole:
        wire.ENTRIES.read(text)
    with pytest.raises(InvalidArgumentError) as found:
        wire.Entries().read(text)
    assert str(found.value) == str(whole.value)


def test_the_wrong_entry_of_a_memory_is_named() -> None:
    good, bad = (EntryBelief(k, "Mug", (0.0, 0.0, 0.0), (size_m, 1.0, 1.0), 1) for k, size_m in enumerate((1.0, -1.0)))
    entries = wire.Entries()
    with pytest.raises(InvalidArgumentError, match=r"entries\.1 = "):
        entries.read(entries.write([good, bad]))
