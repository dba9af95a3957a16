"""The one function that finds where two JSON values differ."""

import json

from hypothesis import given
from hypothesis import strategies as st

from evonav.json_diff import JsonDifference, json_differences

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 3) | st.text("ab", max_size=2),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text("xy", min_size=1, max_size=2), inner, max_size=3)
    ),
)


def _bare(value):
    """The value without what counts as missing."""
    if isinstance(value, dict):
        return {key: bare for key, item in value.items() if (bare := _bare(item)) is not None} or None
    return [_bare(item) for item in value] if isinstance(value, list) else value


@given(VALUES, VALUES)
def test_values_without_a_difference_are_the_same(left, right):
    assert (list(json_differences(left, right)) == []) == (_bare(left) == _bare(right))
    assert not list(json_differences(left, json.loads(json.dumps(left))))


def test_differences_are_named_by_their_innermost_place():
    left = {"a": {"b": [1, {"c": 2}]}, "gone": 1, "empty": {}, "list": [1]}
    right = {"a": {"b": [1, {"c": 3}]}, "new": {"d": 4}, "list": [1, 2]}
    assert list(json_differences(left, right)) == [
        JsonDifference("a.b[1].c", 2, 3),
        JsonDifference("gone", 1, None),
        JsonDifference("list", [1], [1, 2]),
        JsonDifference("new.d", None, 4),
    ]


def test_values_are_compared_as_asked():
    assert not list(json_differences({"a": [1.0]}, {"a": [1.1]}, is_equal=lambda a, b: abs(a - b) < 0.5))
