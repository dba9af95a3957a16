"""Update import paths that earlier versions of evonav wrote into the headers of runs, packs, sweeps and benchmarks.

A header names the parts of a run (task reader, simulator, perception) by import path. When such a part moves to another
module, add its former path to `CURRENT_PATHS`: runs on disk are then still resumed, replayed and verified.
"""

from typing import Any

CURRENT_PATHS = {
    "evonav.evaluation.backend:load_case": "evonav.evaluation.run.components:load_case",
    "evonav.evaluation.backend:embedded_simulator": "evonav.evaluation.run.components:embedded_simulator",
    "evonav.evaluation.backend:lenient_simulator": "evonav.evaluation.run.components:lenient_simulator",
    "evonav.evaluation.backend:ai2thor_simulator": "evonav.evaluation.run.components:ai2thor_simulator",
    "evonav.evaluation.backend:ground_truth": "evonav.perception.ground_truth:GroundTruthPerception",
}
"""Current import path by former one."""


def with_current_paths(value: Any) -> Any:  # noqa: ANN401 - JSON
    """Return a JSON value in which each former import path is replaced by the current one."""
    if isinstance(value, str):
        return CURRENT_PATHS.get(value, value)
    if isinstance(value, list):
        return [with_current_paths(part) for part in value]
    if isinstance(value, dict):
        return {key: with_current_paths(part) for key, part in value.items()}
    return value
