"""Account for what asking a model costs: tokens, money, and a limit.

A ledger adds up the spending of all processes of a run in one SQLite file (WAL), in transactions. Costs are reserved
before a question is asked, so that no number of processes passes the limit. A process that dies during a question
leaves its reservation: the server may have counted the question.
"""

import math
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError, with_config

from evonav.decision.vlm.errors import VlmError
from evonav.decision.vlm.shared_file import SharedFile
from evonav.errors import InvalidArgumentError
from evonav.records import sentence_of

CHARACTERS_PER_TOKEN = 3.0
"""Smallest average number of characters a token in English (about 4): estimates are rather too high."""
LOW_DETAIL_TOKENS, TILE_TOKENS, TILE_PX = 85, 170, 512
"""Tokens of images, as gpt-4o counts them: a base, and a number for each tile."""
LEDGER_NAME = "spending.sqlite"
"""Name of the file in a run's folder."""

_SCHEMA = """
CREATE TABLE IF NOT EXISTS spending (
    model TEXT PRIMARY KEY,
    num_asked INTEGER NOT NULL, num_replayed INTEGER NOT NULL, num_without_answer INTEGER NOT NULL,
    input_tokens INTEGER NOT NULL, output_tokens INTEGER NOT NULL, cost_usd REAL NOT NULL, set_aside_usd REAL NOT NULL
) STRICT;
"""


@dataclass(frozen=True, slots=True)
class Usage:
    """Tokens of one or more questions."""

    input_tokens: int = 0
    output_tokens: int = 0

    def __add__(self, other: "Usage") -> "Usage":
        """Return the sum of both."""
        return Usage(self.input_tokens + other.input_tokens, self.output_tokens + other.output_tokens)


@with_config(ConfigDict(strict=True, allow_inf_nan=False))
@dataclass(frozen=True, slots=True)
class Price:
    """A model's price in US dollars a million tokens."""

    input_usd: Annotated[float, Field(ge=0.0)]
    output_usd: Annotated[float, Field(ge=0.0)]

    def of(self, usage: Usage) -> float:
        """Return the cost in US dollars."""
        return (self.input_usd * usage.input_tokens + self.output_usd * usage.output_tokens) / 1e6


def read_prices(path: Path | str) -> dict[str, Price]:
    """Read a price table: `{"gpt-4o": {"input_usd": 2.5, "output_usd": 10.0}}`, dollars a million tokens.

    Raises:
        InvalidArgumentError: The table is invalid; the message has file, field and value.
    """
    try:
        return TypeAdapter(dict[str, Price]).validate_json(Path(path).read_bytes())
    except OSError as error:
        raise InvalidArgumentError(f"{path}: no price table: {error}") from error
    except ValidationError as error:
        raise InvalidArgumentError(f"{path}: no price table: {sentence_of(error)}") from error


def image_tokens(size_px: tuple[int, int], detail: str) -> int:
    """Return the tokens of an image, as gpt-4o counts them; other models differ.

    Args:
        detail: `low`, `high` or `auto`, which is taken for `high`.
    """
    if detail == "low":
        return LOW_DETAIL_TOKENS
    scale = min(1.0, 2048 / max(size_px))
    edges_px = [edge_px * scale for edge_px in size_px]
    scale = min(1.0, 768 / min(edges_px))
    tiles = math.prod(math.ceil(edge_px * scale / TILE_PX) for edge_px in edges_px)
    return LOW_DETAIL_TOKENS + TILE_TOKENS * tiles


@dataclass(frozen=True, slots=True)
class Spending:
    """The spending on one model."""

    model: str
    num_asked: int
    """Number of questions put to a server."""
    num_replayed: int
    """Number of questions answered from the cache."""
    num_without_answer: int
    """Number of questions put to a server that had no counted answer."""
    input_tokens: int
    output_tokens: int
    cost_usd: float
    """Cost by the given prices; 0 without prices."""
    set_aside_usd: float
    """Costs reserved by open questions, or by processes that died during one."""


