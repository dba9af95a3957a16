"""Change inputs at random: bytes, and JSON by its structure. The same generator gives the same changes."""

import copy
import json
import random
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

Json = Any

VALUES: tuple[Json, ...] = (
    None,
    True,
    False,
    0,
    -1,
    1,
    2**31,
    2**63,
    -(2**63) - 1,
    10**400,
    0.0,
    -0.0,
    0.1 + 0.2,
    5e-324,
    1e308,
    -1e308,
    float("nan"),
    float("inf"),
    float("-inf"),
    "",
    "x" * 5000,
    "\u0000",
    "\u202e<script>alert(1)</script>",
    "../../../etc/passwd",
    "nan",
    [],
    {},
    [[]],
    [None] * 300,
    {"": {}},
    {"__proto__": 1},
)
"""Values on which programs fail."""
PIECES = (b"\0", b"\xff", b"\xed\xa0\x80", b"\n", b'"', b"[" * 2000, b"{", b"}", b",", b"1e999", b"NaN", b"PK\5\6")
MAX_BYTES = 1 << 22


def mutated_bytes(data: bytes, draws: random.Random) -> bytes:
    """Change 1 to 4 places: flip, delete, repeat, insert, cut."""
    changed = bytearray(data)
    for _ in range(draws.choice((1, 1, 2, 4))):
        at = draws.randrange(len(changed) + 1)
        length = min(draws.choice((1, 2, 4, 16, 256)), len(changed) - at)
        kind = draws.randrange(6)
        if kind == 0 and at < len(changed):
            changed[at] ^= 1 << draws.randrange(8)
        elif kind == 1:
            changed[at : at + length] = draws.randbytes(length)
        elif kind == 2:
            del changed[at : at + length]
        elif kind == 3 and len(changed) < MAX_BYTES:
            changed[at:at] = changed[at : at + length] * draws.choice((1, 2, 50))
        elif kind == 4:
            changed[at:at] = draws.choice(PIECES)
        elif kind == 5 and draws.random() < 0.2:
            del changed[at:]
    return bytes(changed)


def mutated_json(value: Json, draws: random.Random) -> Json:
    """Change 1 to 3 places of a JSON value: replace, delete, repeat, exchange, rename, nest, move a number a little."""
    with _deep():
        changed = copy.deepcopy(value)
        for _ in range(draws.choice((1, 1, 2, 3))):
            holders = list(_holders(changed))
            if not holders:
                return draws.choice(VALUES)
            _change(draws.choice(holders), holders, draws)
        return changed


@contextmanager
def _deep() -> Iterator[None]:
    """Let the mutator itself handle values nested deeper than Python's default limit, which holds for readers."""
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(20_000)
    try:
        yield
    finally:
        sys.setrecursionlimit(limit)


def _holders(value: Json) -> Any:
    """Yield every list and dictionary with something in it."""
    waiting = [value]
    while waiting:
        one = waiting.pop()
        if isinstance(one, dict | list) and one:
            yield one
            waiting += one.values() if isinstance(one, dict) else one


def _change(holder: Json, holders: list[Json], draws: random.Random) -> None:
    key = draws.choice(list(holder) if isinstance(holder, dict) else range(len(holder)))
    old = holder[key]
    kind = draws.randrange(9)
    if kind <= 2:
        holder[key] = copy.deepcopy(draws.choice(VALUES))
    elif kind == 3:
        del holder[key]
    elif kind == 4:
        other = draws.choice(holders)
        place = draws.choice(list(other) if isinstance(other, dict) else range(len(other)))
        holder[key] = copy.deepcopy(other[place])
    elif kind == 5 and isinstance(holder, list):
        holder.insert(draws.randrange(len(holder) + 1), copy.deepcopy(old))
    elif kind == 6 and isinstance(holder, dict):
        holder[draws.choice(("x", "", key + "x", "id"))] = holder.pop(key)
    elif kind == 7:
        for _ in range(draws.choice((1, 40, 300))):
            old = [old]
        holder[key] = old
    elif isinstance(old, bool):
        holder[key] = not old
    elif isinstance(old, int | float):
        step = draws.choice((1, -1, 1e-6, 0.5, 1000))
        holder[key] = old + (step if abs(old) < 1e300 else 1)
    elif isinstance(old, str):
        holder[key] = mutated_bytes(old.encode(), draws).decode(errors="replace")
    elif isinstance(old, list):
        draws.shuffle(old)


def json_bytes(value: Json) -> bytes:
    """Return a JSON value compactly, also one that is no number."""
    with _deep():
        return json.dumps(value, separators=(",", ":"), ensure_ascii=False).encode("utf-8", "surrogatepass")
