"""Find where two JSON values differ."""

import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class JsonDifference:
    """One place where two JSON values differ."""

    path: str
    """The place: keys joined by dots, indices in brackets, such as `trace[2].pose.x_m`."""
    left: Any
    """The value of the left side; `None` where it has none."""
    right: Any
    """The value of the right side; `None` where it has none."""


def json_differences(
    left: Any,  # noqa: ANN401 - JSON
    right: Any,  # noqa: ANN401 - JSON
    *,
    is_equal: Callable[[Any, Any], bool] = operator.eq,
    path: str = "",
) -> Iterator[JsonDifference]:
    """Yield the innermost places where two JSON values differ, in the order of the left value.

    Objects are compared key by key, and arrays of the same length item by item. A missing key, `null` and an empty
    object are the same.

    Args:
        is_equal: Compares two values that are neither both objects nor both arrays of the same length.
        path: The place of the two values, for `JsonDifference.path`.
    """
    if (isinstance(left, Mapping) or left is None) and (isinstance(right, Mapping) or right is None):
        for key in dict.fromkeys([*(left or {}), *(right or {})]):
            inner = f"{path}.{key}" if path else str(key)
            yield from json_differences((left or {}).get(key), (right or {}).get(key), is_equal=is_equal, path=inner)
    elif isinstance(left, list) and isinstance(right, list) and len(left) == len(right):
        for index, (one, other) in enumerate(zip(left, right, strict=True)):
            yield from json_differences(one, other, is_equal=is_equal, path=f"{path}[{index}]")
    elif not is_equal(left, right):
        yield JsonDifference(path, left, right)
