"""Declare what a decision model may cost, and the files in which a run stores answers and costs."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field

from evonav.component import Component
from evonav.decision.vlm.ledger import LEDGER_NAME
from evonav.decision.vlm.shared_file import fold_log
from evonav.errors import InvalidArgumentError
from evonav.evaluation.run.settings_model import SettingError, Settings

if TYPE_CHECKING:
    from evonav.decision.vlm.account import Price


class SpendingSettings(Settings):
    """Prices of models, and how much may be spent."""

    prices: str | None = None
    """JSON file of prices in dollars per million tokens: {"MODEL": {"input_usd": .., "output_usd": ..}}."""
    max_cost: float | None = Field(default=None, gt=0.0)
    """Largest cost in dollars; later questions fail. It needs prices. Default: no limit."""

    def price(self, model: str) -> "Price | None":
        """Return a model's price; `None` without a file of prices.

        Raises:
            InvalidArgumentError: The file cannot be read, or lacks the model.
        """
        from evonav.decision.vlm.account import read_prices

        if self.prices is None:
            return None
        table = read_prices(Path(self.prices))
        if model not in table:
            raise InvalidArgumentError(f"{self.prices}: has no prices of {model!r}")
        return table[model]

    def host_options(self, model: str) -> dict[str, Any]:
        """Return the keyword arguments of a decision model that asks `model`."""
        price = self.price(model)
        if self.max_cost is not None and price is None:
            raise SettingError(
                type(self),
                "max_cost",
                "needs the model's prices: name a file with --prices (in a sweep file: prices = ...)",
            )
        spending: dict[str, Any] = {} if price is None else {"price": [price.input_usd, price.output_usd]}
        return spending if self.max_cost is None else {**spending, "max_cost_usd": self.max_cost}


@dataclass(frozen=True, slots=True)
class DecisionResources:
    """The files in which a run stores answers of its model and logs their costs."""

    run_dir: Path
    """Folder of the run, which holds the answers unless the settings name another file."""
    spending_log: Path
    """File in which all workers log costs, of one run or of several."""
    spending: SpendingSettings
    account: str | None = None
    """Name in the spending log; default: the model's."""
    num_askers: int = 1
    """Number of episodes that may ask at once."""

    @classmethod
    def of_run(cls, run_dir: Path, spending: SpendingSettings, num_askers: int) -> "DecisionResources":
        """Return the resources of a run that has a spending log of its own."""
        return cls(run_dir, run_dir / LEDGER_NAME, spending, num_askers=num_askers)


def fold_logs(decision: Component[Any]) -> None:
    """Make the files of a run's answers and costs whole, after the processes that wrote to them have ended."""
    for key in ("cache", "ledger"):
        if (path := decision.host_options.get(key)) is not None:
            fold_log(Path(path))