class Ledger(SharedFile):
    """A ledger file; any number of threads and processes may use it."""

    def __init__(self, path: Path | str) -> None:
        """Open or create the file; `StoreError` if that fails."""
        super().__init__(path, _SCHEMA, "spending")

    def reserve(self, model: str, cost_usd: float, max_cost_usd: float | None) -> None:
        """Reserve the cost of a question.

        Raises:
            VlmError: Together with all spent and reserved costs it might pass the limit.
            StoreError: The file cannot be written.
        """
        with self._writing():
            query = "SELECT coalesce(sum(cost_usd + set_aside_usd), 0) FROM spending"
            spent_usd = float(self._db.execute(query).fetchone()[0])
            if max_cost_usd is not None and spent_usd + cost_usd > max_cost_usd:
                message = f"${spent_usd:.4f} of ${max_cost_usd:g} spent, the next may cost ${cost_usd:.4f}"
                raise VlmError("over_budget", message)
            self._add(model, set_aside_usd=cost_usd)

    def settle(self, model: str, reserved_usd: float, usage: Usage | None, cost_usd: float = 0.0) -> None:
        """Replace a reserved cost by what was used, `None` without a counted answer; `StoreError` if that fails."""
        used = usage or Usage()
        with self._writing():
            self._add(
                model,
                num_asked=1,
                num_without_answer=int(usage is None),
                input_tokens=used.input_tokens,
                output_tokens=used.output_tokens,
                cost_usd=cost_usd,
                set_aside_usd=-reserved_usd,
            )

    def replayed(self, model: str) -> None:
        """Count an answer that came from the cache."""
        with self._writing():
            self._add(model, num_replayed=1)

    def spending(self) -> list[Spending]:
        """Return the spending by model."""
        with self._reading():
            return [Spending(*row) for row in self._db.execute("SELECT * FROM spending ORDER BY model")]

    def _add(self, model: str, **amounts: float) -> None:
        self._db.execute("INSERT OR IGNORE INTO spending VALUES (?, 0, 0, 0, 0, 0, 0, 0)", (model,))
        changes = ", ".join(f"{column} = {column} + ?" for column in amounts)  # columns are ours
        self._db.execute(f"UPDATE spending SET {changes} WHERE model = ?", (*amounts.values(), model))  # noqa: S608


class Account:
    """Counts spending, and refuses questions that might pass the limit. Any number of threads may use it."""

    def __init__(
        self,
        price: Price | None = None,
        max_cost_usd: float | None = None,
        *,
        ledger: Ledger | None = None,
        model: str = "",
    ) -> None:
        """Create an account without spending.

        Args:
            price: The model's price; without one, costs are unknown.
            max_cost_usd: Largest total cost; needs a price.
            ledger: Ledger that stores everything as well, and applies the limit to all processes that share it.
            model: The account's name in the ledger.

        Raises:
            InvalidArgumentError: The limit is not finite and positive, or there is no price to hold it by.
        """
        if max_cost_usd is not None and not (math.isfinite(max_cost_usd) and max_cost_usd > 0):
            raise InvalidArgumentError(f"max_cost_usd: expected dollars, more than 0, got {max_cost_usd!r}")
        if max_cost_usd is not None and price is None:
            raise InvalidArgumentError("max_cost_usd: a limit needs the model's prices")
        self.price = price
        self.max_cost_usd = max_cost_usd
        self.usage = Usage()
        self.num_asked = 0
        self.num_replayed = 0
        self._ledger = ledger
        self._model = model
        self._reserved_usd = 0.0
        self._lock = threading.Lock()

    @property
    def cost_usd(self) -> float | None:
        """Cost of this process so far; `None` without a price."""
        return None if self.price is None else self.price.of(self.usage)

    def reserve(self, estimate: Usage) -> float:
        """Reserve the cost of a question before it is asked.

        Returns:
            What `settle` has to be given.

        Raises:
            VlmError: It might pass the limit.
            StoreError: The ledger cannot be written.
        """
        cost_usd = 0.0 if self.price is None else self.price.of(estimate)
        if self._ledger is not None:
            self._ledger.reserve(self._model, cost_usd, self.max_cost_usd)
        with self._lock:
            spent_usd = (self.cost_usd or 0.0) + self._reserved_usd
            if self._ledger is None and self.max_cost_usd is not None and spent_usd + cost_usd > self.max_cost_usd:
                message = f"${spent_usd:.4f} of ${self.max_cost_usd:g} spent, the next may cost ${cost_usd:.4f}"
                raise VlmError("over_budget", message)
            self._reserved_usd += cost_usd
        return cost_usd

    def settle(self, reserved_usd: float, usage: Usage | None) -> None:
        """Replace a reserved cost by what was used; `None` if nothing was."""
        with self._lock:
            self._reserved_usd -= reserved_usd
            if usage is not None:
                self.usage += usage
                self.num_asked += 1
        if self._ledger is not None:
            cost_usd = 0.0 if self.price is None or usage is None else self.price.of(usage)
            self._ledger.settle(self._model, reserved_usd, usage, cost_usd)

    def costs(self) -> dict[str, float]:
        """Return the tokens so far, and the money if prices are known."""
        costs: dict[str, float] = {
            "num_replayed": self.num_replayed,
            "input_tokens": self.usage.input_tokens,
            "output_tokens": self.usage.output_tokens,
        }
        return costs if self.cost_usd is None else {**costs, "cost_usd": self.cost_usd}

    def replayed(self) -> None:
        """Count an answer that came from the cache."""
        with self._lock:
            self.num_replayed += 1
        if self._ledger is not None:
            self._ledger.replayed(self._model)
