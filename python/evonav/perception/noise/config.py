"""Define how simulated perception errs: every parameter in one place, and the presets (`presets.toml`)."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from evonav.errors import InvalidArgumentError
from evonav.records import Options, Share
from evonav.toml import read_toml

_Positive = Annotated[float, Field(gt=0.0)]
_NotNegative = Annotated[float, Field(ge=0.0)]


class NoiseConfig(Options):
    """Parameters of simulated perception; the defaults err in nothing (preset `perfect`)."""

    of = "noisy"
    miss_rate: Share = 0.0
    """0..1: objects missed although large, near and whole."""
    half_area_fraction: Share = 0.0
    """0..1: share of the image at which half of those are found that would be if large; 0: size is no matter."""
    area_slope: _Positive = 1.5
    """> 0: exponent of `1 / (1 + (half / area)^slope)`."""
    half_distance_m: _NotNegative = 0.0
    """>= 0: mean depth at which half of the near ones are found; 0: distance has no effect.

    It acts in addition to size, which distance makes small."""
    distance_slope: _Positive = 4.0
    """> 0: exponent of `1 / (1 + (distance / half)^slope)`."""
    half_visible: Share = 0.0
    """0..1: visible share of an outline at which half of the whole ones are found; 0: occlusion has no effect.

    An outline is visible where it is cut by nothing nearer, nor by the image's border."""
    visible_slope: _Positive = 2.0
    """> 0: exponent of `1 / (1 + (half / visible)^slope)`."""

    confusion_rate: Share = 0.0
    """0..1: found objects with another label."""
    confusion_similar: Share = 0.85
    """0..1: of those, labels taken from the confusion matrix; the others by how frequent categories are."""
    confusion: str = ""
    """Path of a file like `confusion.toml`; empty: that one."""

    false_positives_per_view: Annotated[float, Field(ge=0.0, le=50.0)] = 0.0
    """0..50: expected detections of nothing, on surfaces in view."""
    false_positive_radius_m: _Positive = 0.15
    """> 0: median of their radius."""

    confidence: Share = 1.0
    """0..1: median confidence of a right detection of a large, near and whole object; 1: all are 1."""
    false_confidence: Share = 1.0
    """0..1: median confidence of a wrong label, or of nothing."""
    confidence_spread: _NotNegative = 1.0
    """>= 0: deviation of confidences' log-odds."""
    confidence_threshold: Share = 0.0
    """0..1: detections below are dropped."""

    mask_margin_px: Annotated[float, Field(ge=-20.0, le=20.0)] = 0.0
    """-20..20: mean margin of masks in an image 300 pixels high; positive: they bleed into what is next to them."""
    mask_margin_spread_px: Annotated[float, Field(ge=0.0, le=20.0)] = 0.0
    """0..20: deviation of the margin."""
    box_jitter: Share = 0.0
    """0..1: deviation of a box's sides as a share of its size; masks are cut to the box."""
    split_rate: Share = 0.0
    """0..1: masks that come in two parts."""
    merge_rate: Share = 0.0
    """0..1: pairs of masks side by side with the same label that come as one."""

    depth_sigma_m: _NotNegative = 0.0
    """>= 0: deviation of depth at no distance."""
    depth_sigma_per_m: _NotNegative = 0.0
    """>= 0: what it grows by with the square of depth."""
    depth_step_per_m: _NotNegative = 0.0
    """>= 0: step of depth values over the square of depth."""
    depth_dropout: Share = 0.0
    """0..1: pixels without a depth."""
    depth_edge_dropout: Share = 0.0
    """0..1: pixels at depth edges without one."""
    depth_range_m: _NotNegative = 0.0
    """>= 0: no depth beyond; 0: no limit."""

    drift_m_per_sqrt_m: _NotNegative = 0.0
    """>= 0: deviation that x and z gain in a metre's travel; it grows with the root of the way."""
    drift_rad_per_sqrt_m: _NotNegative = 0.0
    """>= 0: deviation that yaw gains in a metre's travel."""
    drift_rad_per_sqrt_rad: _NotNegative = 0.0
    """>= 0: deviation that yaw gains in a radian's turn."""
    drift_pull_m: _NotNegative = 0.0
    """>= 0: travel after which all but 1/e of an error is corrected, as by closed loops; 0: nothing corrects it."""

    features: bool = False
    """Give features like CLIP's; without them, memories match by labels."""
    feature_noise: _NotNegative = 1.0
    """>= 0: what is a view's own in a feature, over what it is in CLIP's."""

    persistence: Share = 0.0
    """0..1: correlation of an object's errors in two views; 0: each view errs independently."""
    persistence_scope: Literal["stage", "episode"] = "episode"
    """Time for which it lasts: `stage` or `episode`."""

    @classmethod
    def read(cls, preset: str = "perfect", /, **options: Any) -> "NoiseConfig":  # noqa: ANN401 - JSON
        """Return a preset, with some of its parameters replaced.

        Raises:
            InvalidArgumentError: There is no such preset or parameter, or a value is outside its domain.
        """
        presets = noise_presets()
        if preset not in presets:
            raise InvalidArgumentError(f"noisy: no preset {preset!r}; there are {', '.join(presets)}")
        return cls(**{**presets[preset].model_dump(), **options})


@cache
def noise_presets() -> Mapping[str, NoiseConfig]:
    """Return the presets by name, the best first."""
    presets = read_toml(Path(__file__).with_name("presets.toml"))
    return {name: NoiseConfig(**values) for name, values in presets.items()}
