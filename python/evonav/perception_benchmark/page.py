"""Write the files of a perception report: `report.html` with its plots, `summary.json`, `summary.csv`, `summary.md`."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from evonav.parallel.folders import write_atomically
from evonav.perception_benchmark.average_precision import RECALLS
from evonav.perception_benchmark.records import NUM_COSINE_BINS, read_header, read_records
from evonav.perception_benchmark.scores import Scores, differences, scores
from evonav.perception_benchmark.tables import perception_csv, perception_tables
from evonav.report.pages.template import page_text, text_of
from evonav.report.plots.render import plot_elements
from evonav.report.plots.specs import ConfusionPlot, ConfusionRow, CurvePlot, GroupPlot, Line, Plot, Series
from evonav.report.plots.style import plot_css
from evonav.report.tables.table import markdown_tables
from evonav.statistics import Estimate

REPORT_NAME = "report.html"
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


def write_perception_report(folder: Path) -> tuple[Path, list[Scores]]:
    """Write the report's files from a folder's records.

    Returns:
        The page, and the scores that it shows.

    Raises:
        StoreError: There are no records, or a file cannot be read or written.
    """
    header = read_header(folder)
    found = scores(read_records(folder))
    tables = perception_tables(found)
    summary = {
        "schema_version": 1,
        "perceptions": [_value(replace(one, pictures=())) for one in found],
        "differences": [
            {"perception": ours, "less": less, **_value(measures)}
            for (ours, less), measures in differences(found).items()
        ],
    }
    write_atomically(folder / "summary.json", json.dumps(summary, indent=2) + "\n")
    write_atomically(folder / "summary.csv", perception_csv(found))
    write_atomically(folder / "summary.md", markdown_tables(tables))
    text = page_text(
        "perception.html.j2",
        text_of("report.css") + plot_css() + text_of("perception.css"),
        name=folder.resolve().name,
        found=found,
        missing=0 if header is None else len(header.tasks) - found[0].num_tasks,
        tables=tables,
        plots=plot_elements(perception_plots(found)),
        confusions=plot_elements([_confusion_plot(one) for one in found if one.confusions]),
        features=plot_elements(feature_plots(found)),
        tasks=[task for task, _ in found[0].pictures],
        pictures={(one.perception, task): picture for one in found for task, picture in one.pictures},
    )
    return write_atomically(folder / REPORT_NAME, text), found


def _value(value: Any) -> Any:  # noqa: ANN401 - a part of the scores
    """Return a part of the scores as JSON."""
    if isinstance(value, Estimate):
        return {"value": value.value, "interval": value.ci95, "n": value.n}
    if is_dataclass(value):
        return {field.name: _value(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {name: _value(part) for name, part in value.items()}
    return [_value(part) for part in value] if isinstance(value, list | tuple) else value


# Plots


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
    """Return a table in shades of what a perception takes objects for."""
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
