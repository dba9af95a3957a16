"""Describe how simulated perception errs: its parameters and presets, confused labels, and poses that drift."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from evonav.errors import InvalidArgumentError
from evonav.records import Options, Record, Share, sentence_of
from evonav.toml import read_toml
from evonav.world.pose import Pose

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
    presets = read_toml(Path(__file__).with_name("noise_presets.toml"))
    return {name: NoiseConfig(**values) for name, values in presets.items()}


@dataclass(frozen=True, slots=True)
class Confusion:
    """A confusion matrix, row by row, and how frequent categories are."""

    categories: tuple[str, ...]
    frequencies: NDArray[np.float64]
    """`(C,)`, adding up to 1."""
    similar: Mapping[str, tuple[tuple[str, ...], NDArray[np.float64]]]
    """Labels that a category is mistaken for, with their shares, by category."""
    group_of: Mapping[str, int]
    """Number of the first group that a category is in, of those that are in any."""

    def another(self, category: str, is_similar: bool, share: float) -> str:
        """Draw the label that a category is mistaken for.

        Args:
            is_similar: Whether from its row of the matrix, if that has entries; otherwise by frequency.
            share: Uniform in 0..1: decides which.
        """
        labels, shares = self.similar.get(category, ((), np.zeros(0)))
        if not is_similar or not labels:
            labels = self.categories
            shares = np.where(np.array(labels) == category, 0.0, self.frequencies)
        return _pick(labels, shares, share) if shares.sum() > 0.0 else category

    def frequent(self, share: float) -> str:
        """Draw a category by frequency; `share`, uniform in 0..1, decides which."""
        return _pick(self.categories, self.frequencies, share)


def _pick(labels: Sequence[str], weights: NDArray[np.float64], share: float) -> str:
    ends = np.cumsum(weights)
    return labels[min(int(np.searchsorted(ends, share * ends[-1], side="right")), len(labels) - 1)]


_Weights = dict[str, Annotated[float, Field(ge=0.0)]]


class _ConfusionFile(Record):
    """Frequencies of categories, groups of similar ones, and how often one is mistaken for another."""

    frequencies: Annotated[_Weights, Field(min_length=1)]
    groups: dict[str, list[str]] = Field(default_factory=dict)
    pairs: dict[str, _Weights] = Field(default_factory=dict)


@cache
def read_confusion(path: str = "") -> Confusion:
    """Read a file of frequencies, groups and pairs (`confusion.toml` shows the form).

    Raises:
        InvalidArgumentError: It cannot be read, or a part of it is malformed.
    """
    name = path or "confusion.toml"
    try:
        file = _ConfusionFile(**read_toml(Path(path) if path else Path(__file__).with_name(name)))
    except ValidationError as error:
        raise InvalidArgumentError(f"{name}: {sentence_of(error)}") from None
    rows: dict[str, dict[str, float]] = {}
    for group in file.groups.values():
        for label in group:
            row = rows.setdefault(label, {})
            for other in group:
                if other != label:
                    row[other] = row.get(other, 0.0) + 1.0
    for label, others in file.pairs.items():
        rows[label] = {**rows.get(label, {}), **others}
    shares = np.array(list(file.frequencies.values()))
    return Confusion(
        categories=tuple(file.frequencies),
        frequencies=shares / shares.sum(),
        similar={
            label: (tuple(row), np.array(list(row.values())) / sum(row.values()))
            for label, row in rows.items()
            if sum(row.values()) > 0.0
        },
        group_of={label: n for n, group in reversed(list(enumerate(file.groups.values()))) for label in group},
    )


@dataclass(slots=True)
class PoseDrift:
    """The error of a pose estimate over an episode: odometry, corrected little by little."""

    config: NoiseConfig
    error_m: tuple[float, float] = (0.0, 0.0)
    """Error of x and z."""
    error_rad: float = 0.0
    """Error of yaw."""
    _last: Pose | None = field(default=None, init=False)

    @property
    def is_off(self) -> bool:
        """Whether there is never any error."""
        config = self.config
        return not (config.drift_m_per_sqrt_m or config.drift_rad_per_sqrt_m or config.drift_rad_per_sqrt_rad)

    def move(self, pose: Pose, normals: NDArray[np.float64]) -> None:
        """Add the drift of the way to the agent's new pose.

        Args:
            normals: `(3,)` standard normals.
        """
        last, self._last = self._last, pose
        if last is None or self.is_off:
            return
        config = self.config
        way_m = math.dist((last.x_m, last.z_m), (pose.x_m, pose.z_m))
        turn_rad = abs(math.remainder(pose.yaw_rad - last.yaw_rad, math.tau))
        decay = math.exp(-way_m / config.drift_pull_m) if config.drift_pull_m > 0.0 else 1.0
        step_m = config.drift_m_per_sqrt_m * math.sqrt(way_m)
        step_rad = math.sqrt(config.drift_rad_per_sqrt_m**2 * way_m + config.drift_rad_per_sqrt_rad**2 * turn_rad)
        x, z, yaw = normals.tolist()
        self.error_m = (decay * self.error_m[0] + step_m * x, decay * self.error_m[1] + step_m * z)
        self.error_rad = decay * self.error_rad + step_rad * yaw

    def believed(self, pose: Pose) -> Pose:
        """Return a true pose as it is believed."""
        if self.is_off:
            return pose
        x_m, z_m = self.error_m
        return replace(pose, x_m=pose.x_m + x_m, z_m=pose.z_m + z_m, yaw_rad=pose.yaw_rad + self.error_rad)
