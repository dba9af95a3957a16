"""Add up the spending of all processes of a run in one SQLite file (WAL), in transactions.

Costs are reserved before a question is asked, so that no number of processes passes the limit. A process that dies
during a question leaves its reservation: the server may have counted the question.
"""

from dataclasses import dataclass
from pathlib import Path

from evonav.decision.vlm.errors import VlmError
from evonav.decision.vlm.shared_file import SharedFile

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
