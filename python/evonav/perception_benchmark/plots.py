"""Plots of perceptions: precision and recall, by distance and size, calibration, confusions, features, memory."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from evonav.perception_benchmark.average_precision import RECALLS
from evonav.perception_benchmark.charts import Axes, ConfusionRow, Curve, confusion_chart, square_chart
from evonav.perception_benchmark.estimates import Estimate
from evonav.perception_benchmark.records import NUM_COSINE_BINS
from evonav.perception_benchmark.scores import Scores
from evonav.report.plots import Dots, GroupPlot, plot_svg
from evonav.significance import Interval

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


def perception_figures(found: Sequence[Scores]) -> list[str]:
    """SVG elements for a page that has `PLOT_CSS`, in reading order."""
    curves = [
        Curve(one.word, list(zip(RECALLS.tolist(), one.precision_curve, strict=True)))
        for one in found
        if one.precision_curve
    ]
    heading = "Precision and recall at IoU 0.5"
    drawn = [square_chart(Axes(heading, "recall", "precision, mean over categories"), curves)]
    reliable = [
        Curve(
            one.word,
            [(confidence, each.value or 0.0) for confidence, each in one.calibration],
            [each.interval for _, each in one.calibration],
            has_dots=True,
        )
        for one in found
        if one.calibration
    ]
    axes = Axes("Is confidence what it says?", "confidence", "precision", has_diagonal=True)
    drawn.append(square_chart(axes, reliable))
    for by, words in _GROUPS:
        drawn += [
            plot_svg(_group_plot(found, by, words, measure), is_inline=True) for measure in ("recall", "precision")
        ]
    return drawn + _memory_figures(found)


def confusion_figures(found: Sequence[Scores]) -> list[str]:
    """A table in shades of each perception that takes things for others."""
    return [_confusion_figure(one) for one in found if one.confusions]


def feature_figures(found: Sequence[Scores]) -> list[str]:
    """Histograms of cosines of each perception that has features."""
    drawn = []
    for one in found:
        tables = {name: np.array(counts, np.float64) for name, counts in one.cosines.items()}
        if not tables:
            continue
        shares = {name: counts / max(1.0, counts.sum()) for name, counts in tables.items()}
        middles = ((np.arange(NUM_COSINE_BINS) + 0.5) / NUM_COSINE_BINS * 2 - 1).tolist()
        used = [x for name in shares for x, share in zip(middles, shares[name].tolist(), strict=True) if share > 0]
        low = max(-1.0, np.floor(10 * min(used)) / 10)
        top = max(float(share.max()) for share in shares.values())
        curves = [
            Curve(
                COSINE_NAMES[name],
                [(x, y) for x, y in zip(middles, share.tolist(), strict=True) if x >= low],
            )
            for name, share in shares.items()
        ]
        axes = Axes(one.word, "cosine of features", "share of pairs", (float(low), 1.0), top)
        drawn.append(square_chart(axes, curves))
    return drawn


def _group_plot(found: Sequence[Scores], by: str, words: str, measure: str) -> GroupPlot:
    first = found[0].groups[by]
    # Objects are the same for all, detections are not: then no n could stand below.
    groups = tuple(
        f"{group.name}\nn = {group.measures[measure].n}" if measure == "recall" else group.name for group in first
    )
    series = tuple(
        Dots(
            one.word,
            tuple(_percent(group.measures[measure]) for group in one.groups[by]),
            tuple(_interval(group.measures[measure]) for group in one.groups[by]),
        )
        for one in found
    )
    return GroupPlot(f"{measure.capitalize()} by {words}", groups, series, "% with 95% intervals by house")


def _memory_figures(found: Sequence[Scores]) -> list[str]:
    drawn = []
    for name, heading in _MEMORY:
        curves = [
            Curve(
                one.word,
                [(share, measures[name].value or 0.0) for share, measures in one.memory_curve],
                [measures[name].interval for _, measures in one.memory_curve],
                has_dots=True,
            )
            for one in found
            if one.memory_curve
        ]
        if curves:
            drawn.append(square_chart(Axes(heading, "share of the first house's tour", ""), curves))
    return drawn


def _confusion_figure(one: Scores) -> str:
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
    measures = {group.name: group.measures for group in one.groups["category"]}
    rows = []
    for name in names:
        mine = measures[name]
        right, missed = mine["recall"].value or 0.0, 1.0 - (mine["located"].value or 0.0)
        rows.append(
            ConfusionRow(name, mine["recall"].n, [right, missed, *(shares.get((name, label), 0.0) for label in labels)])
        )
    heading = f"{one.word}: what objects are told as, % of each category (n)"
    return confusion_chart(heading, ["right", "nothing", *labels], rows)


def _percent(estimate: Estimate) -> float | None:
    return None if estimate.value is None else 100 * estimate.value


def _interval(estimate: Estimate) -> Interval | None:
    return None if estimate.interval is None else (100 * estimate.interval[0], 100 * estimate.interval[1])
