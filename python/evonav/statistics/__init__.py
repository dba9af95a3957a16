"""Intervals, differences and verdicts, all by house (docs/statistics.md)."""

from evonav.statistics.bootstrap import NUM_RESAMPLES, ClusterBootstrap, Estimate, effective_size, weighted_quantiles
from evonav.statistics.counts import ChiSquare, chi_square, mcnemar
from evonav.statistics.interval import (
    Z_95,
    Interval,
    newcombe,
    percentile_interval,
    student_quantile,
    widened_tail,
    wilson,
)
from evonav.statistics.paired import (
    DETECTABLE_Z,
    LEVEL,
    MIN_CLUSTERS,
    BeforeAfter,
    PairedEffect,
    Verdict,
    holm,
    paired_effect,
    paired_effects,
    power,
    sign_flip,
    with_holm,
)

__all__ = [
    "DETECTABLE_Z",
    "LEVEL",
    "MIN_CLUSTERS",
    "NUM_RESAMPLES",
    "Z_95",
    "BeforeAfter",
    "ChiSquare",
    "ClusterBootstrap",
    "Estimate",
    "Interval",
    "PairedEffect",
    "Verdict",
    "chi_square",
    "effective_size",
    "holm",
    "mcnemar",
    "newcombe",
    "paired_effect",
    "paired_effects",
    "percentile_interval",
    "power",
    "sign_flip",
    "student_quantile",
    "weighted_quantiles",
    "widened_tail",
    "wilson",
    "with_holm",
]
