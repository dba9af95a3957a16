"""Read under which perception, decision model and simulator a packed run was made."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from evonav.errors import InvalidArgumentError
from evonav.evaluation.run.components import USUAL_CAMERA, Backend
from evonav.evaluation.run.settings import RULES
from evonav.perception.shorthand import short_name_of
from evonav.submission.file import Submission

_SIMULATOR = f"{Backend.__module__}:embedded_simulator"

CAMERA_LIMITS = {"width_px": (1, 2048), "height_px": (1, 2048), "hfov_deg": (1, 179)}
"""Least and largest options of a packed run's camera: images that any machine can hold."""


@dataclass(frozen=True, slots=True)
class PackedSetup:
    """The setup of a packed run, as its configuration claims it."""

    perception: str
    """Perception, as `--perception` names it."""
    decision: str
    """Kind of the decision model: text, looks, vlm or custom; with the rates of its mistakes, and what agents go by."""
    model: str
    """The decision model's name, if it has one."""
    simulator: str
    """Simulator and camera, unless they are the usual ones."""
    isolation: str
    """The agents' `--isolation`; several if the run was continued with another."""


def camera_of(backend: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of a packed run's camera that are not the usual ones.

    Raises:
        InvalidArgumentError: An option is no number, or outside of `CAMERA_LIMITS`.
    """
    options = _mapping(backend.get("simulator_options"))
    camera = {key: options[key] for key in USUAL_CAMERA if key in options}
    for key, value in camera.items():
        least, most = CAMERA_LIMITS[key]
        if type(value) not in (int, type(USUAL_CAMERA[key])) or not least <= value <= most:
            raise InvalidArgumentError(f"{key} = {str(value)[:100]}: must be a number of {least} to {most}")
    return camera


def packed_setup(header: Submission) -> PackedSetup:
    """Return the setup of a packed run."""
    backend = header.config.get("backend")
    parts: dict[str, Any] = backend if isinstance(backend, dict) else {}
    decision, perception = (_mapping(parts.get(f"{name}_options")) for name in ("decision", "perception"))
    made = str(parts.get("decision", "")).rpartition(":")[2]
    kind = next((name for name, function in RULES.items() if function == made), made)
    rates = [f"{name}={value}" for name, value in _mapping(decision.get("noise")).items()]
    rates += [f"{name}={decision[name]}" for name in ("eagerness", "mistakes", "goal_input") if decision.get(name)]
    simulator = str(parts.get("simulator", ""))
    camera = [f"{key}={value}" for key, value in camera_of(parts).items()]
    return PackedSetup(
        perception=short_name_of(str(parts.get("perception", "")), perception),
        decision=",".join([kind, *rates]),
        model=str(decision.get("model", decision.get("path", ""))),
        simulator=",".join([simulator, *camera] if camera or simulator != _SIMULATOR else []),
        isolation=str(header.config.get("isolation") or ""),
    )


def _mapping(value: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
    return value if isinstance(value, dict) else {}
