"""Estimate what the cells of a sweep would ask a model and what it would cost."""

from dataclasses import dataclass

from evonav.decision.vlm.ledger import Usage
from evonav.evaluation.run.cost_estimate import estimate_run
from evonav.sweeps.file import SweepFile
from evonav.sweeps.run import CellRun


@dataclass(frozen=True, slots=True)
class CellEstimate:
    """The estimated cost of all agents of a cell, see `evonav.evaluation.run.cost_estimate`."""

    num_requests: float
    input_tokens: float
    output_tokens: float
    dollars: float | None
    """`None` without prices."""


def cell_estimate(sweep: SweepFile, run: CellRun) -> CellEstimate:
    """Run a few tasks of a cell with the text matcher and count what its model would be asked.

    Args:
        sweep: The file.
        run: A cell with a model as decision model.

    Raises:
        InvalidArgumentError: An agent is unknown, or the prices lack the model.
        TaskError: A task is malformed.
    """
    config = run.request.config
    options = dict(config.backend.decision.options)
    price = sweep.price(options["model"])
    found = estimate_run(run.cell.agents, run.request.tasks, config, options, num_workers=sweep.num_workers)
    tokens_in = sum(estimate.input_tokens for estimate in found)
    tokens_out = sum(estimate.output_tokens for estimate in found)
    return CellEstimate(
        num_requests=sum(estimate.num_requests for estimate in found),
        input_tokens=tokens_in,
        output_tokens=tokens_out,
        dollars=None if price is None else price.of(Usage(int(tokens_in), int(tokens_out))),
    )
