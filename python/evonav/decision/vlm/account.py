"""What asking a model costs: tokens, money, and a limit that is not passed."""

import json
import math
import threading
from dataclasses import dataclass
from pathlib import Path

from evonav.decision.vlm.errors import VlmError
from evonav.decision.vlm.ledger import Ledger
from evonav.errors import InvalidArgumentError

CHARACTERS_PER_TOKEN = 3.0
"""Fewest that English has on average (about 4): estimates are too high rather than too low."""
LOW_DETAIL_TOKENS, TILE_TOKENS, TILE_PX = 85, 170, 512
"""Of images, as gpt-4o counts them: a base, and so much a tile."""


@dataclass(frozen=True, slots=True)
class Usage:
    """Tokens of one or more questions."""

    input_tokens: int = 0
    output_tokens: int = 0

    def __add__(self, other: "Usage") -> "Usage":
        """Both together."""
        return Usage(self.input_tokens + other.input_tokens, self.output_tokens + other.output_tokens)


@dataclass(frozen=True, slots=True)
class Price:
    """US dollars a million tokens."""

    input_usd: float
    output_usd: float

    def of(self, usage: Usage) -> float:
        """US dollars."""
        return (self.input_usd * usage.input_tokens + self.output_usd * usage.output_tokens) / 1e6


def read_prices(path: Path | str) -> dict[str, Price]:
    """A price table: `{"gpt-4o": {"input_usd": 2.5, "output_usd": 10.0}}`, dollars a million tokens.

    Raises:
        InvalidArgumentError: With file, field and value.
    """
    try:
        table = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InvalidArgumentError(f"{path}: no price table: {error}") from error
    if not isinstance(table, dict):
        raise InvalidArgumentError(f"{path}: expected an object of models, got {type(table).__name__}")
    prices = {}
    for model, entry in table.items():
        values = []
        for field in ("input_usd", "output_usd"):
            value = entry.get(field) if isinstance(entry, dict) else None
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < math.inf:
                raise InvalidArgumentError(f"{path}: {model}.{field}: expected dollars, 0 or more, got {value!r}")
            values.append(float(value))
        prices[model] = Price(*values)
    return prices


def image_tokens(size_px: tuple[int, int], detail: str) -> int:
    """Tokens of an image, as gpt-4o counts them; other models differ.

    Args:
        size_px: Width and height.
        detail: `low`, `high` or `auto`, which is taken for `high`.
    """
    if detail == "low":
        return LOW_DETAIL_TOKENS
    scale = min(1.0, 2048 / max(size_px))
    sides = [side * scale for side in size_px]
    scale = min(1.0, 768 / min(sides))
    tiles = math.prod(math.ceil(side * scale / TILE_PX) for side in sides)
    return LOW_DETAIL_TOKENS + TILE_TOKENS * tiles


class Account:
    """Counts what is spent, and refuses what would pass the limit. Any number of threads may use it."""

    def __init__(
        self,
        price: Price | None = None,
        max_cost_usd: float | None = None,
        *,
        ledger: Ledger | None = None,
        model: str = "",
    ) -> None:
        """An account with nothing spent.

        Args:
            price: Without one, costs are unknown.
            max_cost_usd: Most that may be spent; needs a price.
            ledger: Books everything as well, and holds the limit over all processes that share it.
            model: Whose account this is in the ledger.

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
        """Spent so far by this process; `None` without prices."""
        return None if self.price is None else self.price.of(self.usage)

    def reserve(self, estimate: Usage) -> float:
        """Sets the cost of a question aside before it is asked.

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
        """Books what was used in place of what was set aside; `None` if nothing was."""
        with self._lock:
            self._reserved_usd -= reserved_usd
            if usage is not None:
                self.usage += usage
                self.num_asked += 1
        if self._ledger is not None:
            used = usage or Usage()
            self._ledger.settle(
                self._model,
                reserved_usd,
                input_tokens=used.input_tokens,
                output_tokens=used.output_tokens,
                cost_usd=0.0 if self.price is None else self.price.of(used),
                is_answered=usage is not None,
            )

    def replayed(self) -> None:
        """Counts an answer that was had for nothing."""
        with self._lock:
            self.num_replayed += 1
        if self._ledger is not None:
            self._ledger.replayed(self._model)
