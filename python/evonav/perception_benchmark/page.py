"""Write the files of a perception report: `report.html`, `summary.json`, `summary.csv`, `summary.md`."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from evonav.parallel.folders import write_atomically
from evonav.perception_benchmark.plots import confusion_plots, feature_plots, perception_plots
from evonav.perception_benchmark.records import read_header, read_records
from evonav.perception_benchmark.scores import Scores, differences, scores
from evonav.perception_benchmark.tables import perception_csv, perception_tables
from evonav.report.pages.template import page_text, text_of
from evonav.report.plots.render import plot_elements
from evonav.report.plots.style import plot_css
from evonav.report.tables.table import markdown_tables
from evonav.statistics import Estimate

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
    """Return the content of `summary.json`: all scores but the pictures."""
    return {
        "schema_version": 1,
        "perceptions": [_value(replace(one, pictures=())) for one in found],
        "differences": [
            {"perception": ours, "less": less, **_value(measures)}
            for (ours, less), measures in differences(found).items()
        ],
    }


def _value(value: Any) -> Any:  # noqa: ANN401 - a part of the scores
    """Return a part of the scores as JSON."""
    if isinstance(value, Estimate):
        return {"value": value.value, "interval": value.ci95, "n": value.n}
    if is_dataclass(value):
        return {field.name: _value(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {name: _value(part) for name, part in value.items()}
    return [_value(part) for part in value] if isinstance(value, list | tuple) else value
