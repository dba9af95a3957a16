"""Define how simulated perception errs: every parameter in one place, and the presets (`presets.toml`)."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

from evonav.errors import InvalidArgumentError
from evonav.toml import read_toml

Scope = Literal["stage", "episode"]

_SHARES = {
    *("miss_rate", "half_area_fraction", "half_visible", "confusion_rate", "confusion_similar", "confidence"),
    *("false_confidence", "confidence_threshold", "split_rate", "merge_rate", "depth_dropout", "depth_edge_dropout"),
    "persistence",
}
_POSITIVE = {"area_slope", "distance_slope", "visible_slope", "false_positive_radius_m"}
_AT_MOST = {"false_positives_per_view": 50.0, "mask_margin_spread_px": 20.0, "box_jitter": 1.0}
_MARGIN_PX = 20.0


@dataclass(frozen=True, slots=True)
class NoiseConfig:
    """Parameters of simulated perception; the defaults err in nothing (preset `perfect`)."""

    miss_rate: float = 0.0
    """0..1: objects missed although large, near and whole."""
    half_area_fraction: float = 0.0
    """0..1: share of the image at which half of those are found that would be if large; 0: size is no matter."""
    area_slope: float = 1.5
    """> 0: exponent of `1 / (1 + (half / area)^slope)`."""
    half_distance_m: float = 0.0
    """>= 0: mean depth at which half of the near ones are found; 0: distance has no effect.

    It acts in addition to size, which distance makes small."""
    distance_slope: float = 4.0
    """> 0: exponent of `1 / (1 + (distance / half)^slope)`."""
    half_visible: float = 0.0
    """0..1: visible share of an outline at which half of the whole ones are found; 0: occlusion has no effect.

    An outline is visible where it is cut by nothing nearer, nor by the image's border."""
    visible_slope: float = 2.0
    """> 0: exponent of `1 / (1 + (half / visible)^slope)`."""

    confusion_rate: float = 0.0
    """0..1: found objects with another label."""
    confusion_similar: float = 0.85
    """0..1: of those, labels taken from the confusion matrix; the others by how frequent categories are."""
    confusion: str = ""
    """Path of a file like `confusion.toml`; empty: that one."""

    false_positives_per_view: float = 0.0
    """0..50: expected detections of nothing, on surfaces in view."""
    false_positive_radius_m: float = 0.15
    """> 0: median of their radius."""

    confidence: float = 1.0
    """0..1: median confidence of a right detection of a large, near and whole object; 1: all are 1."""
    false_confidence: float = 1.0
    """0..1: median confidence of a wrong label, or of nothing."""
    confidence_spread: float = 1.0
    """>= 0: deviation of confidences' log-odds."""
    confidence_threshold: float = 0.0
    """0..1: detections below are dropped."""

    mask_margin_px: float = 0.0
    """-20..20: mean margin of masks in an image 300 pixels high; positive: they bleed into what is next to them."""
    mask_margin_spread_px: float = 0.0
    """0..20: deviation of the margin."""
    box_jitter: float = 0.0
    """0..1: deviation of a box's sides as a share of its size; masks are cut to the box."""
    split_rate: float = 0.0
    """0..1: masks that come in two parts."""
    merge_rate: float = 0.0
    """0..1: pairs of masks side by side with the same label that come as one."""

    depth_sigma_m: float = 0.0
    """>= 0: deviation of depth at no distance."""
    depth_sigma_per_m: float = 0.0
    """>= 0: what it grows by with the square of depth."""
    depth_step_per_m: float = 0.0
    """>= 0: step of depth values over the square of depth."""
    depth_dropout: float = 0.0
    """0..1: pixels without a depth."""
    depth_edge_dropout: float = 0.0
    """0..1: pixels at depth edges without one."""
    depth_range_m: float = 0.0
    """>= 0: no depth beyond; 0: no limit."""

    drift_m_per_sqrt_m: float = 0.0
    """>= 0: deviation that x and z gain in a metre's travel; it grows with the root of the way."""
    drift_rad_per_sqrt_m: float = 0.0
    """>= 0: deviation that yaw gains in a metre's travel."""
    drift_rad_per_sqrt_rad: float = 0.0
    """>= 0: deviation that yaw gains in a radian's turn."""
    drift_pull_m: float = 0.0
    """>= 0: travel after which all but 1/e of an error is corrected, as by closed loops; 0: nothing corrects it."""

    features: bool = False
    """Give features like CLIP's; without them, memories match by labels."""
    feature_noise: float = 1.0
    """>= 0: what is a view's own in a feature, over what it is in CLIP's."""

    persistence: float = 0.0
    """0..1: correlation of an object's errors in two views; 0: each view errs independently."""
    persistence_scope: Scope = "episode"
    """Time for which it lasts: `stage` or `episode`."""

    def __post_init__(self) -> None:
        """Check the parameters.

        Raises:
            InvalidArgumentError: One is outside its domain.
        """
        for field in fields(self):
            _check(field.name, getattr(self, field.name))

    @classmethod
    def read(cls, preset: str = "perfect", /, **options: Any) -> "NoiseConfig":  # noqa: ANN401 - JSON
        """Return a preset, with some of its parameters replaced.

        Raises:
            InvalidArgumentError: There is no such preset or parameter, or a value is outside its domain.
        """
        presets = noise_presets()
        if preset not in presets:
            raise InvalidArgumentError(f"noisy: no preset {preset!r}; there are {', '.join(presets)}")
        known = [field.name for field in fields(cls)]
        for name in options:
            if name not in known:
                near = get_close_matches(name, known, 1)
                hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
                raise InvalidArgumentError(f"noisy: no parameter {name!r}; {hint}")
        return cls(**{**asdict(presets[preset]), **options})


@cache
def noise_presets() -> Mapping[str, NoiseConfig]:
    """Return the presets by name, the best first."""
    presets = read_toml(Path(__file__).with_name("presets.toml"))
    return {name: NoiseConfig(**values) for name, values in presets.items()}


def _check(name: str, value: Any) -> None:  # noqa: ANN401 - as given
    expected = ""
    if name == "confusion":
        expected = "" if isinstance(value, str) else "a path"
    elif name == "persistence_scope":
        expected = "" if value in get_args(Scope) else "stage or episode"
    elif name == "features":
        expected = "" if isinstance(value, bool) else "true or false"
    elif isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        expected = "a finite number"
    elif name in _SHARES:
        expected = "" if 0.0 <= value <= 1.0 else "0 to 1"
    elif name in _POSITIVE:
        expected = "" if value > 0.0 else "more than 0"
    elif name == "mask_margin_px":
        expected = "" if abs(value) <= _MARGIN_PX else f"-{_MARGIN_PX:g} to {_MARGIN_PX:g}"
    else:
        most = _AT_MOST.get(name, math.inf)
        expected = "" if 0.0 <= value <= most else "0 or more" + (f", at most {most:g}" if most < math.inf else "")
    if expected:
        raise InvalidArgumentError(f"noisy: {name} = {value!r}: expected {expected}")
