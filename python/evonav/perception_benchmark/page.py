"""Write the files of a perception report: `report.html`, `summary.json`, `summary.csv`, `summary.md`."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evonav.parallel.folders import write_atomically
from evonav.perception_benchmark.other_scores import measure_values
from evonav.perception_benchmark.plots import confusion_plots, feature_plots, perception_plots
from evonav.perception_benchmark.records import read_header, read_records
from evonav.perception_benchmark.scores import Scores, differences, scores
from evonav.perception_benchmark.tables import perception_csv, perception_tables
from evonav.report.pages.template import page_text, text_of
from evonav.report.plots.render import plot_elements
from evonav.report.plots.style import plot_css
from evonav.report.tables.table import markdown_tables

REPORT_NAME = "report.html"


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
    write_atomically(folder / "summary.json", json.dumps(perception_json(found), indent=2) + "\n")
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
        confusions=plot_elements(confusion_plots(found)),
        features=plot_elements(feature_plots(found)),
        tasks=[task for task, _ in found[0].pictures],
        pictures={(one.perception, task): picture for one in found for task, picture in one.pictures},
    )
    return write_atomically(folder / REPORT_NAME, text), found


def perception_json(found: Sequence[Scores]) -> dict[str, Any]:
    """Return the content of `summary.json`."""
    return {
        "schema_version": 1,
        "perceptions": [_values(one) for one in found],
        "differences": [
            {"perception": each.perception, "less": each.less, **measure_values(each.measures)}
            for each in differences(found)
        ],
    }


def _values(one: Scores) -> dict[str, Any]:
    groups: Mapping[str, Any] = {
        by: [{"name": group.name, **measure_values(group.measures)} for group in rows]
        for by, rows in {**one.groups, "depth": one.depth}.items()
    }
    return {
        "perception": one.perception,
        "num_tasks": one.num_tasks,
        "num_houses": one.num_houses,
        "num_views": one.num_views,
        "overall": measure_values(one.overall),
        "groups": groups,
        "confusions": [
            {"category": each.category, "label": each.label, "num": each.num, **measure_values({"share": each.share})}
            for each in one.confusions
        ],
        "unexplained": [{"label": label, "num": num} for label, num in one.unexplained],
        "precision_at_recall": list(one.precision_curve),
        "calibration": [
            {"confidence": confidence, **measure_values({"precision": each})} for confidence, each in one.calibration
        ],
        "cosines": {name: list(counts) for name, counts in one.cosines.items()},
        "memory": measure_values(one.memory),
        "memory_by_share": [{"share": share, **measure_values(measures)} for share, measures in one.memory_curve],
    }
