"""Plot perceptions: precision and recall, by distance and size, calibration, confusions, features, memory."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evonav.perception_benchmark.average_precision import RECALLS
from evonav.perception_benchmark.records import NUM_COSINE_BINS
from evonav.perception_benchmark.scores import Scores
from evonav.report.plots.specs import ConfusionPlot, ConfusionRow, CurvePlot, GroupPlot, Line, Plot, Series

MAX_CONFUSED = 12
_GROUPS = (("distance", "distance"), ("size", "size in the image"))
_MEMORY = (("memory_recall", "Objects seen that are remembered"), ("memory_precision", "Entries that are right"))
COSINE_NAMES = {
    "same_object": "same object, another view",
    "same_category": "same category",
    "other": "other categories",
    "text_own": "the object's word",
    "text_other": "other words",
}


def perception_plots(found: Sequence[Scores]) -> list[Plot]:
    """Return the plots of all perceptions, in reading order."""
    curves = [
        Line(one.perception, tuple(zip(RECALLS.tolist(), one.precision_curve, strict=True)), has_dots=False)
        for one in found
        if one.precision_curve
    ]
    title = "Precision and recall at IoU 0.5"
    plots: list[Plot] = [_square_plot(title, curves, "recall", "precision, mean over categories")]
    calibrations = [Line.of(one.perception, one.calibration, scale=1) for one in found if one.calibration]
    calibration = _square_plot("Precision by confidence", calibrations, "confidence", "precision")
    plots.append(replace(calibration, has_diagonal=True))
    for by, name in _GROUPS:
        plots += [_group_plot(found, by, name, measure) for measure in ("recall", "precision")]
    return plots + _memory_plots(found)


def confusion_plots(found: Sequence[Scores]) -> list[ConfusionPlot]:
    """Return a table in shades of each perception that takes objects for others."""
    return [_confusion_plot(one) for one in found if one.confusions]


def feature_plots(found: Sequence[Scores]) -> list[CurvePlot]:
    """Return histograms of cosines of each perception that has features."""
    plots = []
    for one in found:
        tables = {name: np.array(counts, np.float64) for name, counts in one.cosines.items()}
        if not tables:
            continue
        shares = {name: counts / max(1.0, counts.sum()) for name, counts in tables.items()}
        middles = ((np.arange(NUM_COSINE_BINS) + 0.5) / NUM_COSINE_BINS * 2 - 1).tolist()
        used = [x for name in shares for x, share in zip(middles, shares[name].tolist(), strict=True) if share > 0]
        low = max(-1.0, np.floor(10 * min(used)) / 10)
        top = max(float(share.max()) for share in shares.values())
        lines = [
            Line(
                COSINE_NAMES[name],
                tuple((x, y) for x, y in zip(middles, share.tolist(), strict=True) if x >= low),
                has_dots=False,
            )
            for name, share in shares.items()
        ]
        plot = _square_plot(one.perception, lines, "cosine of features", "share of pairs")
        plots.append(replace(plot, x_range=(float(low), 1.0), y_top=top))
    return plots


def _square_plot(title: str, lines: Sequence[Line], x_label: str, y_label: str) -> CurvePlot:
    return CurvePlot(title, tuple(lines), x_label, y_label, x_range=(0.0, 1.0), y_top=1.0, is_square=True)


def _group_plot(found: Sequence[Scores], by: str, name: str, measure: str) -> GroupPlot:
    # Objects are the same for all, detections are not: then no n could stand below.
    groups = tuple(
        f"{group}\nn = {measures[measure].n}" if measure == "recall" else group
        for group, measures in found[0].groups[by].items()
    )
    series = tuple(
        Series.of(one.perception, [measures[measure] for measures in one.groups[by].values()]) for one in found
    )
    return GroupPlot(f"{measure.capitalize()} by {name}", groups, series, "% with 95% intervals by house")


def _memory_plots(found: Sequence[Scores]) -> list[CurvePlot]:
    plots = []
    for name, title in _MEMORY:
        lines = [
            Line.of(one.perception, [(share, measures[name]) for share, measures in one.memory_curve], scale=1)
            for one in found
            if one.memory_curve
        ]
        if lines:
            plots.append(_square_plot(title, lines, "share of the first house's tour", "share"))
    return plots


def _confusion_plot(one: Scores) -> ConfusionPlot:
    by_category: Counter[str] = Counter()
    by_label: Counter[str] = Counter()
    for each in one.confusions:
        by_category[each.category] += each.num
    names = [name for name, _ in by_category.most_common(MAX_CONFUSED)]
    for each in one.confusions:
        if each.category in names:
            by_label[each.label] += each.num
    labels = [label for label, _ in by_label.most_common(MAX_CONFUSED)]
    shares = {(each.category, each.label): each.share.value or 0.0 for each in one.confusions}
    rows = []
    for name in names:
        mine = one.groups["category"][name]
        right, missed = mine["recall"].value or 0.0, 1.0 - (mine["located"].value or 0.0)
        others = (shares.get((name, label), 0.0) for label in labels)
        rows.append(ConfusionRow(name, mine["recall"].n, (right, missed, *others)))
    title = f"{one.perception}: labels of objects, % of each category (n)"
    return ConfusionPlot(title, ("right", "nothing", *labels), tuple(rows))
