"""Build tables of perceptions: what they find, what they take it for, and the memory that results."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from evonav.counted import counted
from evonav.perception_benchmark.other_scores import Measures
from evonav.perception_benchmark.scores import COMPARED, COMPARED_MEMORY, Scores, differences
from evonav.report.export import csv_text
from evonav.report.tables.numbers import NONE, estimate_text
from evonav.report.tables.table import Table

MAX_CATEGORIES, MAX_CONFUSIONS = 8, 4
INTERVALS = "[..]: 95% interval, bootstrap by house."
WITH_N, SIGNED = {"has_n": True}, {"is_signed": True}
TWO_DIGITS, THREE_DIGITS = {"scale": 1, "digits": 2}, {"scale": 1, "digits": 3}
"""Ways to write an estimate: options of `estimate_text`."""


def perception_tables(found: Sequence[Scores], *, is_brief: bool = False) -> list[Table]:
    """Return all tables, in reading order; if `is_brief`, with the most frequent categories alone, for a terminal."""
    tables = [
        _headline(found),
        _differences(found),
        _table(
            "Places and labels apart",
            _overall(found),
            {
                "located": ("located", {}),
                "label right": ("labelled", {}),
                "mean IoU": ("iou", {}),
                "places alone": ("ap50_located", {}),
            },
            "In %. Located: objects at whose place something is told (IoU 0.5), whatever its label. Label right, mean "
            "IoU: of those. Places alone: AP50 if all labels were right.",
        ),
        *(_by_group(found, by, name) for by, name in (("distance", "distance"), ("size", "size in the image"))),
        _table(
            "Recall by how much is in the way",
            ((one.perception, {name: of["recall"] for name, of in one.groups["outline"].items()}) for one in found),
            {name: (name, WITH_N) for name in found[0].groups["outline"]},
            "In % (n), by the part of the object's outline that is cut by nothing nearer, nor by the image's border.",
        ),
        _categories(found, MAX_CATEGORIES if is_brief else None),
        _confusions(found, MAX_CONFUSIONS if is_brief else 4 * MAX_CONFUSIONS),
        _table(
            "The memory of objects that comes of it",
            ((one.perception, one.memory) for one in found),
            {
                "entries": ("entries", {"scale": 1}),
                "objects seen": ("seen", {"scale": 1}),
                "precision %": ("memory_precision", {}),
                "recall %": ("memory_recall", {}),
                "error m": ("position_error_m", TWO_DIGITS),
                "surplus %": ("surplus", {}),
                "wrong label %": ("wrong_label", {}),
                "phantoms %": ("phantoms", {}),
            },
            "After the first house's tour, a house. Precision: an object of the entry's label stands within 0.3 m of "
            "it; recall: of objects seen from at most 3.5 m. Error: middle to middle, of entries with their object's "
            "label.",
            "Surplus: entries beyond an object's first, per object; wrong label: of entries with an object; phantoms: "
            "most of the entry's detections were of no object.",
        ),
        _table(
            "Stale entries in the next house",
            ((one.perception, one.memory) for one in found if one.memory["stale_at_start"].n),
            {"as it begins": ("stale_at_start", WITH_N), "after its tour": ("stale_after_tour", WITH_N)},
            "Entries that were right in the house before and are not in this one; in % of all entries (n).",
        ),
        _table(
            "Confidence, depth and pose",
            _overall(found),
            {
                "ECE %": ("ece", {}),
                "depth error %": ("depth_relative", {}),
                "depth RMSE m": ("depth_rmse_m", THREE_DIGITS),
                "depth lost %": ("depth_lost", {}),
                "offset m": ("pose_offset_m", THREE_DIGITS),
                "turn °": ("pose_turn_deg", TWO_DIGITS),
            },
            "ECE: mean gap between confidence and precision, in tenths of confidence. Depth error: mean of |error| / "
            "depth.",
        ),
        _table(
            "Cosines of features",
            _overall([one for one in found if one.cosines]),
            {
                "same object": ("cosine_same_object", THREE_DIGITS),
                "same category": ("cosine_same_category", THREE_DIGITS),
                "other": ("cosine_other", THREE_DIGITS),
                "its perception": ("cosine_text_own", THREE_DIGITS),
                "other words": ("cosine_text_other", THREE_DIGITS),
                "nearest word right %": ("text_right", WITH_N),
            },
        ),
    ]
    return [table for table in tables if table.rows]


def _table(
    title: str,
    rows: Iterable[tuple[str, Measures]],
    columns: Mapping[str, tuple[str, Mapping[str, Any]]],
    *notes: str,
    first: str = "perception",
) -> Table:
    """Build a table with one row per perception and one column per metric.

    `columns` has the name of a metric and options of `estimate_text` by heading; `first` is the heading of the names.
    """
    cells = tuple(
        (name, *(estimate_text(measures.get(measure), **form) for measure, form in columns.values()))
        for name, measures in rows
    )
    return Table(title, (first, *columns), cells, notes)


def _overall(found: Sequence[Scores]) -> Iterator[tuple[str, Measures]]:
    return ((one.perception, one.overall) for one in found)


def _headline(found: Sequence[Scores]) -> Table:
    first = found[0]
    table = _table(
        "What perceptions find",
        _overall(found),
        {head: (head.lower(), {}) for head in ("AP50", "AP", "precision", "recall", "F1")},
        f"{counted(first.num_tasks, 'task')} in {counted(first.num_houses, 'house')}, "
        f"{counted(first.num_views, 'view')} each perception. {INTERVALS}",
        "In %, at IoU 0.5 and with the right label; AP: mean over IoU 0.5 to 0.95.",
    )
    counts = [(str(one.overall["recall"].n), str(one.overall["precision"].n)) for one in found]
    rows = tuple(row + more for row, more in zip(table.rows, counts, strict=True))
    return replace(table, columns=(*table.columns, "objects", "detections"), rows=rows)


def _differences(found: Sequence[Scores]) -> Table:
    heads = ("AP50", "AP", "precision", "recall", "F1", "located", "memory precision", "memory recall")
    return _table(
        "Perceptions against each other",
        ((f"{ours} minus {less}", measures) for (ours, less), measures in differences(found).items()),
        {head: (name, SIGNED) for head, name in zip(heads, (*COMPARED, *COMPARED_MEMORY), strict=True)},
        f"In points. {INTERVALS} Of the same views; not adjusted for how many are compared.",
        first="perceptions",
    )


def _by_group(found: Sequence[Scores], by: str, quantity: str) -> Table:
    rows = tuple(
        (one.perception, measure, *(estimate_text(group[measure], has_n=True) for group in one.groups[by].values()))
        for one in found
        for measure in ("recall", "precision")
    )
    note = (
        f"In % (n). {INTERVALS} Recall: by the true object's {quantity}; "
        "precision: by the detection's own, as perceived."
    )
    return Table(f"By {quantity}", ("perception", "", *found[0].groups[by]), rows, (note,))


def _categories(found: Sequence[Scores], most: int | None) -> Table:
    names = list(found[0].groups["category"])
    rows = tuple(
        (
            name if i == 0 else "",
            one.perception,
            str(mine["recall"].n),
            str(mine["precision"].n),
            *(estimate_text(mine[measure]) for measure in ("recall", "precision", "ap50", "labelled")),
        )
        for name in names[:most]
        for i, one in enumerate(found)
        for mine in (one.groups["category"][name],)
    )
    columns = ("category", "perception", "objects", "detections", "recall", "precision", "AP50", "label right")
    left = "" if most is None or len(names) <= most else f" The {most} most frequent of {len(names)}."
    return Table("By category", columns, rows, (f"In %. {INTERVALS}{left}",))


def _confusions(found: Sequence[Scores], most: int) -> Table:
    rows: list[tuple[str, ...]] = []
    for one in found:
        rows += [
            (one.perception, each.category, each.label, str(each.num), estimate_text(each.share, has_n=True))
            for each in one.confusions[:most]
        ]
        rows += [(one.perception, "(nothing)", label, str(num), NONE) for label, num in one.unexplained[: most // 2]]
    note = f"The most frequent. {INTERVALS}"
    columns = ("perception", "object", "told as", "times", "of the objects %")
    return Table("What is taken for what", columns, tuple(rows), (note,))


def perception_csv(found: Sequence[Scores]) -> str:
    """Return every number as a CSV row, unrounded."""
    columns = ("perception", "by", "group", "measure", "value", "low", "high", "n", "num_houses")
    rows: list[tuple[object, ...]] = []

    def write(perception: str, by: str, group: str, measures: Measures) -> None:
        for name, each in measures.items():
            ends = each.ci95 or (None, None)
            rows.append((perception, by, group, name, each.value, *ends, each.n, found[0].num_houses))

    for (ours, less), measures in differences(found).items():
        write(ours, "less", less, measures)
    for one in found:
        write(one.perception, "", "", one.overall)
        write(one.perception, "memory", "", one.memory)
        for share, measures in one.memory_curve:
            write(one.perception, "memory by share of the tour", f"{share:g}", measures)
        for by, parts in {**one.groups, "depth": one.depth}.items():
            for group, measures in parts.items():
                write(one.perception, by, group, measures)
        for pair in one.confusions:
            write(one.perception, "confusion", f"{pair.category} as {pair.label}", {"share": pair.share})
    return csv_text(columns, rows)
